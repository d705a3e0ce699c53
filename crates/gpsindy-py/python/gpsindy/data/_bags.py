"""ROS 1 bags and ROS 2 bags in SQLite, through the package rosbags: written again as MCAP for the one reader of logs."""

from __future__ import annotations

import os
import pathlib
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

#: First bytes of a ROS 1 bag, and of an SQLite file.
_MAGIC = (b"#ROSBAG V", b"SQLite format 3")

#: The message whose fields differ between ROS 1 and ROS 2.
_HEADER = "std_msgs/msg/Header"

_Result = TypeVar("_Result")


class _Stand:
    """Logs in place of bags, and how to speak of the bags."""

    def __init__(self, paths: list[str], names: dict[str, str]) -> None:
        self.paths = paths
        self._names = names

    def renamed(self, text: str) -> str:
        """A sentence with the bags' own names."""
        for stand, own in self._names.items():
            text = text.replace(stand, own)
        return text

    def run(self, work: Callable[[list[str]], _Result]) -> _Result:
        """Hands the paths over; errors name the bags."""
        try:
            return work(self.paths)
        except (ValueError, OSError) as error:
            if self._names:
                raise type(error)(self.renamed(str(error))) from None
            raise


@contextmanager
def as_mcap(paths: Sequence[str], places: Iterable[str] | None = None) -> Iterator[_Stand]:
    """Paths with an MCAP file in place of each bag; of the topics only those of ``places``, where these are given."""
    if not any(map(_is_bag, paths)):
        yield _Stand(list(paths), {})
        return
    wanted = None if places is None else list(places)
    with tempfile.TemporaryDirectory(prefix="gpsindy-") as folder:
        found, names = [], {}
        for i, path in enumerate(paths):
            if not _is_bag(path):
                found.append(path)
                continue
            # Formats are recognised by content, so the bag's name can stay, and with it that of the run.
            target = pathlib.Path(folder, str(i), pathlib.Path(path).resolve().name)
            target.parent.mkdir()
            _convert(path, target, wanted)
            found.append(str(target))
            names[str(target)] = path
        yield _Stand(found, names)


def _is_bag(path: str) -> bool:
    if os.path.isdir(path):
        names = os.listdir(path)
        return "metadata.yaml" in names and any(name.endswith(".db3") for name in names)
    try:
        with open(path, "rb") as file:
            head = file.read(16)
    except OSError:
        # The reader of logs has the words for it.
        return False
    return head.startswith(_MAGIC)


def _convert(path: str, target: pathlib.Path, places: list[str] | None) -> None:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag1 import ReaderError as Broken1
        from rosbags.rosbag2 import ReaderError as Broken2
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as missing:
        raise ImportError(f"{path}: a ROS bag needs the package rosbags: pip install 'gpsindy[rosbags]'") from missing

    folder = target.with_name(target.name + ".folder")
    try:
        # Bags from before ROS 2 Iron hold no definitions of their messages.
        with AnyReader([pathlib.Path(path)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            wanted = [c for c in reader.connections if places is None or any(p.startswith(c.topic) for p in places)]
            # None of them: the reader of logs says which topics there are.
            wanted = wanted or list(reader.connections)
            store = reader.typestore
            if not reader.is2:
                # Headers have no count in ROS 2; the conversion leaves it out.
                types = dict(store.fielddefs)
                if header := types.get(_HEADER):
                    types[_HEADER] = (header[0], [field for field in header[1] if field[0] != "seq"])
                store = get_typestore(Stores.EMPTY)
                store.register(types)
            with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
                known = {}
                for connection in wanted:
                    key = (connection.topic, connection.msgtype)
                    if key not in known:
                        known[key] = writer.add_connection(*key, typestore=store)
                for connection, stamp, raw in reader.messages(wanted):
                    cdr = raw if reader.is2 else store.ros1_to_cdr(raw, connection.msgtype)
                    writer.write(known[connection.topic, connection.msgtype], stamp, cdr)
    except (AnyReaderError, Broken1, Broken2, SerdeError) as error:
        raise ValueError(f"{path}: rosbags can't read it: {error}") from None
    (written,) = folder.glob("*.mcap")
    written.rename(target)
