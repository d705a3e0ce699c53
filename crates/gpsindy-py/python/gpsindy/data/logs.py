"""Logs of any format: what they hold, and their columns as a dataset."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

from gpsindy import _gpsindy
from gpsindy.data._bags import as_mcap
from gpsindy.data._tables import names_of
from gpsindy.data.dataset import Dataset, as_read

Path = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True, eq=False)
class Inspection:
    """What a log holds; ``print`` it for one screen.

    Attributes
    ----------
    file : str
        The log.
    format : str
        ``CSV``, ``MCAP``, ``Parquet``, ``LeRobot data set`` or ``ULog``.
    topics : list of dict
        Topics with their clock and their columns; a table is one topic without a name.
    findings : list of dict
        What would harm an identification: ``topic``, ``column``, ``kind`` and ``text``.
    notes : list of str
        What the reading itself has to say.
    """

    file: str
    format: str
    topics: list[dict[str, Any]]
    findings: list[dict[str, Any]]
    notes: list[str]
    _text: str

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"Inspection of {self.file}: {self.format}, {len(self.findings)} findings"


def inspect(
    path: Path, *, time: str | None = None, run: str | None = None, stamp: str | None = None, width: int = 100
) -> Inspection:
    """What a log of any format holds, and which of its flaws would harm an identification.

    Parameters
    ----------
    path : path
        A CSV, MCAP, Parquet or ULog file, or the folder of a LeRobot data set or a ROS 2 bag. With the extra
        ``gpsindy[rosbags]`` also a ROS 1 ``.bag`` and a ROS 2 ``.db3``, or its folder; these are shown as MCAP.
    time, run : str, optional
        The time column of a table, and the column that identifies the run of each row.
    stamp : {'header', 'log'}, optional
        The clock of messages. Default: their header's stamp where there is one.
    width : int, default 100
        Characters in a line of the text.

    Returns
    -------
    Inspection
    """
    options = _gpsindy.LogOptions(time=time, run=run, stamp=stamp)
    with as_mcap([os.fspath(path)]) as logs:
        found, text = logs.run(lambda paths: _gpsindy.inspect(paths[0], options, width))
        fields = json.loads(logs.renamed(found))
        return Inspection(**fields, _text=logs.renamed(text))


def read_log(
    paths: Path | Iterable[Path],
    *,
    map: Mapping[str, str] | None = None,
    map_file: Path | None = None,
    columns: Sequence[str] | None = None,
    controls: str | Iterable[str] = (),
    hold: str = "zero",
    stamp: str | None = None,
    offset: Mapping[str, float | str] | None = None,
    units: Mapping[str, str] | None = None,
    time: str | None = None,
    run: str | None = None,
    rename: Mapping[str, str] | None = None,
    angles: str | Iterable[str] = (),
) -> Dataset:
    """Logs of any format: CSV, MCAP, Parquet, LeRobot data sets, ULog.

    Topics keep their own stamps: at the stamps of another topic a state is missing, a control keeps its value.

    Parameters
    ----------
    paths : path or sequence of paths
        The logs; formats are recognised by content. A folder is a LeRobot data set or a ROS 2 bag. ROS 1 ``.bag`` and ROS 2
        ``.db3`` files (or their folders) need the extra ``gpsindy[rosbags]``.
    map : mapping of str to str, optional
        Where a column comes from: ``{"q": "/joint_states.position[elbow]", "u": "/command.data[0]"}``.
    map_file : path, optional
        The same for a whole project: TOML with ``[map]``, ``[unit]``, ``[offset]`` and ``stamp``.
    columns : sequence of str, optional
        The columns to read. Default: every mapped column, and of tables every column of numbers.
    controls : str or sequence of str, optional
        Columns that keep their value between their own stamps.
    hold : {'zero', 'linear'}, default 'zero'
        What a control does between its own stamps.
    stamp : {'header', 'log'}, optional
        The clock of messages. Default: their header's stamp where there is one, else the time of recording.
    offset : mapping of str to float, optional
        Seconds that are added to the stamps of a topic; ``'auto'``: what makes its columns agree with those of the other
        topics best, estimated with an interval, which a warning states. Between a command and a state a delay counts in it.
    units : mapping of str to str, optional
        Units of mapped columns.
    time, run : str, optional
        The time column of a table, and the column that identifies the run of each row.
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
        A log that can't be understood, with file, topic and field.
    OSError
        A file that can't be read.
    ImportError
        A ROS bag without the package rosbags.

    Warns
    -----
    DataWarning
        What the reading has to say: a file that breaks off, messages out of order, stamps that were made again.
    """
    if hold not in ("zero", "linear"):
        raise ValueError(f"hold: expected 'zero' or 'linear', found {hold!r}")
    files = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    options = _gpsindy.LogOptions(
        time=time,
        run=run,
        rename=list((rename or {}).items()),
        map=list((map or {}).items()),
        unit=list((units or {}).items()),
        offset=[(topic, str(shift)) for topic, shift in (offset or {}).items()],
        stamp=stamp,
        map_file=None if map_file is None else os.fspath(map_file),
    )
    places = None if map_file is not None or map is None else map.values()
    with as_mcap([os.fspath(file) for file in files], places) as logs:
        inner, doubts = logs.run(
            lambda paths: _gpsindy.Dataset.read_log(
                paths,
                options,
                None if columns is None else names_of(columns),
                names_of(controls),
                hold == "linear",
            )
        )
        doubts = [logs.renamed(doubt) for doubt in doubts]
    return as_read(inner, doubts, angles)
