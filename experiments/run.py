"""The experiments of the GPSINDy paper, and more, by one command each.

    python experiments/run.py table2 --jetracer FOLDER

Results go to `--out`, a line a job, so that an interrupted experiment goes on where it was.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

for _pool in ("RAYON", "OPENBLAS", "OMP"):  # The jobs take the cores, one each.
    os.environ.setdefault(f"{_pool}_NUM_THREADS", "1")

EXPERIMENTS = {
    "table1": "coefficients of Lotka-Volterra (Table I)",
    "coefficients": "coefficient error over the noise, Lotka-Volterra and unicycle, and its figure",
    "ablation": "what each step of the default buys",
    "table2": "open-loop error on the small car (Table II and its figure)",
    "trajectory": "one rollout of the car as a picture",
    "systems": "further systems by the default, and two ways to derivatives",
}
HERE = Path(__file__).resolve().parent
LOGS = HERE.parent.parent / "shared" / "data" / "jetracer"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    known = "\n".join(f"  {name:12}{text}" for name, text in EXPERIMENTS.items())
    found = argparse.ArgumentParser(
        prog="experiments/run.py",
        description=__doc__,
        epilog=f"experiments:\n{known}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    found.add_argument("experiment", choices=[*EXPERIMENTS, "all"])
    found.add_argument("--out", type=Path, default=Path("out/experiments"), help="folder of results [%(default)s]")
    found.add_argument("--workers", type=int, help="processes [one a core]")
    found.add_argument("--seed", type=int, default=0, help="first seed of the noise [%(default)s]")
    found.add_argument("--seeds", type=int, default=40, help="draws of noise a cell [%(default)s]")
    found.add_argument("--sigmas", type=float, nargs="+", help="levels of noise [those of the paper]")
    found.add_argument("--methods", nargs="+", help="rows of the table [all]")
    found.add_argument("--rates", type=int, nargs="+", help="of the car, Hz [5 10 25]")
    found.add_argument("--every", type=int, default=1, help="every so-manieth run of the car [%(default)s]")
    found.add_argument("--regimes", nargs="+", help="given10 free10 given5 free5 irregular [the first two]")
    found.add_argument("--systems", nargs="+", help="simulated systems [all]")
    found.add_argument("--jetracer", type=Path, default=LOGS, help="folder of the car's logs [%(default)s]")
    return found


def main(arguments: list[str] | None = None) -> int:
    """Runs what the command line asks for."""
    options = parser().parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    chosen = list(EXPERIMENTS) if options.experiment == "all" else [options.experiment]
    for name in chosen:
        print(f"{name}: {EXPERIMENTS[name]}", file=sys.stderr, flush=True)
        print(importlib.import_module(name).run(options), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
