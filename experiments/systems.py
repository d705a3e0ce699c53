"""Further systems by the default, and the comparison that the paper leaves open: derivatives over time or over the state.

`gp-time` takes the derivative of the Gaussian process over time; `gp-state` the paper's second process from smoothed states
to differences; `weak` integrals, nothing differentiated: the three with the same regression and no refinement. `default` is
`weak` and the refinement through the integrator.
"""

from __future__ import annotations

from argparse import Namespace

import numpy as np

import gpsindy
import jobs
from more_systems import SYSTEMS
from tables import markdown, number, quartiles, slashed

NOISE = 0.05
METHODS: dict[str, dict[str, object]] = {
    "default": {},
    "weak": {"refine": False},
    "gp-time": {"derivative_method": "gp-time", "refine": False},
    "gp-state": {"derivative_method": "gp-state", "refine": False},
}


def work(job: jobs.Job) -> jobs.Result:
    """One system, method and seed."""
    truth = SYSTEMS[job["system"]]
    t = np.arange(0.0, truth.span + 0.5 * truth.period, truth.period)
    u, model = truth.inputs(t), truth.model()
    clean = np.array(model.simulate(truth.initial, t, u, hold="zero", tolerance=1e-10).x)
    random = np.random.default_rng([job["seed"], list(SYSTEMS).index(job["system"])])
    noisy = clean + job["noise"] * clean.std(axis=0) * random.standard_normal(clean.shape)
    names = [*truth.equations, *truth.controls]
    estimator = gpsindy.GPSINDy(hold="zero", **truth.library, **METHODS[job["method"]])
    found = estimator.fit(noisy, t, u=u, feature_names=names)
    true = model.derivative(clean, u)
    missed = np.sqrt(np.mean((found.model_.derivative(clean, u) - true) ** 2, axis=0)) / true.std(axis=0)
    result: jobs.Result = {"rates": float(np.mean(missed))}
    if truth.terms:
        terms = found.get_feature_names()
        target = np.array([[truth.terms.get((state, term), 0.0) for term in terms] for state in truth.equations])
        result["exact"] = bool(((found.coef_ != 0) == (target != 0)).all())
        result["coefficients"] = float(np.linalg.norm(found.coef_ - target) / np.linalg.norm(target))
    return result


def run(options: Namespace) -> str:
    """The table as text."""
    noise = (options.sigmas or [NOISE])[0]
    wanted = [
        {"system": system, "noise": noise, "method": method, "seed": options.seed + seed}
        for system in options.systems or SYSTEMS
        for method in options.methods or METHODS
        for seed in range(options.seeds)
    ]
    results = jobs.run(wanted, work, options.out / "systems.jsonl", options.workers)
    rows = []
    for system in options.systems or SYSTEMS:
        for method in options.methods or METHODS:
            group = [e for e in results if (e["job"]["system"], e["job"]["method"]) == (system, method)]
            rows.append([system, method, *cells(group)])
    head = ["system", "method", "exact supports", "relative coefficient error", "relative error of rates", "s"]
    seeds = f"{options.seeds} seeds from {options.seed}"
    text = f"Noise {noise:.0%} of each state's standard deviation, {seeds}, quartiles:\n\n{markdown(head, rows)}"
    (options.out / "systems.md").write_text(text, encoding="utf-8")
    return text


def cells(group: list[jobs.Result]) -> list[str]:
    """Of one system and method; a failure is an infinite error."""
    rates = quartiles(e.get("rates", np.inf) for e in group)
    seconds = number(float(np.median([e["seconds"] for e in group])))
    if not any("exact" in e for e in group):
        return ["-", "-", slashed(rates), seconds]
    exact = np.mean([e.get("exact", False) for e in group])
    return [f"{exact:.2f}", slashed(quartiles(e.get("coefficients", np.inf) for e in group)), slashed(rates), seconds]
