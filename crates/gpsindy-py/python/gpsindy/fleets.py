"""A fleet of machines: one diagnosis for each unit and period, on any pool of workers, and their comparison."""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from itertools import islice
from queue import SimpleQueue
from typing import Any

from gpsindy import _gpsindy
from gpsindy._stores import Remote, store, where
from gpsindy.data.dataset import Path
from gpsindy.model import Hold

#: Rounds in a row in which every task left lost its worker, after which a fleet is given up.
_TRIES = 5

#: Tasks that are submitted at a time: more than the workers of any cluster, and few enough to keep in memory.
_FLIGHT = 10_000


class Fleet:
    """What a fleet's comparison found; its JSON follows ``gpsindy.fleet/1``.

    Attributes
    ----------
    out : str
        The folder or URL with ``fleet.html``, ``fleet.json`` and the units' reports.
    """

    __slots__ = ("_report", "out")

    def __init__(self, report: str, out: str) -> None:
        self._report: dict[str, Any] = json.loads(report)
        self.out = out

    @property
    def units(self) -> list[dict[str, Any]]:
        """One entry a unit and period: verdict, causes, share of the gap closed, key of its report."""
        return list(self._report["units"])

    @property
    def population(self) -> list[dict[str, Any]]:
        """One entry a size: mean, spread, slopes of covariates, range to randomise, estimates of the units."""
        return list(self._report["population"])

    @property
    def odd(self) -> list[dict[str, Any]]:
        """Units that the rest of the fleet does not predict."""
        return list(self._report["odd"])

    @property
    def changes(self) -> list[dict[str, Any]]:
        """Steps and drifts of single units, with the covariates held."""
        return list(self._report["changes"])

    @property
    def failed(self) -> list[dict[str, Any]]:
        """Tasks without a report, and why."""
        return list(self._report["failed"])

    def to_dict(self) -> dict[str, Any]:
        """The whole report, as in ``fleet.json``."""
        return dict(self._report)

    def __repr__(self) -> str:
        parts = (("units", self.units), ("odd", self.odd), ("changes", self.changes), ("failed", self.failed))
        return f"Fleet({', '.join(f'{name}={len(entries)}' for name, entries in parts)}, out={self.out!r})"


def _task(
    task: str,
    place: str | Remote,
    options: dict[str, Any],
    columns: tuple[str | None, str | None],
    threads: int | None = None,
    _turn: str = "",
) -> tuple[str | None, str | None]:
    """One task in a worker: the key of its report, or why there is none.

    ``_turn`` differs from one try to the next: dask gives an equal call its earlier result or error.
    """
    return _gpsindy.fleet_task(task, place, options, *columns, threads)


def fleet(
    manifest: Path,
    *,
    out: Path,
    executor: Executor | Callable[[], Executor] | None = None,
    effects: Iterable[str] = (),
    without: Iterable[str] = (),
    confidence: float = 0.95,
    most_effects: int = 6,
    hold: Hold | None = None,
    time: str | None = None,
    run: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Fleet:
    """Diagnoses every unit and period of a manifest, and compares them.

    A task is named by its content, so that a second call does only what is missing. The reports are the same bytes on any executor.

    Parameters
    ----------
    manifest : path
        TOML or CSV: ``unit``, ``logs``, ``model``, and where wanted ``holdout`` and ``since``; other keys are covariates.
    out : path or str
        Folder of the reports and of the comparison, or a URL that fsspec knows (``s3://bucket/fleet``; needs ``gpsindy[fsspec]``).
        Every worker reads the logs and writes the reports itself, so both must be within its reach.
    executor : concurrent.futures.Executor or callable, default None
        Any executor: a process pool, dask's ``Client.get_executor()``, MPI's. A callable makes one, and makes another when that one
        broke because a worker died. A process pool breaks as a whole when one of its workers dies: hand in a callable to go on.
        Dask, Ray and MPI have workers of their own that go on. ``None`` works one task after the other here, each on all cores.
    effects, without : iterables of str
        Only these suspects; not these.
    confidence : float, default 0.95
        Of intervals.
    most_effects : int, default 6
    hold : {"zero", "linear"} or None
    time, run : str or None
        Columns of the logs.
    progress : callable, default None
        Called with (done, total).

    Returns
    -------
    Fleet

    Raises
    ------
    ValueError
        A manifest that can't be read.
    RuntimeError
        The executor broke and is no callable that makes another, or tasks lost their worker again and again. What was done is kept.
    OSError
        A result that can't be written.
    """
    place = store(out)
    options: dict[str, Any] = {
        "effects": list(effects),
        "without": list(without),
        "custom": [],
        "allow_place": False,
        "all_suspects": False,
        "confidence": confidence,
        "most_effects": most_effects,
        "hold": hold,
        "keep_function": False,
        "time_limit": None,
        "power": None,
    }
    entries = _gpsindy.FleetManifest(os.path.abspath(os.fspath(manifest)))
    tasks = [(task, place, options, (time, run)) for task in entries.tasks()]
    if executor is None:
        results = []
        for task in tasks:
            results.append(_task(*task))
            if progress is not None:
                progress(len(results), len(tasks))
    else:
        results = _spread(tasks, executor, progress)
    return Fleet(entries.compare(results, place), where(place))


def _spread(
    tasks: list[tuple[Any, ...]],
    executor: Executor | Callable[[], Executor],
    progress: Callable[[int, int], object] | None,
) -> list[tuple[str | None, str | None]]:
    """Every task on the executor; those of lost workers again."""
    results: dict[int, tuple[str | None, str | None]] = {}
    fruitless = 0
    while len(results) < len(tasks):
        before = len(results)
        pool = executor if isinstance(executor, Executor) else executor()
        try:
            lost = _round(pool, tasks, results, progress)
        finally:
            if not isinstance(executor, Executor):
                # A pool of processes that still closes when Python ends is closed by two threads at once. A worker that hangs is not
                # waited for.
                pool.shutdown(wait=len(results) == len(tasks))
        if lost is None:
            continue
        fruitless = fruitless + 1 if len(results) == before else 0
        left = len(tasks) - len(results)
        if isinstance(executor, Executor) and isinstance(lost, BrokenExecutor):
            raise RuntimeError(
                f"the executor broke with {left} tasks left; what was done is kept: call again to do the rest, or hand in a function "
                "that makes an executor"
            ) from lost
        if fruitless == _TRIES:
            raise RuntimeError(
                f"{left} tasks lost their worker {_TRIES} times in a row; what was done is kept: call again to do the rest"
            ) from lost
    return [results[index] for index in range(len(tasks))]


def _round(
    pool: Executor,
    tasks: list[tuple[Any, ...]],
    results: dict[int, tuple[str | None, str | None]],
    progress: Callable[[int, int], object] | None,
) -> BaseException | None:
    """Submits what has no result and collects results; the last loss of a worker, if there was one."""
    lost: BaseException | None = None
    turn = secrets.token_hex(8)
    missing = iter([index for index in range(len(tasks)) if index not in results])
    waiting: dict[Future[tuple[str | None, str | None]], int] = {}
    done: SimpleQueue[Future[tuple[str | None, str | None]]] = SimpleQueue()

    def submit(count: int) -> None:
        nonlocal lost
        for index in islice(missing, count):
            # Workers are the parallel part: each task keeps to one core.
            arguments: tuple[Any, ...] = (*tasks[index], 1, turn)
            try:
                future = pool.submit(_task, *arguments)
            except BrokenExecutor as failure:
                lost = failure
                return
            waiting[future] = index
            future.add_done_callback(done.put)

    submit(_FLIGHT)
    try:
        while waiting:
            future = done.get()
            # A future that is kept keeps its result, on a cluster in the memory of a worker.
            index = waiting.pop(future)
            try:
                results[index] = future.result()
            except Exception as failure:
                if not _is_loss(failure):
                    raise
                lost = failure
            else:
                if progress is not None:
                    progress(len(results), len(tasks))
            if not isinstance(lost, BrokenExecutor):
                submit(1)
    finally:
        for future in waiting:
            future.cancel()
    return lost


def _is_loss(failure: BaseException) -> bool:
    """Whether a worker was lost, and not a fault of the task. Engines have words of their own for that."""
    return isinstance(failure, (BrokenExecutor, CancelledError)) or type(failure).__name__ in _LOST


#: What dask, Ray and loky call a worker that died.
_LOST = {
    "CommClosedError",
    "FutureCancelledError",
    "KilledWorker",
    "NodeDiedError",
    "OwnerDiedError",
    "RayActorError",
    "ActorDiedError",
    "TerminatedWorkerError",
    "WorkerCrashedError",
}
