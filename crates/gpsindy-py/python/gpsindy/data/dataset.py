"""Logs: runs of samples with named columns."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union, overload


from gpsindy import _gpsindy
from gpsindy.data._tables import Array, Table, contiguous, frame, is_list_of_runs, names_of, tables, times
from gpsindy.errors import DataWarning

Path = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True, eq=False)
class Run:
    """One uninterrupted log.

    Attributes
    ----------
    name : str
        As in reports; a file's name where it was read from one.
    t : ndarray of shape (n_samples,)
        Sample times, s.
    values : ndarray of shape (n_samples, n_columns)
        NaN is a missing value.
    columns : tuple of str
        Names of the columns.
    """

    name: str
    t: Array
    values: Array
    columns: tuple[str, ...]

    def __getitem__(self, column: str) -> Array:
        """The samples of one column."""
        if column not in self.columns:
            raise KeyError(f"no column {column!r}; found {', '.join(self.columns)}")
        return self.values[:, self.columns.index(column)]

    def __len__(self) -> int:
        return len(self.t)


class Dataset:
    """Runs that carry the same named columns.

    Parameters
    ----------
    runs : array, frame or list of them
        One run or a list of runs. A run is an array of shape (n_samples, n_columns), a mapping of columns, or a frame:
        pandas, polars, pyarrow, anything with the Arrow stream interface. NaN is a missing value.
    t : float, array or list of arrays, optional
        Times in seconds, or the step between samples. Left out, frames bring a column ``t`` or ``time``,
        or an index of that name or of dates. Dates with times
        (``datetime``, ``datetime64``) become seconds since the first of the run, durations (``timedelta``) become seconds.
    columns : sequence of str, optional
        Names of the columns of arrays; of frames the columns to keep.
    units : mapping of str to str, optional
        Unit of a column, for reports.
    names : sequence of str, optional
        Names of the runs. Default ``run 1``, ``run 2``, ...
    time : str, optional
        The time column of frames, where it is not ``t`` or ``time``.
    angles : str or sequence of str, optional
        Wrapped angles (rad) whose jumps are removed, once and at the full rate.

    Examples
    --------
    >>> import gpsindy
    >>> data = gpsindy.Dataset({"t": [0.0, 0.1, 0.2], "x [m]": [1.0, 0.9, 0.8]})
    >>> data
    Dataset of 1 run, 3 samples: x
    >>> data.units
    ('m',)
    >>> data[0]["x"]
    array([1. , 0.9, 0.8])
    """

    __slots__ = ("_inner",)
    _inner: _gpsindy.Dataset

    def __init__(
        self,
        runs: Any,
        t: Any = None,
        *,
        columns: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        names: Sequence[str] | None = None,
        time: str | None = None,
        angles: str | Iterable[str] = (),
    ) -> None:
        found = tables(runs, "runs", time)
        inner = inner_dataset(
            found, times(t, found), columns=None if columns is None else names_of(columns), units=units, names=names
        )
        unwrap = names_of(angles)
        self._inner = inner.unwrap_angles(unwrap) if unwrap else inner

    @classmethod
    def _of(cls, inner: _gpsindy.Dataset) -> Dataset:
        data = cls.__new__(cls)
        data._inner = inner
        return data

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self._inner.columns)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the columns, empty where none is known."""
        return tuple(self._inner.units)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(self._inner.names)

    def select(self, columns: str | Iterable[str]) -> Dataset:
        """The same runs with these columns only, in this order."""
        wanted = names_of(columns)
        for name in wanted:
            if name not in self.columns:
                raise ValueError(f"columns: no column {name!r}; found {', '.join(self.columns)}")
        places = [self.columns.index(name) for name in wanted]
        values = [contiguous(run.values[:, places]) for run in self]
        units = [self.units[place] for place in places]
        return Dataset._of(_gpsindy.Dataset(wanted, units, list(self.names), [run.t for run in self], values))

    def __len__(self) -> int:
        return len(self._inner)

    def __iter__(self) -> Iterator[Run]:
        return (self._run(i) for i in range(len(self)))

    @overload
    def __getitem__(self, index: int) -> Run: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int]) -> Dataset: ...
    def __getitem__(self, index: int | slice | Sequence[int]) -> Run | Dataset:
        """A run, or a dataset of some of the runs."""
        if isinstance(index, slice):
            index = range(len(self))[index]
        if isinstance(index, Sequence):
            return Dataset._of(self._inner.with_runs([range(len(self))[i] for i in index]))
        return self._run(range(len(self))[index])

    def _run(self, index: int) -> Run:
        return Run(self.names[index], self._inner.time(index), self._inner.values(index), self.columns)

    def _tables(self) -> list[Table]:
        return [Table(self.columns, self.units, run.values, run.t, run.name) for run in self]

    def __reduce__(self) -> tuple[Any, ...]:
        arguments = (self.columns, self.units, self.names, [run.t for run in self], [run.values for run in self])
        return (_rebuild, arguments)

    def __repr__(self) -> str:
        runs = f"{len(self)} run" + ("" if len(self) == 1 else "s")
        return f"Dataset of {runs}, {sum(len(run) for run in self)} samples: {', '.join(self.columns)}"


def _rebuild(columns: Any, units: Any, names: Any, t: list[Array], values: list[Array]) -> Dataset:
    arrays = [contiguous(entry) for entry in values]
    return Dataset._of(_gpsindy.Dataset(list(columns), list(units), list(names), [contiguous(e) for e in t], arrays))


def inner_dataset(
    found: Sequence[Table],
    time: Sequence[Array],
    *,
    columns: Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    names: Sequence[str] | None = None,
) -> _gpsindy.Dataset:
    """The compiled dataset of tables; columns of frames go by name, those of arrays by place."""
    first = found[0]
    wanted = list(columns) if columns is not None else list(first.names or ())
    if not wanted:
        wanted = [f"x{i}" for i in range(first.values.shape[1])]
    if names is not None and len(names) != len(found):
        raise ValueError(f"names: expected {len(found)}, one a run, found {len(names)}")
    values, found_units = [], dict.fromkeys(wanted, "")
    for i, table in enumerate(found):
        if table.names is None:
            if table.values.shape[1] != len(wanted):
                found_count = table.values.shape[1]
                raise ValueError(f"runs[{i}]: expected {len(wanted)} columns ({', '.join(wanted)}), found {found_count}")
            values.append(contiguous(table.values))
            continue
        for name in wanted:
            if name not in table.names:
                raise ValueError(f"runs[{i}]: no column {name!r}; found {', '.join(table.names)}")
            found_units[name] = found_units[name] or table.units[table.names.index(name)]
        values.append(contiguous(table.values[:, [table.names.index(name) for name in wanted]]))
    for name, unit in (units or {}).items():
        if name not in found_units:
            raise ValueError(f"units: no column {name!r}; found {', '.join(wanted)}")
        found_units[name] = unit
    run_names = list(names) if names is not None else [table.run or f"run {i + 1}" for i, table in enumerate(found)]
    clock = [contiguous(t) for t in time]
    return _gpsindy.Dataset(wanted, [found_units[name] for name in wanted], run_names, clock, values)


def read_csv(
    paths: Path | Iterable[Path],
    *,
    time: str | None = None,
    run: str | None = None,
    rename: Mapping[str, str] | None = None,
    angles: str | Iterable[str] = (),
) -> Dataset:
    """Logs from CSV files: one header row, then one sample a row.

    Headers may carry a unit (``v [m/s]``), cells may be empty, sampling may be irregular. Every column that holds numbers
    in all files is kept.

    Parameters
    ----------
    paths : path or sequence of paths
        The files; each is one run unless ``run`` is given.
    time : str, optional
        The time column, in seconds. Default ``t``, else ``time``.
    run : str, optional
        The column that identifies the run of each row.
    rename : mapping of str to str, optional
        Column, or its whole header, to another name.
    angles : str or sequence of str, optional
        Wrapped angles (rad) whose jumps are removed.

    Returns
    -------
    Dataset

    Raises
    ------
    ValueError
        A file that can't be understood, with file, line and column.
    OSError
        A file that can't be read.

    Warns
    -----
    DataWarning
        A time column that is likely not in seconds.
    """
    files = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    pairs = list((rename or {}).items())
    options = _gpsindy.LogOptions(time=time, run=run, rename=pairs)
    inner, doubts = _gpsindy.Dataset.read_log([os.fspath(file) for file in files], options)
    return as_read(inner, doubts, angles)


def as_read(inner: _gpsindy.Dataset, doubts: Iterable[str], angles: str | Iterable[str]) -> Dataset:
    """What a function of a user's call has read, without jumps of the angles; its doubts are warnings at that call."""
    for doubt in doubts:
        warnings.warn(doubt, DataWarning, stacklevel=3)
    unwrap = names_of(angles)
    return Dataset._of(inner.unwrap_angles(unwrap) if unwrap else inner)


def as_dataset(logs: Any, what: str = "logs") -> Dataset:
    """A dataset as it is, paths as CSV files, anything else as runs."""
    if isinstance(logs, Dataset):
        return logs
    if isinstance(logs, Run):
        logs = [logs]
    if isinstance(logs, (str, os.PathLike)):
        return read_csv(logs)
    if isinstance(logs, (list, tuple)) and logs:
        if all(isinstance(entry, (str, os.PathLike)) for entry in logs):
            return read_csv(logs)
        if all(isinstance(entry, Run) for entry in logs):
            found = [Table(run.columns, ("",) * len(run.columns), run.values, run.t, run.name) for run in logs]
            return Dataset(found)
    if frame(logs) is None and not is_list_of_runs(logs):
        kind = type(logs).__name__
        raise ValueError(f"{what}: expected a Dataset, CSV files or frames with named columns, found {kind}")
    found = tables(logs, what)
    if any(table.names is None for table in found):
        raise ValueError(f"{what}: arrays have no column names; hand in gpsindy.Dataset(arrays, t, columns=[...])")
    return Dataset(found)


