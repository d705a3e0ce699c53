"""A log in two topics with stamps of their own, in every format: the same equations and causes as from one table."""

from __future__ import annotations

import json
import pathlib
import struct
from collections.abc import Callable

import numpy as np
import pytest

import gpsindy

#: A split log: stamps in whole ms, and the columns at them.
Topic = tuple[np.ndarray, dict[str, np.ndarray]]

CAR = pathlib.Path(__file__).parents[5] / "shared" / "data" / "jetracer"

MODEL = """
schema = "gpsindy.model/1"
name = "car"
[[state]]
name = "v"
equation = "a*throttle"
[[state]]
name = "heading"
equation = "b*v*steering"
[[control]]
name = "throttle"
[[control]]
name = "steering"
[[parameter]]
name = "a"
value = 1.5
[[parameter]]
name = "b"
value = 0.9
"""

SUSPECTS = ["viscous_friction", "quadratic_drag", "input_gain", "bias"]


def car(seed: int, seconds: float = 5.0) -> tuple[Topic, Topic]:
    """v' = 1.5 throttle - 0.8 v, heading' = 0.9 v steering: states at 100 Hz, commands at 50 Hz, both with jitter."""
    draw = np.random.default_rng(seed)
    state = np.arange(0, round(seconds * 1000), 10)
    state[1:-1] += draw.integers(0, 3, len(state) - 2)
    command = np.arange(4, state[-1] - 20, 20) + draw.integers(0, 5, len(np.arange(4, state[-1] - 20, 20)))
    throttle = np.repeat(draw.uniform(0.0, 1.0, len(command)), 13)[: len(command)].round(3)
    steering = np.repeat(draw.uniform(-1.0, 1.0, len(command)), 9)[: len(command)].round(3)
    v, heading, k, rows = 0.5, 0.1, 0, []
    at = set(state.tolist())
    for ms in range(int(state[-1]) + 1):
        while k + 1 < len(command) and command[k + 1] <= ms:
            k += 1
        if ms in at:
            rows.append((v, heading))
        for _ in range(4):
            v += 0.00025 * (1.5 * throttle[k] - 0.8 * v)
            heading += 0.00025 * 0.9 * v * steering[k]
    values = np.array(rows) + draw.normal(0, 0.003, (len(rows), 2))
    return (state, {"v": values[:, 0], "heading": values[:, 1]}), (command, {"throttle": throttle, "steering": steering})


def table(state: Topic, command: Topic) -> tuple[np.ndarray, dict[str, list[float | None]]]:
    """Both topics in one: a row a stamp, empty where a topic has none."""
    stamps = np.union1d(state[0], command[0])
    columns = {}
    for own, values in (state, command):
        place = {int(ms): i for i, ms in enumerate(own)}
        for name, column in values.items():
            columns[name] = [float(column[place[ms]]) if ms in place else None for ms in stamps.tolist()]
    return stamps, columns


def csv(folder: pathlib.Path, state: Topic, command: Topic) -> tuple[pathlib.Path, dict[str, str]]:
    stamps, columns = table(state, command)
    lines = ["t [s]," + ",".join(columns)]
    for i, ms in enumerate(stamps.tolist()):
        cells = ["" if column[i] is None else repr(column[i]) for column in columns.values()]
        lines.append(f"{ms / 1000!r}," + ",".join(cells))
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    return folder / "log.csv", {}


def mcap(folder: pathlib.Path, state: Topic, command: Topic) -> tuple[pathlib.Path, dict[str, str]]:
    from mcap_ros2.writer import Writer

    path = folder / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        messages = []
        for topic, kind, (stamps, columns) in (("/state", "car/State", state), ("/command", "car/Command", command)):
            schema = writer.register_msgdef(kind, "".join(f"float64 {name}\n" for name in columns))
            for i, ms in enumerate(stamps.tolist()):
                message = {name: float(column[i]) for name, column in columns.items()}
                messages.append((ms * 1_000_000, topic, schema, message))
        for ns, topic, schema, message in sorted(messages, key=lambda m: m[0]):
            writer.write_message(topic, schema, message, log_time=ns, publish_time=ns)
        writer.finish()
    return path, {name: f"/{topic}.{name}" for topic, (_, c) in (("state", state), ("command", command)) for name in c}


def parquet(folder: pathlib.Path, state: Topic, command: Topic) -> tuple[pathlib.Path, dict[str, str]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    stamps, columns = table(state, command)
    pq.write_table(pa.table({"t": stamps / 1000, **columns}), folder / "log.parquet")
    return folder / "log.parquet", {}


def lerobot(folder: pathlib.Path, state: Topic, command: Topic) -> tuple[pathlib.Path, dict[str, str]]:
    """Frames at 1 kHz of which only those with a sample are there; its stamps are float32, as LeRobot writes them."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    stamps, columns = table(state, command)
    root = folder / "set"
    (root / "meta").mkdir(parents=True)
    (root / "data" / "chunk-000").mkdir(parents=True)
    vectors = {"observation.state": list(state[1]), "action": list(command[1])}
    features = {key: {"dtype": "float64", "shape": [2], "names": names} for key, names in vectors.items()}
    (root / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v3.0", "fps": 1000, "features": features}))
    lists = {}
    for key, names in vectors.items():
        rows = zip(*(columns[name] for name in names))
        lists[key] = pa.array([None if row[0] is None else list(row) for row in rows], pa.list_(pa.float64()))
    frames = {
        "timestamp": (stamps / 1000).astype(np.float32),
        "frame_index": stamps,
        "episode_index": np.zeros(len(stamps), dtype=np.int64),
    }
    pq.write_table(pa.table({**lists, **frames}), root / "data" / "chunk-000" / "file-000.parquet")
    return root, {name: f"{key}[{name}]" for key, names in vectors.items() for name in names}


def ulog(folder: pathlib.Path, state: Topic, command: Topic) -> tuple[pathlib.Path, dict[str, str]]:
    def record(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), kind[0]) + body

    bytes_ = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + record(b"B", bytes(40))
    topics = (("state", state), ("command", command))
    for topic, (_, columns) in topics:
        fields = "".join(f"double {name};" for name in columns)
        bytes_ += record(b"F", f"{topic}:uint64_t timestamp;{fields}".encode())
    messages = []
    for index, (topic, (stamps, columns)) in enumerate(topics):
        bytes_ += record(b"A", struct.pack("<BH", 0, index) + topic.encode())
        for i, ms in enumerate(stamps.tolist()):
            values = [float(column[i]) for column in columns.values()]
            messages.append((ms, record(b"D", struct.pack(f"<HQ{len(values)}d", index, ms * 1000, *values))))
    bytes_ += b"".join(body for _, body in sorted(messages, key=lambda m: m[0]))
    (folder / "log.ulg").write_bytes(bytes_)
    return folder / "log.ulg", {name: f"{topic}.{name}" for topic, (_, columns) in topics for name in columns}


FORMATS: dict[str, Callable[[pathlib.Path, Topic, Topic], tuple[pathlib.Path, dict[str, str]]]] = {
    "mcap": mcap, "parquet": parquet, "lerobot": lerobot, "ulog": ulog,
}  # fmt: skip


def read(writer: Callable, folder: pathlib.Path, splits: list[tuple[Topic, Topic]], **options) -> gpsindy.Dataset:
    paths, places = [], {}
    for i, split in enumerate(splits):
        (folder / f"run_{i}").mkdir(parents=True)
        path, places = writer(folder / f"run_{i}", *split)
        paths.append(path)
    names = [*splits[0][0][1], *splits[0][1][1]]
    return gpsindy.read_log(paths, map=places, columns=names, controls=list(splits[0][1][1]), **options)


def same_data(a: gpsindy.Dataset, b: gpsindy.Dataset) -> None:
    assert a.columns == b.columns and len(a) == len(b)
    for one, other in zip(a, b):
        assert np.array_equal(one.t, other.t)
        for name in a.columns:
            assert one[name].tobytes() == other[name].tobytes(), name


def stated(diagnosis: gpsindy.Diagnosis) -> dict:
    """The report without the names of the runs."""
    report = diagnosis.to_dict()

    def nameless(value: object) -> object:
        if isinstance(value, dict):
            return {key: nameless(inner) for key, inner in value.items() if key not in ("run", "name", "runs", "log")}
        return [nameless(inner) for inner in value] if isinstance(value, list) else value

    return nameless(report)


@pytest.fixture(scope="module")
def splits():
    return [car(seed) for seed in range(2)]


@pytest.fixture(scope="module")
def expected(tmp_path_factory, splits):
    data = read(csv, tmp_path_factory.mktemp("csv"), splits)
    return data, *answers(gpsindy.Model.from_toml(MODEL), data, SUSPECTS)


def answers(model: gpsindy.Model, data: gpsindy.Dataset, suspects: list[str]):
    controls = [control for control in data.columns if control in ("throttle", "steering")]
    found = gpsindy.GPSINDy(degree=2, kernel="se").fit(data, u=controls)
    return found.coef_, gpsindy.diagnose(model, data, effects=suspects)


def test_the_table_with_both_topics_names_the_drag(expected):
    data, _, diagnosis = expected
    run = data[0]
    assert np.isnan(run["v"]).mean() > 0.2 and not np.isnan(run["throttle"][5:]).any()
    assert "viscous_friction" in {cause.effect for cause in diagnosis.included}, diagnosis.summary()


@pytest.mark.filterwarnings("ignore::gpsindy.DataWarning")
@pytest.mark.parametrize("form", FORMATS)
def test_a_split_log_gives_what_the_table_gives(form, tmp_path, splits, expected):
    table_, coefficients, diagnosis = expected
    data = read(FORMATS[form], tmp_path, splits)
    same_data(data, table_)
    found, again = answers(gpsindy.Model.from_toml(MODEL), data, SUSPECTS)
    assert found.tobytes() == coefficients.tobytes()
    assert stated(again) == stated(diagnosis)


def jetracer(path: pathlib.Path, seconds: float) -> tuple[Topic, Topic]:
    """A real run: states at 100 Hz (every second one in a straight line between two samples), commands 3 ms later at 50 Hz."""
    run = gpsindy.read_csv(path, angles="heading")[0]
    kept = run.t < seconds
    ms = np.round(1000 * run.t[kept]).astype(int)
    stamps = np.sort(np.concatenate([ms, (ms[1:] + ms[:-1]) // 2]))
    state = {name: np.interp(stamps, ms, run[name][kept]) for name in ("v", "heading")}
    command = {name: run[name][kept][:-1] for name in ("throttle", "steering")}
    return (stamps, state), (ms[:-1] + 3, command)


@pytest.mark.filterwarnings("ignore::gpsindy.DataWarning")
def test_real_runs_of_a_car_give_the_same_in_every_format(tmp_path):
    logs = sorted(CAR.glob("rollout_0[1-2].csv"))
    if not logs:
        pytest.skip("../shared/data/jetracer is not there")
    splits = [jetracer(log, 4.0) for log in logs]
    table_ = read(csv, tmp_path / "csv", splits)
    model, suspects = gpsindy.Model.from_toml(MODEL), ["viscous_friction", "input_gain"]
    # No equations: to find those of a log that no polynomial describes takes many seconds, and every format again.
    diagnosis = gpsindy.diagnose(model, table_, effects=suspects)
    for form, writer in FORMATS.items():
        data = read(writer, tmp_path / form, splits)
        same_data(data, table_)
        assert stated(gpsindy.diagnose(model, data, effects=suspects)) == stated(diagnosis), form
