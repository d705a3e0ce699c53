"""Processes that step copies of one FMU side by side: few libraries of FMUs can be called from two threads."""

from __future__ import annotations

import os
import pickle
import struct
import subprocess
import sys
import weakref
from typing import Any, BinaryIO

import numpy as np

from gpsindy.data._tables import Array
from gpsindy.fmu.copies import Kind


class Workers:
    """Programs of their own, each with its copies; they are started by the first call and end with this object.

    They are no ``multiprocessing`` pool, which runs the user's own program once more in every process.
    """

    def __init__(self, path: str, folder: str, kind: Kind, references: list[list[int]], count: int) -> None:
        self._made = (path, folder, kind, references)
        self._count = count
        self._processes: list[subprocess.Popen[bytes]] = []

    def begin(self, chunks: list[tuple[Array, Array, Array, Array, Array, int]]) -> None:
        """Hands a chunk of rows to every process; at most as many as there are."""
        if not self._processes:
            line = [sys.executable, "-c", "from gpsindy.fmu.workers import serve; serve()"]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            for _ in range(self._count):
                process = subprocess.Popen(line, **pipes)  # type: ignore[call-overload]
                weakref.finalize(self, _end, process)
                self._processes.append(process)
                _send(process.stdin, self._made)
        for process, chunk in zip(self._processes, chunks):
            _send(process.stdin, chunk)

    def end(self, count: int) -> list[Array]:
        """The answers to ``count`` chunks, in their order.

        Raises
        ------
        ValueError
            What a copy raised.
        RuntimeError
            A process that ended.
        """
        answers = [_receive(process.stdout) for process in self._processes[:count]]
        for answer in answers:
            if isinstance(answer, str):
                raise ValueError(answer)
            if answer is None:
                raise RuntimeError("a process that steps the FMU ended; use processes=1 to see what the FMU says")
        return answers


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.stdin is not None:
        process.stdin.close()
    process.wait()
    if process.stdout is not None:
        process.stdout.close()


def _send(pipe: Any, value: Any) -> None:
    data = pickle.dumps(value)
    try:
        pipe.write(struct.pack("<Q", len(data)) + data)
        pipe.flush()
    except BrokenPipeError:
        # Told by the answer that does not come.
        return


def _receive(pipe: Any) -> Any:
    head = pipe.read(8)
    if len(head) < 8:
        return None
    (size,) = struct.unpack("<Q", head)
    data = pipe.read(size)
    return pickle.loads(data) if len(data) == size else None


def answered(source: BinaryIO, sink: BinaryIO) -> None:
    """Answers what comes: the FMU first, then chunks of rows, until the pipe closes."""
    import fmpy

    from gpsindy.fmu.copies import copies

    path, folder, kind, references = _receive(source)
    own = copies(fmpy.read_model_description(path), folder, kind, references)
    while (chunk := _receive(source)) is not None:
        try:
            answer: Any = own.step(*chunk)
        except Exception as error:  # Everything that a copy raises goes to the one who asked.
            answer = str(error)
        _send(sink, answer)


def shared(count: int, parts: int) -> list[slice]:
    """``count`` rows in as many slices as there are ``parts``, none empty."""
    bounds = np.linspace(0, count, min(parts, count) + 1).astype(int)
    return [slice(int(low), int(high)) for low, high in zip(bounds[:-1], bounds[1:])]


def serve() -> None:
    """The whole program of a process."""
    # What the FMU prints must not get between the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    answered(sys.stdin.buffer, answers)
