"""How the time of a diagnosis grows with the samples, with the states, and with the suspects.

    cargo build --release
    python benches/growth.py target/release/gpsindy

A chain of driven masses on springs, whose first one has a dry friction that the simulator lacks, is logged four times. The whole catalogue is
tried, or a part of it. Prints the median of three runs: wall time, processor time, and what the diagnosis counts: samples that rollouts passed, and columns.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import random
import statistics
import tempfile

import command

PERIOD = 0.02
FINE = 20
LOGS = 4
NOISE = 0.002
CORNER = 0.01  # speed within which the friction is smoothed, m/s
FRICTIONS = ["coulomb_friction", "viscous_friction", "quadratic_drag"]
MORE = ["bias", "parameter_error", "linear_stiffness", "cubic_stiffness", "input_gain", "input_delay", "input_lag"]
SENSORS = ["sensor_bias", "sensor_scale", "sensor_delay", "sensor_filter", "backlash", "hysteresis", "drift"]


def rates(y: list[float], u: float, friction: float) -> list[float]:
    """Positions and velocities in turn; every mass has a spring to the one before it."""
    n = len(y) // 2
    out = []
    for i in range(n):
        x, v = y[2 * i], y[2 * i + 1]
        before = y[2 * i - 2] if i else 0.0
        force = -4.0 * (x - before) - 0.4 * v
        if i + 1 < n:
            force += 4.0 * (y[2 * i + 2] - x)
        if i == 0:
            force += u - friction * math.tanh(v / CORNER)
        out += [v, force]
    return out


def log(path: pathlib.Path, masses: int, samples: int, seed: int) -> None:
    draw = random.Random(seed)
    y = [0.0] * (2 * masses)
    names = [f"{kind}{i + 1}" for i in range(masses) for kind in "xv"]
    rows = [",".join(["t", *names, "u"])]
    for k in range(samples):
        t = k * PERIOD
        u = 1.5 * math.sin(0.7 * t + seed) + (0.8 if (k // 60 + seed) % 2 else -0.8)
        values = [f"{value + draw.gauss(0.0, NOISE):.6f}" for value in y]
        rows.append(",".join([f"{t:.6f}", *values, f"{u:.6f}"]))
        step = PERIOD / FINE
        for _ in range(FINE):
            half = [a + 0.5 * step * b for a, b in zip(y, rates(y, u, 0.3))]
            y = [a + step * b for a, b in zip(y, rates(half, u, 0.3))]
    path.write_text("\n".join(rows) + "\n")


def model(path: pathlib.Path, masses: int) -> None:
    text = ['schema = "gpsindy.model/1"', 'name = "chain"']
    for i in range(1, masses + 1):
        force = f"-k*(x{i} - x{i - 1})" if i > 1 else "-k*x1"
        if i < masses:
            force += f" + k*(x{i + 1} - x{i})"
        force += f" - b*v{i}" + (" + u" if i == 1 else "")
        text += ["[[state]]", f'name = "x{i}"', f'equation = "v{i}"', 'unit = "m"']
        text += ["[[state]]", f'name = "v{i}"', f'equation = "{force}"', 'unit = "m/s"']
    text += ["[[control]]", 'name = "u"', 'unit = "m/s^2"']
    text += ["[[parameter]]", 'name = "k"', "value = 4.0", 'unit = "1/s^2"']
    text += ["[[parameter]]", 'name = "b"', "value = 0.4", 'unit = "1/s"']
    path.write_text("\n".join(text) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--threads", default="2")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    program = str(options.program.resolve())
    sizes = [(1, 250), (1, 500), (1, 1000), (1, 2000), (1, 4000), (2, 500), (3, 500), (4, 500)]
    parts = [FRICTIONS, FRICTIONS + MORE, FRICTIONS + MORE + SENSORS]
    cases = [(*size, []) for size in sizes] + [(2, 500, effects) for effects in parts]
    print("| states | samples | effects | wall | processor | samples passed | columns | verdict |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for masses, samples, effects in cases:
        with tempfile.TemporaryDirectory() as folder:
            place = pathlib.Path(folder)
            model(place / "model.toml", masses)
            logs = [f"log_{i}.csv" for i in range(LOGS)]
            for i, name in enumerate(logs):
                log(place / name, masses, samples, i)
            args = [program, "diagnose", "model.toml", *logs, "--threads", options.threads, "--out", "out", "--force"]
            args += ["--effects", ",".join(effects)] if effects else []
            took = [command.run(args, folder) for _ in range(options.runs)]
            report = json.loads((place / "out" / "report.json").read_text())
        passed = sum(stage[kind] for stage in report["work"] for kind in ("derivatives", "trials", "responses"))
        columns = sum(stage["columns"] for stage in report["work"])
        causes = ", ".join(cause["effect"] for cause in report["causes"] if cause["included"])
        wall, busy = (statistics.median(getattr(t, kind) for t in took) for kind in ("seconds", "busy"))
        print(
            f"| {2 * masses} | {LOGS} x {samples} | {len(effects) or 'all'} | {wall:.1f} s | {busy:.1f} s | {passed / 1e6:.1f} M | {columns} "
            f"| {report['verdict']}: {causes} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
