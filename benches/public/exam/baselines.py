"""Two simple methods that sit the exam: each writes OUT/CASE/report.json for every case of a suite.

    python benches/public/exam/baselines.py discrepancy SUITE OUT
    python benches/public/exam/baselines.py parameters SUITE OUT

`discrepancy`: what the nominal equations miss of the measured derivatives is regressed on a library with PySINDy (STLSQ); the
strongest term is the cause, under the name that the catalogue has for it. After Kaheman et al. 2019, discrepancy models by SINDy.

`parameters`: the parameters of the nominal model are fitted to short rollouts by scipy's `least_squares`; those that move by more than
their tolerance and three standard errors are the causes. This is what parameter identification in a simulator amounts to.

Neither sees the answers. A case on which a method fails has no report and counts as missed.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import gpsindy

#: A method calls the gap closed where this share of the squared error goes away.
CLOSED = 0.8
#: Below this share nothing was found.
MATERIAL = 0.05


def name_of(header):
    """The column's name: the text up to the unit."""
    return re.sub(r"\W", "_", re.split(r"[\[(,]", header, maxsplit=1)[0].strip())


def read(path):
    """Columns of a log; an empty cell is not a number."""
    with path.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    values = [[float(cell) if cell.strip() else np.nan for cell in row] for row in rows[1:]]
    return {name_of(header): np.array(column) for header, column in zip(rows[0], zip(*values))}


def filled(t, column):
    """Missing samples by interpolation."""
    good = np.isfinite(column)
    return np.interp(t, t[good], column[good])


class Case:
    """A case as a method sees it: the nominal model, and runs as (t, states, controls)."""

    def __init__(self, folder):
        self.model = gpsindy.Model.load(folder / "model.toml")
        self.table = tomllib.loads((folder / "model.toml").read_text(encoding="utf-8"))
        self.states = [state.name for state in self.model.states]
        self.controls = [control.name for control in self.model.controls]
        self.equations = {state["name"]: state["equation"].strip() for state in self.table["state"]}
        self.train = [self._run(path) for path in sorted(folder.glob("real_*.csv"))]
        self.holdout = [self._run(path) for path in sorted(folder.glob("holdout_*.csv"))]

    def _run(self, path):
        log = read(path)
        t = log.get("t", log.get("time"))
        t = t - t[0]
        x = []
        for state in self.states:
            if state in log:
                x.append(filled(t, log[state]))
                continue
            # A state that is the rate of a logged one is its slope.
            position = next((p for p, equation in self.equations.items() if equation == state and p in log), None)
            if position is None:
                raise ValueError(f"{path.name} lacks {state}")
            x.append(np.gradient(filled(t, log[position]), t))
        u = [filled(t, log[name]) for name in self.controls]
        return t, np.column_stack(x), np.column_stack(u) if u else np.zeros((len(t), 0))

    def kinematic(self, state):
        """Whether the equation only says that one state is the rate of another."""
        return self.equations[state] in self.states


def report(verdict, causes, state=None):
    gap = {"detected": verdict != "no_gap", "by_state": [{"state": state, "share": 1.0}] if state else []}
    return {"schema": "gpsindy.diagnosis/1", "verdict": verdict, "gap": gap, "causes": causes}


def verdict_of(share):
    """The verdict for a method that closes this share of the squared error."""
    return "no_gap" if share < MATERIAL else "explained" if share > CLOSED else "partly_explained"


# ---- discrepancy regression ------------------------------------------------------------------------------------------------------


def candidates(case, state):
    """(effect, variables, function of x and u) of every term that the catalogue has a name for."""
    position = next((p for p, equation in case.equations.items() if equation == state), None)
    terms = [("bias", [], lambda x, u: np.ones(len(x)))]

    def term(effect, variables, f):
        terms.append((effect, variables, f))

    for i, z in enumerate(case.states):
        own = z == state
        term("viscous_friction" if own else "linear_stiffness" if z == position else "coupling", [z], lambda x, u, i=i: x[:, i])
        term("cubic_stiffness", [z], lambda x, u, i=i: x[:, i] ** 3)
        if own:
            term("quadratic_drag", [z], lambda x, u, i=i: x[:, i] * np.abs(x[:, i]))
            term("coulomb_friction", [z], lambda x, u, i=i: np.sign(x[:, i]))
        else:
            term("gravity_load", [z], lambda x, u, i=i: np.sin(x[:, i]))
        for k in range(i):
            term("product_coupling", [case.states[k], z], lambda x, u, i=i, k=k: x[:, i] * x[:, k])
    for j, control in enumerate(case.controls):
        term("input_gain", [control], lambda x, u, j=j: u[:, j])
    return terms


def discrepancy(case):
    import pysindy

    smooth = pysindy.SmoothedFiniteDifference()
    slopes = [smooth._differentiate(x, t) for t, x, _ in case.train]
    missing = np.vstack([s - case.model.derivative(x, u, t) for s, (t, x, u) in zip(slopes, case.train)])
    x, u = (np.vstack([run[k] for run in case.train]) for k in (1, 2))
    best = (0.0, None, None)
    for row, state in enumerate(case.states):
        if case.kinematic(state):
            continue
        terms = candidates(case, state)
        columns = np.column_stack([f(x, u) for _, _, f in terms])
        sizes = columns.std(axis=0) + np.abs(columns.mean(axis=0)) + 1e-12
        target = missing[:, row : row + 1]
        scale = target.std() + 1e-12
        optimizer = pysindy.STLSQ(threshold=0.1, alpha=1e-3)
        optimizer.fit(columns / sizes, target / scale)
        coefficients = np.asarray(optimizer.coef_).ravel()
        left = target.ravel() / scale - (columns / sizes) @ coefficients
        share = 1 - (left**2).mean() / max(((target.ravel() / scale) ** 2).mean(), 1e-12)
        if share > best[0]:
            order = np.argsort(-np.abs(coefficients * columns.std(axis=0) / sizes + coefficients * (columns.std(axis=0) == 0)))
            chosen = [terms[k] for k in order if coefficients[k] != 0.0]
            best = (share, state, chosen)
    share, state, chosen = best
    verdict = verdict_of(share)
    if verdict == "no_gap" or not chosen:
        return report("no_gap", [])
    causes = [
        {"effect": effect, "state": state, "variables": variables, "included": k == 0, "probability": 0.5 / (k + 1)}
        for k, (effect, variables, _) in enumerate(chosen[:3])
    ]
    return report(verdict, causes, state)


# ---- fit of parameters -----------------------------------------------------------------------------------------------------------


def windows(runs, length=40, most=24):
    """Short stretches of the runs, evenly spread."""
    every = [(t[k : k + length], x[k : k + length], u[k : k + length]) for t, x, u in runs for k in range(0, len(t) - length, length)]
    return every[:: max(1, len(every) // most)]


def errors(case, model, stretches):
    """Rollout less log, in units of each state's spread, one array."""
    spread = np.std(np.vstack([x for _, x, _ in stretches]), axis=0) + 1e-12
    rows = []
    for t, x, u in stretches:
        try:
            rolled = np.asarray(model.simulate(x[0], t, u if u.shape[1] else None).x)
        except gpsindy.NumericalError:
            rolled = np.full_like(x, 1e3)
        rows.append(np.clip((rolled - x) / spread, -1e3, 1e3).ravel())
    return np.concatenate(rows)


def parameters(case):
    table = {entry["name"]: entry for entry in case.table.get("parameter", [])}
    names = [name for name, entry in table.items() if entry["value"] != 0.0]
    train, held = windows(case.train), windows(case.holdout or case.train)

    def model(factors):
        return case.model.with_parameters(**{name: table[name]["value"] * f for name, f in zip(names, factors)})

    if not names:
        return report("unexplained", [])
    start = np.ones(len(names))
    fit = least_squares(lambda f: errors(case, model(f), train), start, loss="soft_l1", diff_step=1e-4, max_nfev=30)
    before, after = ((errors(case, model(f), held) ** 2).mean() for f in (start, fit.x))
    share = 1 - after / max(before, 1e-12)
    spread = 2 * fit.cost / max(len(fit.fun) - len(names), 1)
    deviation = np.sqrt(np.maximum(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)) * spread, 0))
    moved = np.abs(fit.x - 1)
    beyond = [k for k, name in enumerate(names) if moved[k] > max(3 * deviation[k], 2 * table[name].get("tolerance", 0.0), 0.01)]
    if not beyond or share < MATERIAL:
        return report("no_gap", [])
    beyond.sort(key=lambda k: -moved[k] / max(deviation[k], 1e-9))
    causes = []
    for place, k in enumerate(beyond[:3]):
        state = next((s for s in case.states if re.search(rf"\b{re.escape(names[k])}\b", case.equations[s])), case.states[-1])
        cause = {"effect": "parameter_error", "state": state, "variables": [names[k]]}
        causes.append({**cause, "included": True, "probability": 0.5 / (place + 1)})
    return report(verdict_of(share), causes, causes[0]["state"])


def main():
    methods = {"discrepancy": discrepancy, "parameters": parameters}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", choices=sorted(methods))
    parser.add_argument("suite", type=Path)
    parser.add_argument("out", type=Path)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    for folder in sorted(path.parent for path in asked.suite.glob("*/model.toml")):
        target = asked.out / folder.name / "report.json"
        if target.exists():
            continue
        try:
            found = methods[asked.method](Case(folder))
        except Exception as failure:
            print(f"{folder.name}: {type(failure).__name__}: {failure}", file=sys.stderr)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
