"""Reading joint states from MCAP: gpsindy beside the Python packages that define the format, the same fields in one run.

    pip install ./crates/gpsindy-py mcap mcap-ros2-support rosbags
    python benches/read_mcap.py --megabytes 1000

Writes a log of `sensor_msgs/msg/JointState` (seven joints at 1 kHz, zstd) into a temporary folder, reads the seven positions and the stamps
by each reader, compares the numbers, and prints seconds, megabytes a second and the largest memory of each reader's process.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import resource
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


def write(path: pathlib.Path, megabytes: float) -> int:
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
        writer = Writer(stream, chunk_size=1 << 20, compression=CompressionType.ZSTD)
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


READERS = {"gpsindy": by_gpsindy, "mcap": by_mcap, "rosbags": by_rosbags}


def child(name: str, path: str) -> None:
    begin = time.perf_counter()
    rows = READERS[name](path)
    seconds = time.perf_counter() - begin
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"seconds": seconds, "memory": memory, "rows": len(rows), "sum": float(rows.sum()), "last": rows[-1].tolist()}))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--megabytes", type=float, default=1000.0, help="size of the log [%(default)s]")
    options.add_argument("--readers", nargs="+", default=list(READERS), choices=list(READERS))
    options.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    found = options.parse_args()
    if found.child:
        child(*found.child)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "joints.mcap")
        count = write(path, found.megabytes)
        size = path.stat().st_size / 1e6
        print(f"{count} messages, {size:.0f} MB")
        answers = {}
        for name in found.readers:
            # A process each, so that each has a memory of its own; the file is in the system's cache for all.
            done = subprocess.run([sys.executable, __file__, "--child", name, path], check=True, stdout=subprocess.PIPE)
            answer = answers[name] = json.loads(done.stdout)
            speed = size / answer["seconds"]
            print(f"{name:10} {answer['seconds']:8.2f} s {speed:8.1f} MB/s {answer['memory']:8.0f} MB of memory")
        same = {json.dumps([a["rows"], a["sum"], a["last"]]) for a in answers.values()}
        print("the numbers are the same" if len(same) == 1 else f"the numbers differ: {same}")


if __name__ == "__main__":
    main()
