"""Machines by another hand that hold with more than they slide with, and the same with one level: what is named of them.

    python experiments/stiction.py 100 112 [--out out/stiction] [--program target/release/gpsindy]

Each seed draws one of six machines (a slider and a valve on springs, a table, an arm under gravity, a spindle, a cylinder), its parameters,
and dry friction of 15 to 40 % of the drive; once it holds with 1.3 to 3 times that level and lets go at once, and once with that level. Four
logs to learn from and two that are held out, 400 to 800 samples at 50 Hz under a sine and steps, with noise of 0.1 to 1 % of each column's
spread. Prints a line for each machine, and how many are right: one cause, ``stiction`` or ``coulomb_friction``.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import random
import subprocess

PERIOD, PARTS, LOGS, HELD_OUT = 0.02, 40, 4, 2
# States, control, ranges of the parameters, the force and the inertia that it moves, and the range of the drive.
MACHINES = {
    "arm": (
        [("q", "rad", "w"), ("w", "rad/s", "(T - d*w - g*sin(q))/J")],
        ("T", "N*m"),
        {"J": (0.1, 0.4), "d": (0.05, 0.2), "g": (0.5, 2.0)},
        lambda p, x, v, u: (u - p["d"] * v - p["g"] * math.sin(x), p["J"]),
        (0.8, 2.0),
    ),
    "cylinder": (
        [("x", "m", "v"), ("v", "m/s", "(G*s - B*v)/M")],
        ("s", "V"),
        {"M": (10.0, 30.0), "B": (40.0, 90.0), "G": (300.0, 500.0)},
        lambda p, x, v, u: (p["G"] * u - p["B"] * v, p["M"]),
        (0.6, 1.2),
    ),
    "slider": (
        [("x", "m", "v"), ("v", "m/s", "(F - k*x - b*v)/m")],
        ("F", "N"),
        {"m": (0.8, 2.5), "k": (3.0, 12.0), "b": (0.4, 2.0)},
        lambda p, x, v, u: (u - p["k"] * x - p["b"] * v, p["m"]),
        (3.0, 8.0),
    ),
    "spindle": (
        [("w", "rad/s", "(M - d*w)/J")],
        ("M", "N*m"),
        {"J": (0.02, 0.06), "d": (0.02, 0.05)},
        lambda p, x, v, u: (u - p["d"] * v, p["J"]),
        (0.2, 0.5),
    ),
    "table": (
        [("a", "rad", "w"), ("w", "rad/s", "(M - d*w)/J")],
        ("M", "N*m"),
        {"J": (0.03, 0.1), "d": (0.02, 0.06)},
        lambda p, x, v, u: (u - p["d"] * v, p["J"]),
        (0.2, 0.5),
    ),
    "valve": (
        [("x", "mm", "v"), ("v", "mm/s", "(p - k*x - b*v)/m")],
        ("p", "bar"),
        {"m": (0.02, 0.1), "k": (1.0, 3.0), "b": (0.1, 0.4)},
        lambda p, x, v, u: (u - p["k"] * x - p["b"] * v, p["m"]),
        (2.0, 5.0),
    ),
}


def after(v: float, force: float, mass: float, step: float, levels: tuple[float, float]) -> float:
    """Speed after a step under a force beside friction of (level in motion, level at rest)."""
    slides, holds = levels
    if v == 0.0:
        return 0.0 if abs(force) <= holds else step * (force - math.copysign(slides, force)) / mass
    moved = v + step * (force - math.copysign(slides, v)) / mass
    # Where it turns it stops.
    return moved if moved * v > 0.0 else 0.0


def logs_of(draw: random.Random, machine: str, ratio: float) -> tuple[dict[str, float], list[list[list[float]]]]:
    """Parameters of a machine, and rows (time, place, speed, control) of its logs."""
    _, _, ranges, push, drive = MACHINES[machine]
    p = {name: float(f"{draw.uniform(*range):.3g}") for name, range in ranges.items()}
    size = draw.uniform(*drive)
    most = size * p.get("G", 1.0)
    slides = min(draw.uniform(0.15, 0.4), 0.75 / ratio) * most
    samples, logs = draw.choice([400, 600, 800]), []
    for _ in range(LOGS + HELD_OUT):
        pace, phase, every = draw.uniform(0.5, 1.5), draw.uniform(0, 6.28), draw.randint(25, 80)
        steps = [draw.uniform(-1, 1) for _ in range(samples // every + 1)]
        x, v, rows = 0.0, 0.0, []
        for k in range(samples):
            u = size * (0.7 * math.sin(pace * k * PERIOD + phase) + 0.6 * steps[k // every])
            rows.append([k * PERIOD, x, v, u])
            for _ in range(PARTS):
                force, mass = push(p, x, v, u)
                moved = after(v, force, mass, PERIOD / PARTS, (slides, ratio * slides))
                x, v = x + 0.5 * PERIOD / PARTS * (v + moved), moved
        logs.append(rows)
    return p, logs


def written(draw: random.Random, machine: str, ratio: float, folder: pathlib.Path) -> list[str]:
    """Writes the model and the logs of a machine; the arguments of its diagnosis."""
    states, control, *_ = MACHINES[machine]
    p, logs = logs_of(draw, machine, ratio)
    text = ['schema = "gpsindy.model/1"', f'name = "{machine}"']
    for name, unit, equation in states:
        text += ["[[state]]", f'name = "{name}"', f'unit = "{unit}"', f'equation = "{equation}"']
    text += ["[[control]]", f'name = "{control[0]}"', f'unit = "{control[1]}"']
    for name, value in p.items():
        text += ["[[parameter]]", f'name = "{name}"', f"value = {value}"]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text("\n".join(text) + "\n")
    columns = [1, 2][-len(states) :]
    noise, rows = draw.uniform(0.001, 0.01), [row for log in logs for row in log]
    mean = {c: sum(row[c] for row in rows) / len(rows) for c in columns}
    spread = {c: math.sqrt(sum((row[c] - mean[c]) ** 2 for row in rows) / len(rows)) for c in columns}
    files = []
    for log in logs:
        lines = [",".join(["t", *(name for name, *_ in states), control[0]])]
        for row in log:
            read = [row[c] + draw.gauss(0.0, noise * spread[c]) for c in columns]
            lines.append(",".join(f"{value:.7g}" for value in [row[0], *read, row[3]]))
        files.append(folder / f"log_{len(files)}.csv")
        files[-1].write_text("\n".join(lines) + "\n")
    paths = [str(file) for file in files]
    return [str(folder / "model.toml"), *paths[:LOGS], "--holdout", *paths[LOGS:], "--out", str(folder / "out"), "--force"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("end", type=int)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/stiction"))
    parser.add_argument("--program", default="gpsindy")
    options = parser.parse_args()
    for wanted in ("stiction", "coulomb_friction"):
        right = 0
        for seed in range(options.first, options.end):
            draw = random.Random(f"{wanted} {seed}")
            machine = sorted(MACHINES)[seed % len(MACHINES)]
            ratio = draw.uniform(1.3, 3.0) if wanted == "stiction" else 1.0
            folder = options.out / f"{wanted}_{seed}"
            arguments = written(draw, machine, ratio, folder)
            subprocess.run([options.program, "diagnose", *arguments], check=True, capture_output=True)
            report = json.loads((folder / "out" / "report.json").read_text())
            named = [cause["effect"] for cause in report["causes"] if cause["included"]]
            right += named == [wanted]
            sign = "+" if named == [wanted] else "-"
            print(f"{sign} {seed} {machine:9} {ratio:.2f} {report['verdict']:17} {', '.join(named)}", flush=True)
        print(f"{wanted}: {right} of {options.end - options.first} right")


if __name__ == "__main__":
    main()
