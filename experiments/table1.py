"""Table I of the paper: coefficients of Lotka-Volterra by the rows of the paper and by ours, one draw of noise."""

from __future__ import annotations

from argparse import Namespace

import coefficient_methods
import jobs
import simulated
from tables import markdown

SIGMA = 0.05
"""The paper names none; the size of its spurious terms fits this one."""
METHODS = ["sindy-author", "gpsindy-author", "gpsindy-paper", "default"]
PAPER = {
    ("x1", "x1"): ("1.108", "1.097"),
    ("x1", "x1*x2"): ("-0.397", "-0.358"),
    ("x1", "cos(x1)"): ("", "-0.049"),
    ("x1", "x1^2*sin(x2)"): ("-0.003", ""),
    ("x1", "x1*x2*sin(x2)"): ("0.003", ""),
    ("x1", "x1^2*cos(x2)"): ("-0.001", ""),
    ("x2", "x2"): ("-0.997", "-0.980"),
    ("x2", "x1*x2"): ("0.382", "0.396"),
    ("x2", "x2^2"): ("", "-0.005"),
    ("x2", "cos(x1)"): ("0.016", ""),
    ("x2", "x1*cos(x1)"): ("-0.005", ""),
    ("x2", "x1*x2*sin(x1)"): ("-0.007", ""),
    ("x2", "x1^2*cos(x1)"): ("-0.009", "-0.003"),
}
"""SINDy and GPSINDy as the paper prints them; its truth of -0.1 for x2 is a slip, -1 is simulated."""


def work(job: jobs.Job) -> jobs.Result:
    """One method."""
    system = simulated.SYSTEMS["lotka-volterra"]
    data = simulated.sample("lotka-volterra", "given10", job["sigma"], job["seed"])
    return {"coefficients": coefficient_methods.METHODS[job["method"]](system, data).tolist()}


def run(options: Namespace) -> str:
    """The table as text."""
    system = simulated.SYSTEMS["lotka-volterra"]
    sigma = (options.sigmas or [SIGMA])[0]
    methods = options.methods or METHODS
    wanted = [{"sigma": sigma, "seed": options.seed, "method": method} for method in methods]
    found = jobs.run(wanted, work, options.out / "table1.jsonl", options.workers)
    rows = []
    for s, state in enumerate(system.states):
        for k, term in enumerate(system.terms):
            values = [entry["coefficients"][s][k] if "error" not in entry else float("nan") for entry in found]
            true, printed = system.truth.get((state, term), 0.0), PAPER.get((state, term), ("", ""))
            if true or any(values) or any(printed):
                rows.append([f"{state}': {term}", shown(true), *printed, *map(shown, values)])
    head = ["term", "truth", "paper: SINDy", "paper: GPSINDy", *methods]
    text = f"Lotka-Volterra, 10 Hz, derivatives given, sigma {sigma:g}, seed {options.seed}:\n\n{markdown(head, rows)}"
    (options.out / "table1.md").write_text(text, encoding="utf-8")
    return text


def shown(value: float) -> str:
    """Three digits behind the point, nothing for nothing."""
    return f"{value:.3f}" if value else ""
