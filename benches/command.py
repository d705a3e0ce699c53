"""A command and what it took."""

from __future__ import annotations

import os
import subprocess
import time
from typing import NamedTuple


class Took(NamedTuple):
    seconds: float
    busy: float
    """Processor time, s."""
    megabytes: float
    """Largest memory."""
    failure: str
    """Status and last line of the errors; empty where it ended well."""


def run(command: list[str], folder: str) -> Took:
    begin = time.perf_counter()
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    errors = child.stderr.read().decode()
    _, status, usage = os.wait4(child.pid, 0)
    seconds = time.perf_counter() - begin
    failure = "" if status == 0 else f"  status {os.waitstatus_to_exitcode(status)}: {errors.strip().splitlines()[-1:]}"
    return Took(seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, failure)
