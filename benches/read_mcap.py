"""Reading joint states from MCAP: gpsindy beside the packages that define the format, the same fields in one run.

    pip install ./crates/gpsindy-py mcap mcap-ros2-support rosbags
    python benches/read_mcap.py --megabytes 1000 --compression none lz4 zstd

Writes a log of `sensor_msgs/msg/JointState` (seven joints at 1 kHz) into a temporary folder, reads the seven positions and the stamps
by each reader, compares the numbers, and prints seconds, megabytes a second and processor time of each reader, without the time in
which it starts and loads its modules.

The C++ library of the format is in no package index. With its headers, `--cpp 'INCLUDE...'` compiles read_mcap.cpp and reads by it, too
(the options of the compiler, as in `--cpp '-I mcap/cpp/mcap/include'`; it needs lz4 and zstd).
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import pathlib
import resource
import shlex
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np

JOINTS = [f"joint_{i}" for i in range(7)]
SCHEMA = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    f"{'=' * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
BEGIN = 1_763_000_000_000_000_000


def write(path: pathlib.Path, megabytes: float, compression: str) -> int:
    """Messages of 301 bytes until the packed file is as large as asked for; noise in the values, so that they do not pack well."""
    from mcap.writer import CompressionType, Writer

    names = struct.pack("<I", len(JOINTS))
    for name in JOINTS:
        names += struct.pack("<I", len(name) + 1) + name.encode() + b"\0"
        names += b"\0" * (-len(names) % 4)
    # Behind the stamp (8 bytes) and the frame "base" (4 + 5, filled up to 20), then the names, then lists of 8-byte numbers.
    middle = struct.pack("<I", 5) + b"base\0" + b"\0" * 3 + names
    draw = np.random.default_rng(1)
    count = 0
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 20, compression=CompressionType[compression.upper()])
        writer.start("ros2", "benches/read_mcap.py")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", SCHEMA.encode())
        channel = writer.register_channel("/joint_states", "cdr", schema)
        while stream.tell() < megabytes * 1e6:
            values = draw.normal(size=(10_000, 3, len(JOINTS))).round(6)
            for row in values:
                t = BEGIN + count * 1_000_000
                body = struct.pack("<iI", t // 10**9, t % 10**9) + middle
                for numbers in row:
                    body += struct.pack("<I", len(JOINTS))
                    body += b"\0" * (-len(body) % 8) + numbers.tobytes()
                writer.add_message(channel, t + 500_000, b"\0\1\0\0" + body, t + 500_000)
                count += 1
        writer.finish()
    return count


def by_gpsindy(path: str) -> np.ndarray:
    import gpsindy

    run = gpsindy.read_log(path, map={name: f"/joint_states.position[{name}]" for name in JOINTS})[0]
    return np.column_stack([run.t, *(run[name] for name in JOINTS)])


def by_mcap(path: str) -> np.ndarray:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    rows = []
    with open(path, "rb") as stream:
        for found in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            message = found.decoded_message
            stamp = message.header.stamp
            rows.append((stamp.sec * 10**9 + stamp.nanosec - BEGIN, *message.position))
    rows = np.array(rows)
    rows[:, 0] /= 1e9
    return rows


def by_rosbags(path: str) -> np.ndarray:
    from rosbags.highlevel import AnyReader

    rows = []
    with AnyReader([pathlib.Path(path)]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            rows.append((stamp.sec * 10**9 + stamp.nanosec - BEGIN, *message.position))
    rows = np.array(rows)
    rows[:, 0] /= 1e9
    return rows


# Reads of one file by each of the fast readers.
TURNS = 3

MODULES = {"gpsindy": ["gpsindy"], "mcap": ["mcap.reader", "mcap_ros2.decoder"], "rosbags": ["rosbags.highlevel"]}
READERS = {"gpsindy": by_gpsindy, "mcap": by_mcap, "rosbags": by_rosbags}


def child(name: str, path: str) -> None:
    for module in MODULES[name]:
        # A program loads its libraries before it begins, too.
        importlib.import_module(module)
    begin, before = time.perf_counter(), time.process_time()
    rows = READERS[name](path)
    seconds, busy = time.perf_counter() - begin, time.process_time() - before
    digest = hashlib.sha256(np.ascontiguousarray(rows).tobytes()).hexdigest()
    print(json.dumps({"seconds": seconds, "busy": busy, "rows": len(rows), "digest": digest}))


def by_cpp(program: pathlib.Path, path: pathlib.Path) -> dict:
    rows = path.with_suffix(".rows")
    done = subprocess.run([program, path, str(len(JOINTS)), rows], check=True, stdout=subprocess.PIPE)
    with rows.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    count = rows.stat().st_size // (8 * (1 + len(JOINTS)))
    rows.unlink()
    seconds, busy = (float(word) for word in done.stdout.split())
    return {"seconds": seconds, "busy": busy, "rows": count, "digest": digest}


def by_python(name: str, path: pathlib.Path) -> dict:
    """A process of its own, so that each has a memory of its own; the file is in the system's cache for all."""
    done = subprocess.run([sys.executable, __file__, "--child", name, path], check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def keep_best(answers: dict[str, dict], name: str, answer: dict) -> None:
    if name not in answers or answer["seconds"] < answers[name]["seconds"]:
        answers[name] = answer


def compare(path: pathlib.Path, readers: list[str], program: pathlib.Path | None) -> bool:
    """Prints a line a reader; whether gpsindy needs at most twice the processor time of each."""
    size = path.stat().st_size / 1e6
    answers = {}
    # The first to read pays for memory that the system has not yet at hand: gpsindy and the library take turns, the best counts.
    for turn in range(TURNS):
        for name in readers if turn == 0 else [name for name in readers if name == "gpsindy"]:
            keep_best(answers, name, by_python(name, path))
        if program:
            keep_best(answers, "C++", by_cpp(program, path))
    for name, answer in answers.items():
        seconds, busy = answer["seconds"], answer["busy"]
        print(f"{name:10} {seconds:8.2f} s {size / seconds:8.1f} MB/s {busy:8.2f} s of processor time", flush=True)
    same = {(a["rows"], a["digest"]) for a in answers.values()}
    print("the numbers are the same" if len(same) == 1 else f"the numbers differ: {same}", flush=True)
    # By processor time: what else the machine does counts less in it.
    own = answers.get("gpsindy", {"busy": 0.0})["busy"]
    return len(same) == 1 and all(own <= 2 * answer["busy"] for answer in answers.values())


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--megabytes", type=float, default=1000.0, help="size of the log [%(default)s]")
    options.add_argument("--compression", nargs="+", default=["zstd"], choices=["none", "lz4", "zstd"])
    options.add_argument("--readers", nargs="+", default=list(READERS), choices=list(READERS))
    options.add_argument("--cpp", metavar="OPTIONS", help="options of the C++ compiler that find the headers of mcap, lz4 and zstd")
    options.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    found = options.parse_args()
    if found.child:
        child(*found.child)
        return
    fast = []
    with tempfile.TemporaryDirectory() as folder:
        program = None
        if found.cpp is not None:
            program = pathlib.Path(folder, "read_mcap")
            source = pathlib.Path(__file__).with_name("read_mcap.cpp")
            words = ["c++", "-O3", "-std=c++17", str(source), *shlex.split(found.cpp), "-llz4", "-lzstd", "-o", str(program)]
            subprocess.run(words, check=True)
        for compression in found.compression:
            path = pathlib.Path(folder, "joints.mcap")
            count = write(path, found.megabytes, compression)
            print(f"{compression}: {count} messages, {path.stat().st_size / 1e6:.0f} MB", flush=True)
            fast.append(compare(path, found.readers, program))
            path.unlink()
    if not all(fast):
        sys.exit("gpsindy needs more than twice the time of another reader, or reads other numbers")


if __name__ == "__main__":
    main()
