"""The paper's coefficient figure: error over the noise, Lotka-Volterra and unicycle, with exact supports and quartiles."""

from __future__ import annotations

from argparse import Namespace
from collections import defaultdict

import numpy as np

import coefficient_methods
import jobs
import simulated
from tables import markdown, number, quartiles, slashed

REGIMES = ["given10", "free10"]


def work(job: jobs.Job) -> jobs.Result:
    """One system, regime, noise, seed and method."""
    system = simulated.SYSTEMS[job["system"]]
    data = simulated.sample(job["system"], job["regime"], job["sigma"], job["seed"])
    found = coefficient_methods.METHODS[job["method"]](system, data)
    truth = system.coefficients
    return {
        "mse": float(np.mean((found - truth) ** 2)),
        "norm": float(np.linalg.norm(found - truth)),
        "exact": bool(((found != 0) == (truth != 0)).all()),
    }


def run(options: Namespace, name: str = "coefficients") -> str:
    """Computes what is missing, draws the figure and gives the tables as text."""
    methods = options.methods or coefficient_methods.ROWS
    wanted = [
        {"system": system, "regime": regime, "sigma": sigma, "seed": options.seed + seed, "method": method}
        for regime in options.regimes or REGIMES
        for system in options.systems or simulated.SYSTEMS
        for method in methods
        for sigma in options.sigmas or simulated.SIGMAS
        for seed in range(options.seeds)
        if not (method == "weak-sindy" and regime == "irregular")
    ]
    results = jobs.run(wanted, work, options.out / f"{name}.jsonl", options.workers)
    text = summary(results)
    (options.out / f"{name}.md").write_text(text, encoding="utf-8")
    import pictures

    pictures.coefficients(results, options.out / f"{name}.svg")
    return text


def summary(results: list[jobs.Result]) -> str:
    """A table a system and regime."""
    groups: dict[tuple[str, str], list[jobs.Result]] = defaultdict(list)
    for entry in results:
        groups[entry["job"]["system"], entry["job"]["regime"]].append(entry)
    text = ""
    for (system, regime), group in groups.items():
        sigmas = sorted({entry["job"]["sigma"] for entry in group})
        seeds = sorted({entry["job"]["seed"] for entry in group})
        rows = []
        for method in dict.fromkeys(entry["job"]["method"] for entry in group):
            cells = [cell([e for e in group if e["job"]["method"] == method and e["job"]["sigma"] == s]) for s in sigmas]
            seconds = np.median([e["seconds"] for e in group if e["job"]["method"] == method])
            rows.append([method, *cells, number(float(seconds))])
        text += f"{system}, {regime}, seeds {seeds[0]} to {seeds[-1]}: mean squared coefficient error, quartiles; share of "
        text += "exact supports\n\n" + markdown(["method", *(f"sigma {s:g}" for s in sigmas), "s"], rows) + "\n"
    return text


def cell(group: list[jobs.Result]) -> str:
    """Quartiles and share of exact supports; a failure is an infinite error."""
    errors = quartiles(np.inf if "error" in entry else entry["mse"] for entry in group)
    exact = np.mean([entry.get("exact", False) for entry in group])
    return f"{slashed(errors)}; {exact:.2f}"
