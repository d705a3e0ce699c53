"""Long logs: the largest memory and the time of the program on a million rows and on a thousand files.

    cargo build --release
    python benches/long_logs.py target/release/gpsindy

Writes logs of a driven spring into a temporary folder: one CSV and one Parquet file (where pyarrow is there) of a million rows, and a
thousand CSV files of a thousand rows. Prints seconds and the largest memory of each command; above 500 MB it ends with status 1.
"""

from __future__ import annotations

import argparse
import pathlib
import subprocess
import sys
import tempfile

import command
import numpy as np

ROWS = 1_000_000
FILES = 1_000
MOST = 500.0

MODEL = """
schema = "gpsindy.model/1"
name = "spring"
[[state]]
name = "x"
equation = "v"
[[state]]
name = "v"
equation = "u - k*x - b*v"
[[control]]
name = "u"
[[parameter]]
name = "k"
value = 4.0
[[parameter]]
name = "b"
value = 0.3
"""


def spring(rows: int, seed: int) -> np.ndarray:
    """Rows of t, x, v, u and four columns that no command asks for."""
    draw = np.random.default_rng(seed)
    period = 0.01
    u = np.repeat(draw.normal(size=rows // 50 + 1), 50)[:rows]
    a = np.array([[0.0, 1.0], [-4.0, -0.3]])
    # The exact step under a held control, by the series of the exponential.
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[1, 2] = a * period, period
    step, term = np.eye(3), np.eye(3)
    for i in range(1, 12):
        term = term @ whole / i
        step += term
    state = np.empty((rows, 2))
    x, v = 1.0, 0.0
    p, q, r, s, e, f = step[0, 0], step[0, 1], step[1, 0], step[1, 1], step[0, 2], step[1, 2]
    for i in range(rows):
        state[i] = x, v
        x, v = p * x + q * v + e * u[i], r * x + s * v + f * u[i]
    state += 0.01 * draw.normal(size=state.shape)
    return np.column_stack([period * np.arange(rows), state, u, draw.normal(size=(rows, 4))])


HEADER = "t,x,v,u,a,b,c,d"

LEARN = ["--state", "x,v", "--control", "u", "--degree", "1", "--kernel", "se"]
SUSPECTS = ["--effects", "viscous_friction,coulomb_friction,input_gain"]


def save(path: pathlib.Path, table: np.ndarray) -> None:
    np.savetxt(path, table, delimiter=",", header=HEADER, comments="", fmt=["%.2f", "%.6f", "%.6f", "%.4f"] + ["%.6f"] * 4)


def write(root: pathlib.Path, rows: int, files: int) -> None:
    (root / "model.toml").write_text(MODEL)
    long = spring(rows, 1)
    save(root / "long.csv", long)
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table({n: long[:, i] for i, n in enumerate(HEADER.split(","))}), root / "long.parquet")
    except ImportError:
        pass
    (root / "many").mkdir()
    for i in range(files):
        save(root / "many" / f"run_{i:04}.csv", spring(1000, 2 + i))


def measured(name: str, words: list[str], folder: str) -> float:
    took = command.run(words, folder)
    print(f"{name:34} {took.seconds:8.1f} s {took.megabytes:8.0f} MB{took.failure}", flush=True)
    return took.megabytes


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("program", type=lambda path: str(pathlib.Path(path).resolve()))
    options.add_argument("--rows", type=int, default=ROWS)
    options.add_argument("--files", type=int, default=FILES)
    options.add_argument("--write", help=argparse.SUPPRESS)
    options.add_argument("--only", nargs="+", default=[], help="commands whose name holds one of these")
    found = options.parse_args()
    if found.write:
        write(pathlib.Path(found.write), found.rows, found.files)
        return
    with tempfile.TemporaryDirectory() as folder:
        # By a process of its own: what this one once held would count as its children's.
        sizes = ["--rows", str(found.rows), "--files", str(found.files)]
        subprocess.run([sys.executable, __file__, found.program, *sizes, "--write", folder], check=True)
        root = pathlib.Path(folder)
        logs = [name for name in ("long.csv", "long.parquet") if (root / name).exists()]
        many = sorted(str(path.relative_to(root)) for path in (root / "many").iterdir())
        print(f"long.csv: {(root / 'long.csv').stat().st_size / 1e6:.0f} MB; {found.files} files of 1000 rows")
        program = found.program
        commands = []
        for log in logs:
            commands.append((f"inspect {log}", [program, "inspect", log]))
            commands.append((f"simulate {log}", [program, "simulate", "model.toml", "--data", log]))
            commands.append((f"score {log}", [program, "score", "model.toml", "--data", log]))
            commands.append((f"smooth {log}", [program, "smooth", log, "--state", "x", "--kernel", "se"]))
            commands.append((f"identify {log}", [program, "identify", log, *LEARN]))
            commands.append((f"diagnose {log}", [program, "diagnose", "model.toml", log, *SUSPECTS, "--out", "one"]))
        commands.append(("inspect of many", [program, "inspect", *many]))
        commands.append(("simulate of many", [program, "simulate", "model.toml", "--data", many[0]]))
        commands.append(("score of many", [program, "score", "model.toml", "--data", *many]))
        commands.append(("smooth of one of many", [program, "smooth", many[0], "--state", "x,v", "--kernel", "se"]))
        commands.append(("identify of many", [program, "identify", *many, *LEARN]))
        commands.append(("diagnose of many", [program, "diagnose", "model.toml", *many, *SUSPECTS, "--out", "all"]))
        kept = [(name, c) for name, c in commands if not found.only or any(part in name for part in found.only)]
        if max(measured(name, command, folder) for name, command in kept) > MOST:
            sys.exit(f"above {MOST:.0f} MB")


if __name__ == "__main__":
    main()
