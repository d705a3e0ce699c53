"""ROS 1 bags and ROS 2 bags in SQLite, written by rosbags and read through it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import gpsindy

BEGIN = 1_763_000_000_000_000_000
MAP = {"q": "/joint_states.position[elbow]", "w": "/joint_states.velocity[lift]", "u": "/command.data"}
POSITIONS = np.random.default_rng(3).normal(size=(60, 2))


def messages(store, header: dict):
    """(topic, type, ns of recording, message): joints at 100 Hz whose stamps are 2 ms earlier, commands at 50 Hz."""
    joint, head, time, number = (
        store.types[name]
        for name in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "std_msgs/msg/Float64")
    )
    for i, position in enumerate(POSITIONS):
        t = BEGIN + i * 10_000_000
        stamp = time(sec=t // 10**9, nanosec=t % 10**9)
        fields = {"position": position, "velocity": 2 * position, "effort": np.array([])}
        state = joint(header=head(stamp=stamp, frame_id="base", **header), name=["lift", "elbow"], **fields)
        yield "/joint_states", joint.__msgtype__, t + 2_000_000, state
        if i % 2 == 0:
            yield "/command", number.__msgtype__, t + 3_000_000, number(data=float(-i))


def ros1(path: Path) -> Path:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        known = {}
        for topic, kind, ns, message in messages(store, {"seq": 7}):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], ns, store.serialize_ros1(message, kind))
    return path


def ros2(path: Path, version: int = 9) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=version, storage_plugin=StoragePlugin.SQLITE3) as writer:
        known = {}
        for topic, kind, ns, message in messages(store, {}):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(known[topic], ns, store.serialize_cdr(message, kind))
    return path


def check(data: gpsindy.Dataset, name: str) -> None:
    (run,) = data
    assert run.name == name
    own = ~np.isnan(run["q"])
    assert np.array_equal(run["q"][own], POSITIONS[:, 1]) and np.array_equal(run["w"][own], 2 * POSITIONS[:, 0])
    assert np.array_equal(run.t[own], np.arange(60) * 10_000_000 / 1e9)
    assert np.array_equal(run["u"][~own], -np.arange(0, 60, 2.0)[: (~own).sum()])


def test_a_ros_1_bag_is_read_to_the_last_bit(tmp_path: Path) -> None:
    bag = ros1(tmp_path / "run.bag")
    check(gpsindy.read_log(bag, map=MAP, controls="u"), "run.bag")
    found = gpsindy.inspect(bag)
    assert found.file == str(bag) and str(bag) in str(found)
    assert [topic["topic"] for topic in found.topics] == ["/command", "/joint_states"]


@pytest.mark.parametrize("version", [8, 9])
def test_a_ros_2_bag_in_sqlite_is_read_as_a_folder_and_as_a_file(tmp_path: Path, version: int) -> None:
    bag = ros2(tmp_path / "bag", version)
    (file,) = bag.glob("*.db3")
    check(gpsindy.read_log(bag, map=MAP, controls="u"), "bag")
    check(gpsindy.read_log(file, map=MAP, controls="u"), file.name)
    (tmp_path / "map.toml").write_text("[map]\n" + "".join(f'{k} = "{v}"\n' for k, v in MAP.items()))
    check(gpsindy.read_log(bag, map_file=tmp_path / "map.toml", controls="u"), "bag")


def test_errors_and_warnings_name_the_bag(tmp_path: Path) -> None:
    bag = ros1(tmp_path / "run.bag")
    with pytest.raises(ValueError, match="did you mean `/joint_states`") as refused:
        gpsindy.read_log(bag, map={"q": "/joint_state.position[elbow]"})
    assert str(refused.value).startswith(str(bag))
    (tmp_path / "cut.bag").write_bytes(bag.read_bytes()[:1000])
    with pytest.raises(ValueError, match=r"cut\.bag: rosbags can't read it"):
        gpsindy.read_log(tmp_path / "cut.bag", map=MAP)


def test_without_the_package_the_way_to_it_is_stated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = ros1(tmp_path / "run.bag")
    for name in [name for name in sys.modules if name.split(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(ImportError, match=r"pip install 'gpsindy\[rosbags\]'"):
        gpsindy.inspect(bag)
