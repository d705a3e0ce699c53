"""One long run: time and memory of smoothing, identification and diagnosis from 1e4 to 3.6e6 rows at 1 kHz.

    cargo build --release
    python benches/long_runs.py target/release/gpsindy

The log is of a driven spring, whose simulator lacks a quadratic drag of 0.2; the drive moves it for a quarter of every minute and rests
otherwise. Prints seconds, processor seconds and the largest memory of each command; ends with status 1 above 2 GB.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import command
import numpy as np

MOST = 2000.0

MODEL = """
schema = "gpsindy.model/1"
name = "spring"
[[state]]
name = "x"
unit = "m"
equation = "v"
[[state]]
name = "v"
unit = "m/s"
equation = "u - k*x - b*v"
[[control]]
name = "u"
unit = "m/s^2"
[[parameter]]
name = "k"
value = 4.0
unit = "1/s^2"
[[parameter]]
name = "b"
value = 0.3
unit = "1/s"
"""


def write(path: pathlib.Path, rows: int) -> None:
    """Columns t, x, v, u at 1 kHz, noise of 0.01; the drive is held for half a second."""
    draw = np.random.default_rng(16)
    period, drag = 1e-3, 0.2
    t = period * np.arange(rows)
    u = np.repeat(3 * draw.normal(size=rows // 500 + 1), 500)[:rows] * (t % 60 < 15)
    x, v, states = 0.5, 0.0, np.empty((rows, 2))
    for i, force in enumerate(u.tolist()):
        states[i] = x, v
        # A symmetric step: its error of the third order is far below the noise.
        v += 0.5 * period * (force - 4.0 * x - 0.3 * v - drag * v * abs(v))
        x += period * v
        v += 0.5 * period * (force - 4.0 * x - 0.3 * v - drag * v * abs(v))
    states += 0.01 * draw.normal(size=states.shape)
    with path.open("w") as file:
        file.write("t [s],x [m],v [m/s],u [m/s^2]\n")
        np.savetxt(file, np.column_stack([t, states, u]), delimiter=",", fmt=["%.3f", "%.5f", "%.5f", "%.4f"])


def measured(name: str, rows: int, words: list[str], folder: str) -> float:
    took = command.run(words, folder)
    print(f"| {name} | {rows} | {took.seconds:.1f} | {took.busy:.1f} | {took.megabytes:.0f} |{took.failure}", flush=True)
    return took.megabytes


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("program", type=lambda path: str(pathlib.Path(path).resolve()))
    options.add_argument("--rows", type=int, nargs="+", default=[10_000, 100_000, 1_000_000, 3_600_000])
    options.add_argument("--only", nargs="+", default=["smooth", "identify", "diagnose"])
    options.add_argument("--keep", help="folder for the logs and results [default: a temporary one]")
    options.add_argument("--write", help=argparse.SUPPRESS)
    found = options.parse_args()
    if found.write:
        write(pathlib.Path(found.write), found.rows[0])
        return
    most = 0.0
    with tempfile.TemporaryDirectory() as temporary:
        folder = found.keep or temporary
        root = pathlib.Path(folder)
        root.mkdir(exist_ok=True)
        (root / "model.toml").write_text(MODEL)
        print("| command | rows | elapsed, s | processor, s | largest memory, MB |\n| --- | --- | --- | --- | --- |")
        for rows in found.rows:
            log = f"long_{rows}.csv"
            if not (root / log).exists():
                # By a process of its own: what this one once held would count as its children's.
                line = [sys.executable, __file__, found.program, "--rows", str(rows), "--write", str(root / log)]
                subprocess.run(line, check=True)
            commands = {
                "smooth": ["smooth", log, "--state", "x,v"],
                "identify": ["identify", log, "--state", "x,v", "--control", "u", "--degree", "2", "--out", f"model_{rows}.toml"],
                "diagnose": ["diagnose", "model.toml", log, "--out", f"diagnosis_{rows}", "--force"],
            }
            for name in found.only:
                most = max(most, measured(name, rows, [found.program, *commands[name]], folder))
            report = root / f"diagnosis_{rows}" / "report.json"
            if "diagnose" in found.only and report.exists():
                stated = json.loads(report.read_text())
                causes = [f"{c['effect']} in {c['state']}" for c in stated["causes"] if c["included"]]
                print(f"  {rows}: {stated['verdict']}, {', '.join(causes)}", flush=True)
    print("load average", " ".join(f"{value:.1f}" for value in os.getloadavg()))
    if most > MOST:
        sys.exit(f"above {MOST:.0f} MB")


if __name__ == "__main__":
    main()
