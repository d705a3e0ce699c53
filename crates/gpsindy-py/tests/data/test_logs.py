"""Logs of other formats, against the packages that define them: the same numbers to the last bit."""

from __future__ import annotations

import json
import random
import struct
from pathlib import Path

import numpy as np
import pytest

import gpsindy

BEGIN = 1_763_000_000_000_000_000

#: Random message definitions that are compared.
DEFINITIONS = 200

#: A byte and a char are unsigned in ROS 2 and signed to mcap-ros2-support; both agree on the lower half.
INTEGERS = {
    "bool": (0, 1), "int8": (-128, 127), "uint8": (0, 255), "byte": (0, 127), "char": (0, 127),
    "int16": (-(2**15), 2**15 - 1), "uint16": (0, 2**16 - 1), "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1), "int64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1),
}  # fmt: skip


def write_ros2(path: Path, name: str, schema: str, messages: list[dict], topic: str = "/topic") -> None:
    from mcap_ros2.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        known = writer.register_msgdef(name, schema)
        for i, message in enumerate(messages):
            writer.write_message(topic, known, message, log_time=BEGIN + i * 10_000_000, publish_time=BEGIN)
        writer.finish()


def read_ros2(path: Path) -> list[object]:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [found.decoded_message for found in reader.iter_decoded_messages()]


def numbers(value: object, path: str, found: dict[str, float]) -> None:
    """Every number of a decoded message by its path."""
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        found[path] = float(value)
    elif isinstance(value, (bytes, bytearray)):
        for i, item in enumerate(value):
            found[f"{path}[{i}]"] = float(item)
    elif isinstance(value, (list, tuple, np.ndarray)):
        for i, item in enumerate(value):
            numbers(item, f"{path}[{i}]", found)
    elif not isinstance(value, str) and value is not None:
        for name in getattr(value, "__slots__", None) or vars(value):
            numbers(getattr(value, name), f"{path}.{name}" if path else name, found)


def same(a: float, b: float) -> bool:
    """Equal to the last bit; what is not finite is missing in a dataset."""
    return struct.pack("<d", a) == struct.pack("<d", b) or (not np.isfinite(a) and np.isnan(b))


class Definition:
    """A random message with everything that CDR aligns, and random values for it."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.nested: list[tuple[str, list[tuple[str, str, str]]]] = []
        for depth in range(self.random.randrange(3)):
            known = [f"my/Part{i}" for i in range(depth)]
            self.nested.append((f"my/Part{depth}", self.fields(known)))
        self.root = self.fields([name for name, _ in self.nested])

    def fields(self, known: list[str]) -> list[tuple[str, str, str]]:
        fields = []
        for i in range(self.random.randrange(1, 8)):
            kind = self.random.choice([*INTEGERS, "float32", "float64", "float64", "string", *known, *known])
            many = self.random.choice(["", "", "", "[]", "[3]", "[<=4]"])
            fields.append((kind, many, f"f{i}"))
        return fields

    def text(self) -> str:
        def lines(fields: list[tuple[str, str, str]]) -> str:
            return "".join(f"{kind}{many} {name}  # a remark\n" for kind, many, name in fields)

        return lines(self.root) + "".join(f"{'=' * 80}\nMSG: {name}\n{lines(fields)}" for name, fields in self.nested)

    def value(self, kind: str) -> object:
        draw = self.random
        if kind in INTEGERS:
            low, high = INTEGERS[kind]
            number = draw.choice([low, high, draw.randint(low, high)])
            return bool(number) if kind == "bool" else number
        if kind == "float32":
            return struct.unpack("<f", struct.pack("<f", draw.uniform(-1e6, 1e6)))[0]
        if kind == "float64":
            return draw.choice([0.1, -0.0, 1e-300, draw.gauss(0, 1)])
        if kind == "string":
            return "".join(draw.choice("abcä ") for _ in range(draw.randrange(9)))
        return self.message(dict(self.nested)[kind])

    def message(self, fields: list[tuple[str, str, str]]) -> dict:
        message = {}
        for kind, many, name in fields:
            count = {"": 1, "[3]": 3}.get(many, self.random.randrange(5))
            values = [self.value(kind) for _ in range(count)]
            message[name] = values[0] if many == "" else values
        return message


@pytest.mark.parametrize("seed", range(DEFINITIONS))
def test_random_messages_are_read_to_the_last_bit(tmp_path: Path, seed: int) -> None:
    definition = Definition(seed)
    path = tmp_path / "log.mcap"
    write_ros2(path, "my/Root", definition.text(), [definition.message(definition.root) for _ in range(3)])
    expected = []
    for message in read_ros2(path):
        expected.append({})
        numbers(message, "", expected[-1])
    paths = sorted({name for message in expected for name in message})
    if not paths:
        pytest.skip("a message without a number")
    run = gpsindy.read_log(path, map={f"c{i}": f"/topic.{name}" for i, name in enumerate(paths)})[0]
    assert len(run) == 3
    for i, name in enumerate(paths):
        for row, message in enumerate(expected):
            assert same(message.get(name, np.nan), run[f"c{i}"][row]), (name, row, message.get(name))


def test_joint_states_of_rosbags_are_read_to_the_last_bit(tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    joint, header, stamp = (
        store.types[f"{name}"]
        for name in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    draw = np.random.default_rng(3)
    positions = draw.normal(size=(50, 3))
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", joint.__msgtype__, typestore=store)
        for i, position in enumerate(positions):
            t = BEGIN + i * 10_000_000
            message = joint(
                header=header(stamp=stamp(sec=t // 10**9, nanosec=t % 10**9), frame_id="base"),
                name=["pan", "lift", "elbow"],
                position=position,
                velocity=2 * position,
                effort=np.array([]),
            )
            writer.write(connection, t + 2_000_000, store.serialize_cdr(message, joint.__msgtype__))
    run = gpsindy.read_log(
        tmp_path / "bag",
        map={"q": "/joint_states.position[elbow]", "w": "/joint_states.velocity[lift]"},
        units={"q": "rad"},
    )
    assert run.units == ("rad", "")
    assert np.array_equal(run[0]["q"], positions[:, 2]) and np.array_equal(run[0]["w"], 2 * positions[:, 1])
    assert np.array_equal(run[0].t, np.arange(50) * 10_000_000 / 1e9)
    found = gpsindy.inspect(tmp_path / "bag")
    (topic,) = found.topics
    assert topic["clock"]["latency"] == pytest.approx(0.002) and topic["clock"]["rate"] == pytest.approx(100)
    assert "position[elbow]" in str(found)


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
@pytest.mark.parametrize("indexed", [True, False])
def test_containers_of_the_reference_writer_are_read(tmp_path: Path, compression: str, indexed: bool) -> None:
    from mcap.writer import CompressionType, IndexType, Writer

    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        kinds = IndexType.ALL if indexed else IndexType.NONE
        settings = {} if indexed else {"use_summary_offsets": False, "repeat_channels": False, "use_statistics": False}
        writer = Writer(stream, compression=CompressionType[compression], index_types=kinds, chunk_size=500, **settings)
        writer.start()
        schema = writer.register_schema("my/State", "jsonschema", b"{}")
        channel = writer.register_channel("/state", "json", schema)
        for i in range(100):
            text = json.dumps({"x": i / 3, "inner": {"list": [i, -i]}, "on": i % 2 == 0})
            writer.add_message(channel, BEGIN + i * 1_000_000, text.encode(), BEGIN)
        writer.finish()
    run = gpsindy.read_log(path, map={"x": "/state.x", "y": "/state.inner.list[1]", "on": "/state.on"})[0]
    assert np.array_equal(run["x"], np.arange(100) / 3) and np.array_equal(run["y"], -np.arange(100.0))
    assert np.array_equal(run["on"], (np.arange(100) + 1) % 2)
    assert np.array_equal(run.t, np.arange(100) * 1_000_000 / 1e9)


def test_tables_of_pyarrow_are_read_to_the_last_bit(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    draw = np.random.default_rng(5)
    n = 1000
    columns = {
        "t": pa.array(np.arange(n) * 0.01),
        "double": pa.array(draw.normal(size=n), mask=draw.random(n) < 0.1),
        "single": pa.array(draw.normal(size=n).astype(np.float32)),
        "long": pa.array(draw.integers(-(2**62), 2**62, n)),
        "unsigned": pa.array(draw.integers(0, 2**64, n, dtype=np.uint64)),
        "small": pa.array(draw.integers(-128, 128, n).astype(np.int8)),
        "word": pa.array(draw.integers(0, 2**32, n).astype(np.uint32)),
        "flag": pa.array(draw.random(n) < 0.5),
        "vector": pa.array(list(draw.normal(size=(n, 3)))),
        "fixed": pa.FixedSizeListArray.from_arrays(pa.array(draw.normal(size=2 * n)), 2),
        "text": pa.array(["a"] * n),
    }
    table = pa.table(columns)
    for compression in ("none", "snappy", "gzip", "brotli", "lz4", "zstd"):
        for settings in ({}, {"use_dictionary": False, "data_page_version": "2.0", "row_group_size": 128}):
            path = tmp_path / f"{compression}{len(settings)}.parquet"
            pq.write_table(table, path, compression=compression, **settings)
            data = gpsindy.read_log(path)
            run = data[0]
            assert "text" not in data.columns
            for name in ("double", "single", "long", "unsigned", "small", "word", "flag"):
                expected = table[name].to_pandas().to_numpy(dtype=float)
                assert all(map(same, expected, run[name])), (compression, name)
            for name, width in (("vector", 3), ("fixed", 2)):
                for i in range(width):
                    expected = [row[i] for row in table[name].to_pylist()]
                    assert np.array_equal(run[f"{name}_{i}"], expected)
            assert np.array_equal(run.t, np.arange(n) * 0.01)


def test_the_files_that_pyarrow_ships_are_read_to_the_last_bit() -> None:
    import pyarrow
    import pyarrow.parquet as pq

    files = sorted(Path(pyarrow.__file__).parent.glob("tests/data/parquet/*.parquet"))
    if not files:
        pytest.skip("this build of pyarrow ships no files")
    compared = 0
    for path in files:
        table = pq.read_table(path)
        # They have no column of time: one of increasing numbers takes its place.
        numeric = [field.name for field in table.schema if str(field.type) in ("int64", "int32", "double", "float", "bool")]
        values = {name: table[name].to_pandas().to_numpy(dtype=float) for name in numeric}
        rising = [name for name, column in values.items() if len(column) > 1 and (np.diff(column) > 0).all()]
        if not rising:
            with pytest.raises(ValueError, match="no column `t`, `time` or `timestamp`"):
                gpsindy.read_log(path)
            found = {column["name"]: column for topic in gpsindy.inspect(path, time=numeric[0]).topics for column in topic["columns"]}
            for name in numeric[1:]:
                assert (found[name]["min"], found[name]["max"]) == (values[name].min(), values[name].max()), (path.name, name)
                compared += 1
            continue
        run = gpsindy.read_log(path, time=rising[0])[0]
        for name in set(numeric) - {rising[0]}:
            assert all(map(same, values[name], run[name])), (path.name, name)
            compared += 1
    assert compared > 0


def test_stamps_of_arrow_count_from_the_first(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    for unit, factor in (("ms", 10**3), ("us", 10**6), ("ns", 10**9)):
        begin = 1_763_000_000 * factor
        stamps = pa.array([begin, begin + 1, begin + 5], pa.timestamp(unit))
        pq.write_table(pa.table({"time": stamps, "x": [1.0, 2.0, 3.0]}), tmp_path / "t.parquet")
        run = gpsindy.read_log(tmp_path / "t.parquet")[0]
        assert np.array_equal(run.t, np.array([0, 1, 5]) / factor)


def ulog(path: Path, count: int = 200) -> None:
    """Every type, arrays, a format in another, two instances: written by hand, for pyulog does not write from scratch."""

    def record(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), kind[0]) + body

    formats = [
        b"inner:float a;int16_t[2] b;",
        b"all:uint64_t timestamp;int64_t c;uint64_t d;double e;int32_t f;uint32_t g;float h;int16_t i;uint16_t j;int8_t k;"
        b"uint8_t l;bool m;char[5] n;inner[2] o;float[3] p;",
    ]
    draw = random.Random(7)
    with path.open("wb") as stream:
        stream.write(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 123))
        stream.write(record(b"B", bytes(40)))
        for text in formats:
            stream.write(record(b"F", text))
        for instance, subscription in ((0, 1), (1, 2)):
            stream.write(record(b"A", struct.pack("<BH", instance, subscription) + b"all"))
        for i in range(count):
            for subscription in (1, 2):
                body = struct.pack("<HQ", subscription, 5_000_000 + 4_000 * i)
                body += struct.pack("<qQd", draw.randint(-(2**63), 2**63 - 1), draw.randint(0, 2**64 - 1), draw.gauss(0, 1))
                body += struct.pack("<iIf", draw.randint(-(2**31), 2**31 - 1), draw.randint(0, 2**32 - 1), draw.gauss(0, 1))
                body += struct.pack("<hHbB?", draw.randint(-9, 9), draw.randint(0, 9), draw.randint(-9, 9), 200, i % 2)
                body += b"hello"
                for _ in range(2):
                    body += struct.pack("<fhh", draw.gauss(0, 1), draw.randint(-9, 9), draw.randint(-9, 9))
                body += struct.pack("<3f", *(draw.gauss(0, 1) for _ in range(3)))
                stream.write(record(b"D", body))


def test_ulog_is_read_as_pyulog_reads_it(tmp_path: Path) -> None:
    from pyulog import ULog

    path = tmp_path / "flight.ulg"
    ulog(path)
    for dataset in ULog(str(path)).data_list:
        topic = dataset.name if dataset.multi_id == 0 else f"{dataset.name}:{dataset.multi_id}"
        names = [name for name in dataset.data if name != "timestamp" and not name.startswith("n[")]
        run = gpsindy.read_log(path, map={f"c{i}": f"{topic}.{name}" for i, name in enumerate(names)})[0]
        assert np.array_equal(run.t, dataset.data["timestamp"] / 1e6)
        for i, name in enumerate(names):
            expected = np.asarray(dataset.data[name], dtype=float)
            assert all(map(same, expected, run[f"c{i}"])), name


def test_topics_at_different_rates_keep_their_stamps(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        state, command = (writer.register_channel(topic, "json", 0) for topic in ("/state", "/command"))
        for i in range(100):
            writer.add_message(state, i * 10_000_000, json.dumps({"x": i}).encode(), 0)
            if i % 2 == 0:
                writer.add_message(command, i * 10_000_000 + 3_000_000, json.dumps({"u": -i}).encode(), 0)
        writer.finish()
    run = gpsindy.read_log(path, map={"x": "/state.x", "u": "/command.u"}, controls="u")[0]
    own = np.isclose(run.t * 100, np.round(run.t * 100))
    assert np.array_equal(run["x"][own], np.arange(100.0)) and np.isnan(run["x"][~own]).all()
    assert np.array_equal(run["u"][~own], -np.arange(0, 100, 2.0)[: (~own).sum()])
    later = np.flatnonzero(own & (run.t > 0.003))
    assert np.array_equal(run["u"][later], run["u"][later - 1])
    shifted = gpsindy.read_log(path, map={"x": "/state.x", "u": "/command.u"}, offset={"/command": -0.003})[0]
    assert len(shifted) == 100


def test_a_wrong_name_suggests_the_right_one(tmp_path: Path) -> None:
    write_ros2(tmp_path / "log.mcap", "my/State", "float64 position\n", [{"position": 1.0}, {"position": 2.0}])
    with pytest.raises(ValueError, match="did you mean `/topic`"):
        gpsindy.read_log(tmp_path / "log.mcap", map={"q": "/topc.position"})
    with pytest.raises(ValueError, match="there is no field `positon` in my/State; did you mean `position`"):
        gpsindy.read_log(tmp_path / "log.mcap", map={"q": "/topic.positon"})
    with pytest.raises(ValueError, match="say where each state and control comes from"):
        gpsindy.read_log(tmp_path / "log.mcap")


def test_the_offset_of_a_clock_is_estimated_and_stated() -> None:
    data = Path(__file__).parents[4] / "data"
    read = {"map_file": data / "pendulum_map.toml", "controls": "u"}
    with pytest.warns(gpsindy.DataWarning, match="were added to the stamps of `/joint_commands`"):
        found = gpsindy.read_log(data / "pendulum.mcap", offset={"/joint_commands": "auto"}, **read)
    plain = gpsindy.read_log(data / "pendulum.mcap", **read)
    # The commands have stamps of their own, at which the joint is not measured.
    own = np.isnan(plain[0]["phi"])
    assert 0.3 < own.mean() < 0.35 and not np.isnan(plain[0]["u"]).any()
    (offset,) = {round(b - a, 9) for a, b in zip(plain[0].t[own], found[0].t[np.isnan(found[0]["phi"])])}
    assert abs(offset) < 5e-3
    with pytest.raises(ValueError, match="neither a number of seconds nor `auto`"):
        gpsindy.read_log(data / "pendulum.mcap", offset={"/joint_commands": "soon"}, **read)
