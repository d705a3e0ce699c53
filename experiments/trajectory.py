"""The paper's picture of one rollout of the car: where each method thinks it goes."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

import car_methods
import jetracer
import jobs
from table2 import known_methods, logs_of
from tables import markdown, number

METHODS = ["sindy-author", "gpsindy-author", "polynomial-in-control", "e-sindy", "default", "default-physics"]
RUN, RATE, SIGMA = "rollout_21", 5, 0.01
"""The authors' rollout_12, which they show."""


def work(job: jobs.Job) -> jobs.Result:
    """One method."""
    run = jetracer.prepare(job["folder"], job["run"], job["rate"], job["sigma"], job["seed"])
    predicted = car_methods.METHODS[job["method"]](run)
    return {**jetracer.errors(run, predicted), "path": np.nan_to_num(predicted[:, :2], nan=1e6).tolist()}


def run(options: Namespace) -> str:
    """The picture, and the errors as text."""
    folder, missing = logs_of(options, "trajectory")
    if missing:
        return missing
    methods = known_methods(options.methods or METHODS)
    rate, sigma = (options.rates or [RATE])[0], (options.sigmas or [SIGMA])[0]
    common = {"folder": str(folder), "run": RUN, "rate": rate, "sigma": sigma, "seed": options.seed}
    wanted = [{**common, "method": method} for method in methods]
    found = jobs.run(wanted, work, options.out / "trajectory.jsonl", options.workers)
    shown = {e["job"]["method"]: np.array(e["path"]) for e in found if "error" not in e}
    log = jetracer.prepare(folder, RUN, rate, sigma, options.seed)
    import pictures

    pictures.trajectories(log.clean[log.test], shown, options.out / "trajectory.svg")
    rows = [[e["job"]["method"], number(e["author"]), number(e["position"])] for e in found if "error" not in e]
    rows += [[e["job"]["method"], e["error"], ""] for e in found if "error" in e]
    head = ["method", "authors' number", "position, m"]
    text = f"{RUN} at {rate} Hz, sigma {sigma:g}, seed {options.seed}:\n\n{markdown(head, rows)}"
    (options.out / "trajectory.md").write_text(text, encoding="utf-8")
    return text
