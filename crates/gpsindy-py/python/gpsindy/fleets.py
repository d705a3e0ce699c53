"""A fleet of machines: one diagnosis for each unit and period, on any pool of workers, and their comparison."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, Executor, Future, as_completed
from concurrent.futures import BrokenExecutor
from typing import Any

from gpsindy import _gpsindy
from gpsindy.dataset import Path
from gpsindy.model import Hold

#: Times a task is tried again after its worker was lost.
_TRIES = 5


class Fleet:
    """What a fleet's comparison found; its JSON follows ``gpsindy.fleet/1``.

    Attributes
    ----------
    out : str
        The folder with ``fleet.html``, ``fleet.json`` and the units' reports.
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


def _task(manifest: str, out: str, index: int, options: dict[str, Any], time: str | None, run: str | None) -> int:
    """One task in a worker. A failure of its own is written below ``out`` and is no exception."""
    _gpsindy.fleet_task(manifest, out, index, options, time, run)
    return index


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
    out : path
        Folder of the reports and of the comparison.
    executor : concurrent.futures.Executor or callable, default None
        Any executor: a process pool, dask's ``Client.get_executor()``, MPI's. A callable makes one, and makes another when that one
        broke because a worker died. ``None`` works one task after the other here, each on all cores.
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
        The executor broke, and none could be made in its place. What was done is kept.
    """
    path, folder = os.path.abspath(os.fspath(manifest)), os.path.abspath(os.fspath(out))
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
    count = len(_gpsindy.fleet_tasks(path))
    os.makedirs(folder, exist_ok=True)
    tasks = [(path, folder, index, options, time, run) for index in range(count)]
    if executor is None:
        for done, task in enumerate(tasks, 1):
            _task(*task)
            if progress is not None:
                progress(done, count)
    else:
        _spread(tasks, executor, progress)
    return Fleet(_gpsindy.fleet_compare(path, folder, options, time, run), folder)


def _spread(
    tasks: list[tuple[Any, ...]],
    executor: Executor | Callable[[], Executor],
    progress: Callable[[int, int], object] | None,
) -> None:
    """Every task on the executor; those of lost workers again."""
    open_tasks = dict(enumerate(tasks))
    given = executor if isinstance(executor, Executor) else None
    for _ in range(_TRIES + len(tasks)):
        pool = given if given is not None else executor()  # type: ignore[operator]
        before = len(open_tasks)
        broke = _round(pool, open_tasks, len(tasks), progress)
        if given is None:
            pool.shutdown(wait=False, cancel_futures=True)
        if not open_tasks:
            return
        if broke is not None and given is not None and before == len(open_tasks):
            raise RuntimeError(
                f"the executor broke with {len(open_tasks)} tasks left; call again to do the rest, or hand in a function that makes "
                "an executor"
            ) from broke
    raise RuntimeError(f"{len(open_tasks)} tasks lost their worker every time; what was done is kept")


def _round(
    pool: Executor,
    open_tasks: dict[int, tuple[Any, ...]],
    total: int,
    progress: Callable[[int, int], object] | None,
) -> BaseException | None:
    """Submits what is open and takes out what is done; the first loss of a worker, if there was one."""
    lost: BaseException | None = None
    futures: dict[Future[int], int] = {}
    try:
        for index, task in open_tasks.items():
            futures[pool.submit(_task, *task)] = index
    except (BrokenExecutor, RuntimeError) as failure:
        lost = failure
    for future in as_completed(list(futures)):
        try:
            future.result()
        except (BrokenExecutor, CancelledError) as failure:
            lost = failure
            continue
        except Exception as failure:
            # Engines have words of their own for a worker that died; the input was checked before.
            if type(failure).__name__ not in _LOST:
                raise
            lost = failure
            continue
        del open_tasks[futures[future]]
        if progress is not None:
            progress(total - len(open_tasks), total)
    return lost


#: What dask, Ray and loky call a worker that died.
_LOST = {"KilledWorker", "WorkerCrashedError", "RayTaskError", "TerminatedWorkerError", "CommClosedError"}
