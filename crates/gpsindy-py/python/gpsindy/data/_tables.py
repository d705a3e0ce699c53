"""Whatever holds samples, as tables: arrays, frames, mappings, Arrow streams, files.

Nothing is imported here but numpy. A frame is known by what it can do.
"""

from __future__ import annotations

import datetime
import difflib
import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpsindy import _gpsindy

Array = NDArray[np.float64]

TIME_NAMES = ("t", "time")


@dataclass(frozen=True)
class Table:
    """Samples of one run: columns in order, and the times where they are known."""

    names: tuple[str, ...] | None
    units: tuple[str, ...]
    values: Array
    time: Array | None
    run: str | None = None

    @property
    def n_samples(self) -> int:
        return int(self.values.shape[0])


class Frame:
    """Named columns of anything that has them; a column is converted when it is asked for."""

    def __init__(self, headers: Sequence[str], column: Callable[[str], Any], index: Any = None) -> None:
        self._column = column
        self._index = index
        self.headers: dict[str, str] = {}
        self.units: dict[str, str] = {}
        for header in headers:
            name, unit = _gpsindy.parse_header(header)
            if name in self.headers:
                raise ValueError(f"columns {self.headers[name]!r} and {header!r} have the same name; rename one of them")
            self.headers[name] = header
            self.units[name] = unit

    def find(self, name: str) -> str | None:
        """The column's name where ``name`` is it or is its whole header."""
        if name in self.headers:
            return name
        return next((known for known, header in self.headers.items() if header == name), None)

    def numbers(self, name: str) -> Array:
        return floats(self._column(self.headers[name]), f"column {name!r}")

    def times(self, name: str) -> Array:
        return seconds(self._column(self.headers[name]), f"column {name!r}")

    def index_times(self) -> Array | None:
        """The index of a pandas frame where it holds times: it is called ``t`` or ``time``, or its entries are dates or durations."""
        if self._index is None:
            return None
        kind = getattr(getattr(self._index, "dtype", None), "kind", "")
        called = str(getattr(self._index, "name", "")).lower() in TIME_NAMES
        return seconds(self._index, "the index") if called or kind in ("m", "M") else None

    def is_numeric(self, name: str) -> bool:
        try:
            self.numbers(name)
        except ValueError:
            return False
        return True


def seconds(values: Any, what: str) -> Array:
    """Times in seconds: numbers as they are, durations in seconds, dates and times since the first of them."""
    try:
        found = np.asarray(values)
    except ValueError:
        return floats(values, what)
    if found.dtype.kind == "O" and found.size > 0:
        known = [entry for entry in found.flat if entry is not None]
        if known and all(isinstance(entry, datetime.datetime) for entry in known):
            return np.array([_since(entry, known[0]) for entry in found.flat]).reshape(found.shape)
        if known and all(isinstance(entry, datetime.timedelta) for entry in known):
            return np.array([_since(entry, datetime.timedelta()) for entry in found.flat]).reshape(found.shape)
    if found.dtype.kind == "M" and found.ndim > 0:
        known = found[~np.isnat(found)]
        found = found - (known[0] if known.size else found[:1])
    if found.dtype.kind == "m":
        return np.asarray(found / np.timedelta64(1, "s"), dtype=np.float64)
    return floats(values, what)


def _since(entry: Any, first: Any) -> float:
    return float("nan") if entry is None else float((entry - first).total_seconds())


def floats(values: Any, what: str) -> Array:
    """Values as an array of floats; a missing value is NaN."""
    try:
        found = np.asarray(values)
        # They would be counted in nanoseconds, or in whatever unit they have.
        if found.dtype.kind not in ("m", "M"):
            return np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError) as first:
        if hasattr(values, "to_numpy"):
            try:
                return np.asarray(values.to_numpy(dtype=np.float64, na_value=np.nan), dtype=np.float64)
            except (TypeError, ValueError):
                pass
        raise ValueError(f"{what}: not numbers: {first}") from None
    raise ValueError(f"{what}: dates or durations, not numbers; only times may be that")


def frame(data: Any) -> Frame | None:
    """The columns of ``data``, or None where it has none by name."""
    if isinstance(data, Mapping):
        return Frame([str(name) for name in data], {str(name): values for name, values in data.items()}.__getitem__)
    if hasattr(data, "collect_schema") and hasattr(data, "collect"):
        # A lazy frame of polars has no values before it is collected.
        return frame(data.collect())
    names = getattr(getattr(data, "dtype", None), "names", None)
    if names:
        return Frame(list(names), data.__getitem__)
    if hasattr(data, "column_names") and hasattr(data, "__getitem__"):
        return Frame([str(name) for name in data.column_names], lambda name: data[name].to_numpy())
    if hasattr(data, "columns") and hasattr(data, "__getitem__") and not callable(data.columns):
        lookup = {str(name): name for name in data.columns}
        return Frame(list(lookup), lambda name: data[lookup[name]], getattr(data, "index", None))
    if hasattr(data, "__arrow_c_stream__"):
        return frame(_arrow(data))
    return None


def _arrow(stream: Any) -> Any:
    try:
        pyarrow = importlib.import_module("pyarrow")
    except ImportError:
        kind = type(stream).__name__
        raise ValueError(f"{kind} offers its columns as an Arrow stream only; install pyarrow to read it") from None
    return pyarrow.table(stream)


def is_list_of_runs(data: Any) -> bool:
    """A list of arrays or frames is a list of runs; anything else is one run."""
    if not isinstance(data, (list, tuple)) or not data:
        return False
    return all(_is_run(entry) for entry in data)


def _is_run(entry: Any) -> bool:
    if isinstance(entry, str):
        return False
    if isinstance(entry, (list, tuple)):
        return bool(entry) and isinstance(entry[0], (list, tuple, np.ndarray))
    return isinstance(entry, (np.ndarray, Table)) or frame(entry) is not None


def as_list(data: Any) -> list[Any]:
    return list(data) if is_list_of_runs(data) else [data]


def matrix(data: Any, what: str) -> Array:
    """An array of shape (samples, columns); one dimension is one column."""
    values = floats(data, what)
    if values.ndim == 1:
        values = values[:, None]
    if values.ndim != 2:
        raise ValueError(f"{what}: expected shape (samples, columns), found {values.shape}; several runs are a list of arrays")
    return values


def tables(data: Any, what: str, time: str | None = None) -> list[Table]:
    """One table a run. ``time`` names the time column of frames; without it ``t`` or ``time`` is looked for."""
    entries = as_list(data)
    if not entries or (isinstance(data, (list, tuple)) and not data):
        raise ValueError(f"{what}: no run; hand in at least one array or frame")
    several = len(entries) > 1
    return [_table(entry, f"{what}[{i}]" if several else what, time) for i, entry in enumerate(entries)]


def _table(entry: Any, what: str, time: str | None) -> Table:
    if isinstance(entry, Table):
        return entry
    columns = frame(entry)
    if columns is None:
        values = matrix(entry, what)
        return Table(None, ("",) * values.shape[1], values, None)
    clock = None
    if time is not None:
        clock = columns.find(time)
        if clock is None:
            raise ValueError(f"{what}: no time column {time!r}; found {', '.join(columns.headers)}")
    else:
        clock = next((name for name in TIME_NAMES if name in columns.headers), None)
    names = [name for name in columns.headers if name != clock and columns.is_numeric(name)]
    if not names:
        raise ValueError(f"{what}: no column of numbers besides the time")
    found = [columns.numbers(name) for name in names]
    for name, column in zip(names, found):
        if column.ndim != 1 or len(column) != len(found[0]):
            raise ValueError(f"{what}: column {name!r} has shape {column.shape}, column {names[0]!r} has {found[0].shape}")
    values = np.column_stack(found)
    units = tuple(columns.units[name] for name in names)
    return Table(tuple(names), units, values, columns.index_times() if clock is None else columns.times(clock))


def times(t: Any, runs: Sequence[Table], what: str = "t") -> list[Array]:
    """Sample times of every run: a step, one array for all, a list of them, or those of the frames."""
    if t is None:
        missing = [i for i, run in enumerate(runs) if run.time is None]
        if missing:
            where = f"run {missing[0]} brings no column `t` or `time`"
            raise ValueError(f"{what}: hand in the sample times or the step in seconds; {where}")
        return [run.time for run in runs if run.time is not None]
    if isinstance(t, (list, tuple)) and t and not all(np.ndim(entry) == 0 for entry in t):
        if len(t) != len(runs):
            raise ValueError(f"{what}: expected one array a run, {len(runs)} of them, found {len(t)}")
        each: list[Any] = list(t)
    else:
        each = [t] * len(runs)
    return [_time(entry, run, what) for entry, run in zip(each, runs)]


def _time(t: Any, run: Table, what: str) -> Array:
    values = seconds(t, what)
    if values.ndim == 0:
        if not values > 0:
            raise ValueError(f"{what}: the step must be above 0 s, found {float(values):g}")
        steps: Array = np.arange(run.n_samples, dtype=np.float64)
        steps *= float(values)
        return steps
    if values.shape != (run.n_samples,):
        raise ValueError(f"{what}: expected {run.n_samples} times, one a sample, found shape {values.shape}")
    return values


def contiguous(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64)


def readonly(values: Array) -> Array:
    values.flags.writeable = False
    return values


def unknown(said: str, name: str, known: Sequence[str]) -> ValueError:
    """The error of a name that is none of the known ones, after what is ``said`` of it: with the nearest of them, and all."""
    near = difflib.get_close_matches(name, known, 1)
    meant = f"did you mean {near[0]!r}? " if near else ""
    return ValueError(f"{said} {name!r}; {meant}found {', '.join(known)}")


def names_of(value: str | Iterable[str] | None) -> list[str]:
    if value is None:
        return []
    return [value] if isinstance(value, str) else [str(name) for name in value]
