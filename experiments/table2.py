"""Table II of the paper and its figure: open-loop error on the small car at 5, 10 and 25 Hz over the noise."""

from __future__ import annotations

from argparse import Namespace
from collections import defaultdict
from pathlib import Path

import numpy as np

import car_methods
import jetracer
import jobs
from tables import markdown, number, quartiles, slashed

PAPER = {
    ("sindy-author", 5): "15.6 / 24.3 / 29.4",
    ("sindy-author", 10): "8.4 / 13.0 / 20.8",
    ("sindy-author", 25): "7.2 / 12.1 / 20.8",
    ("gpsindy-author", 5): "9.1 / 12.0 / 18.4",
    ("gpsindy-author", 10): "6.7 / 9.0 / 13.1",
    ("gpsindy-author", 25): "7.3 / 10.7 / 16.8",
    ("ssr-coefficient", 5): "24.0 / 26.3 / 40.2",
    ("ssr-coefficient", 10): "35.3 / 40.0 / 49.5",
    ("ssr-coefficient", 25): "54.9 / 57.2 / 76.1",
    ("ssr-residual", 5): "6.1 / 24.6 / 54.9",
    ("ssr-residual", 10): "7.5 / 46.0 / 284",
    ("ssr-residual", 25): "51.7 / 57.1 / 141",
}
"""Quartiles as the paper prints them."""


def work(job: jobs.Job) -> jobs.Result:
    """One run, rate, noise and method."""
    run = jetracer.prepare(job["folder"], job["run"], job["rate"], job["sigma"], job["seed"])
    return jetracer.errors(run, car_methods.METHODS[job["method"]](run))


def logs_of(options: Namespace, name: str) -> tuple[Path, str]:
    """The folder of the logs, and what to say where there is none."""
    folder = options.jetracer
    if folder.is_dir() and any(folder.glob("rollout_*.csv")):
        return folder, ""
    return folder, f"{name}: skipped, no rollout_*.csv of the car in {folder}; name their folder with --jetracer\n"


def known_methods(names: list[str]) -> list[str]:
    """The names, or an end with a message."""
    if unknown := sorted(set(names) - set(car_methods.METHODS)):
        raise SystemExit(f"--methods: unknown `{unknown[0]}`; known: {', '.join(car_methods.METHODS)}")
    return names


def run(options: Namespace) -> str:
    """Computes what is missing, draws the figure and gives the tables as text."""
    folder, missing = logs_of(options, "table2")
    if missing:
        return missing
    names = jetracer.names(folder)[:: options.every]
    wanted = [
        {"folder": str(folder), "run": name, "rate": rate, "sigma": sigma, "seed": options.seed, "method": method}
        for method in known_methods(options.methods or list(car_methods.METHODS))
        for rate in options.rates or jetracer.RATES
        for sigma in options.sigmas or jetracer.SIGMAS
        for name in names
    ]
    results = jobs.run(wanted, work, options.out / "table2.jsonl", options.workers)
    text = summary(results)
    (options.out / "table2.md").write_text(text, encoding="utf-8")
    import pictures

    pictures.car(results, options.out / "table2.svg")
    return text


def summary(results: list[jobs.Result]) -> str:
    """A table in the authors' metric and one in units."""
    groups: dict[tuple[str, int], list[jobs.Result]] = defaultdict(list)
    for entry in results:
        groups[entry["job"]["method"], entry["job"]["rate"]].append(entry)
    rates = sorted({rate for _, rate in groups})
    methods = list(dict.fromkeys(method for method, _ in groups))
    theirs, ours = [], []
    for method in methods:
        cells, printed = [], []
        for rate in rates:
            group = groups[method, rate]
            cells.append(slashed(quartiles(field(group, "author"))))
            printed.append(PAPER.get((method, rate), ""))
            ours.append([method, f"{rate} Hz", *honest(group), str(len(group))])
        theirs.append([method, *cells, *printed])
    head = ["method", *(f"{rate} Hz" for rate in rates), *(f"paper, {rate} Hz" for rate in rates)]
    units = ["method", "rate", "position, m", "x, m", "y, m", "speed, m/s", "heading, rad", "diverged", "failed", "runs"]
    sigmas = sorted({entry["job"]["sigma"] for entry in results})
    n_runs = len({entry["job"]["run"] for entry in results})
    return (
        f"{n_runs} runs of the car, noise {', '.join(map(number, sigmas))}, one draw each (seed"
        f" {results[0]['job']['seed']}); one open-loop rollout over the last 30 %.\n\n"
        "The authors' number (Frobenius norm over samples and states, against the noisy log), quartiles:\n\n"
        + markdown(head, theirs)
        + "\nAgainst the log of motion capture, root mean squares of a rollout, medians (position: quartiles):\n\n"
        + markdown(units, ours)
    )


def field(group: list[jobs.Result], name: str) -> list[float]:
    """One number of every entry, infinite where the method failed or its rollout left."""
    return [np.inf if "error" in entry else float(entry[name]) for entry in group]


def honest(group: list[jobs.Result]) -> list[str]:
    """Cells of a row in units."""
    position = quartiles(np.inf if e.get("diverged", True) else e["position"] for e in group)
    states = [quartiles(np.inf if e.get("diverged", True) else e["rmse"][j] for e in group)[1] for j in range(4)]
    share = np.mean([bool(e.get("diverged")) for e in group])
    failed = np.mean(["error" in e for e in group])
    return [slashed(position), *map(number, states), f"{share:.0%}", f"{failed:.0%}"]
