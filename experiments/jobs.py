"""Runs many small jobs on all cores; every result is a line of a file, so that an interrupted experiment goes on."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

Job = dict[str, Any]
Result = dict[str, Any]


def key_of(job: Job) -> str:
    """What tells a job from every other one of its experiment."""
    return json.dumps(job, sort_keys=True)


def load(store: Path) -> dict[str, Result]:
    """Results by key; a line that an interruption cut short is dropped."""
    found: dict[str, Result] = {}
    if store.exists():
        for line in store.read_text(encoding="utf-8").splitlines():
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue
            found[key_of(entry["job"])] = entry
    return found


def run(jobs: Iterable[Job], work: Callable[[Job], Result], store: Path, workers: int | None = None) -> list[Result]:
    """The results of all jobs, in their order; those that `store` has already are not computed again.

    `work` is a function of a module, so that other processes find it; each of them uses one thread. An exception
    becomes a result with the key `error` and is not tried again: delete the line to do so.
    """
    wanted = list(jobs)
    done = load(store)
    missing = [job for job in wanted if key_of(job) not in done]
    if missing:
        store.parent.mkdir(parents=True, exist_ok=True)
        workers = workers or os.cpu_count() or 1
        progress = Progress(len(wanted), len(wanted) - len(missing))
        torn = store.exists() and not store.read_text(encoding="utf-8").endswith("\n")
        with store.open("a", encoding="utf-8") as file:
            if torn:  # The line that an interruption cut short stays a line of its own.
                file.write("\n")
            for entry in _computed(missing, work, workers):
                done[key_of(entry["job"])] = entry
                file.write(json.dumps(entry) + "\n")
                file.flush()
                progress.tick()
        progress.end()
    return [done[key_of(job)] for job in wanted]


def _computed(jobs: list[Job], work: Callable[[Job], Result], workers: int) -> Iterable[Result]:
    if workers == 1:
        with threadpool_limits(1):
            yield from (_guarded(work, job) for job in jobs)
        return
    waiting = iter(jobs)
    running: set[Future[Result]] = set()
    with ProcessPoolExecutor(workers, initializer=threadpool_limits, initargs=(1,)) as pool:
        try:
            while True:
                for job in waiting:
                    running.add(pool.submit(_guarded, work, job))
                    if len(running) >= 2 * workers:
                        break
                if not running:
                    return
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in finished)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _guarded(work: Callable[[Job], Result], job: Job) -> Result:
    start = time.process_time()
    try:
        found = work(job)
    except Exception as error:  # A method that fails is a finding, not an end of the experiment.
        found = {"error": f"{type(error).__name__}: {error}"}
    return {"job": job, **found, "seconds": round(time.process_time() - start, 3)}


class Progress:
    """A line on stderr: how much is done and how long the rest will take."""

    def __init__(self, total: int, done: int) -> None:
        self.total, self.done, self.at_start = total, done, done
        self.start = self.shown = time.monotonic()

    def tick(self) -> None:
        """One more job is done."""
        self.done += 1
        now = time.monotonic()
        if now - self.shown > (0.5 if sys.stderr.isatty() else 30.0) or self.done == self.total:
            self.shown = now
            left = (now - self.start) / (self.done - self.at_start) * (self.total - self.done)
            end = "\r" if sys.stderr.isatty() else "\n"
            print(f"  {self.done} of {self.total} jobs, {left:.0f} s left   ", end=end, file=sys.stderr, flush=True)

    def end(self) -> None:
        """The line stays."""
        if sys.stderr.isatty():
            print(file=sys.stderr)
