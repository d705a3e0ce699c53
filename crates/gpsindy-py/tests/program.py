"""The wheel's own command, as a user's shell starts it, and the logs that it reads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np


def command(*arguments, folder=None, **environment):
    """Runs the command as a user's shell does."""
    line = [sys.executable, "-m", "gpsindy", *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, cwd=folder, env={**os.environ, **environment}, check=False)


def write_log(path, log):
    """Writes columns of a log as CSV, every digit kept."""
    names = list(log)
    rows = np.column_stack([log[name] for name in names])
    path.write_text("\n".join([",".join(names), *(",".join(repr(float(v)) for v in row) for row in rows), ""]))
