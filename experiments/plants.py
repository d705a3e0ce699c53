"""Machines written by hand, as a user would write them: plants with one effect, two, none, or one that the catalogue lacks.

    python experiments/plants.py [--names slider_stop cylinder_worn] [--out out/plants] [--program target/release/gpsindy]

The right sides and the forms of the effects (``tanh(v/0.01)`` for dry friction, a stop that pulls back, a lag before a rate limit) are not
those of the generator of drawn cases. Every case has a nominal model, four logs to learn from, two that are held out, and the effects that
would be right. Prints a line for each case, and how many verdicts and causes are right: ``no_gap`` where nothing is planted, not
``explained`` where the catalogue lacks the effect, else ``explained`` by effects that are right, or that the report calls equivalent to
these. Needs the program ``gpsindy``, and no package.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import subprocess
import time

from machines import plants
from plant import Plant, simulate

LOGS, HELD_OUT = 4, 2


def written(name: str, plant: Plant, folder: pathlib.Path) -> list[str]:
    """Writes the model and the logs of a case; the arguments of its diagnosis."""
    folder.mkdir(parents=True, exist_ok=True)
    text = ['schema = "gpsindy.model/1"', f'name = "{name.split("_")[0]}"']
    for state, (unit, equation) in plant.states.items():
        text += ["[[state]]", f'name = "{state}"', f'unit = "{unit}"', f'equation = "{equation}"']
    for control, unit in plant.controls.items():
        text += ["[[control]]", f'name = "{control}"', f'unit = "{unit}"']
    for parameter, value in plant.parameters.items():
        text += ["[[parameter]]", f'name = "{parameter}"', f"value = {value}"]
    (folder / "model.toml").write_text("\n".join(text) + "\n")
    logs = [f"real_{log}.csv" for log in range(LOGS)] + [f"holdout_{log}.csv" for log in range(HELD_OUT)]
    for log, file in enumerate(logs):
        rows = simulate(plant, log, sum(map(ord, name)) * 10 + log)
        head = ",".join(["t", *plant.states, *plant.controls])
        lines = [",".join(f"{value:.7g}" for value in row) for row in rows]
        (folder / file).write_text("\n".join([head, *lines]) + "\n")
    paths = [str(folder / file) for file in logs]
    return [str(folder / "model.toml"), *paths[:LOGS], "--holdout", *paths[LOGS:], "--out", str(folder / "out"), "--force"]


def is_right(plant: Plant, verdict: str, causes: list[set[str]]) -> bool:
    """``causes``: the names of each included cause, with those of its equivalents."""
    if plant.right is None:
        return verdict in ("unexplained", "partly_explained")
    if not plant.right:
        return verdict == "no_gap"
    fits = (len(right) == len(causes) and all(right & names for names in causes) for right in plant.right)
    return verdict == "explained" and any(fits)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--names", nargs="*", help="cases; default: all")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/plants"))
    parser.add_argument("--program", default="gpsindy")
    options = parser.parse_args()
    all = plants()
    unknown = [name for name in options.names or [] if name not in all]
    if unknown:
        parser.error(f"no plant {', '.join(unknown)}; there are {', '.join(all)}")
    chosen = {name: all[name] for name in options.names or all}
    count = 0
    for name, plant in chosen.items():
        folder = options.out / name
        arguments = written(name, plant, folder)
        begin = time.perf_counter()
        subprocess.run([options.program, "diagnose", *arguments], check=True, capture_output=True)
        seconds = time.perf_counter() - begin
        report = json.loads((folder / "out" / "report.json").read_text())
        included = [cause for cause in report["causes"] if cause["included"]]
        right = is_right(plant, report["verdict"], [{cause["effect"], *cause["equivalent"]} for cause in included])
        count += right
        said = ", ".join(f"{cause['effect']} {cause['probability']:.2f}" for cause in included)
        print(f"{'+' if right else '-'} {name:20} {report['verdict']:17} {seconds:5.1f} s  {said}", flush=True)
    print(f"{count} of {len(chosen)} right")


if __name__ == "__main__":
    main()
