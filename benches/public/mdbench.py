"""The ODE part of MDBench: 63 systems, the derivative foretold over the last fifth of one noisy trajectory.

    python benches/public/mdbench.py --data strogatz_extended.json [--snr inf 40 30 20 10] [--methods ...] [--systems 1 2 ...]

The equations are those of ODEBench, from your copy of its file (see `odebench.py`). Ziaei Bideh et al., "MDBench: Benchmarking
Data-Driven Methods for Model Discovery", arXiv 2509.20529: 150 samples over 10 s, integrated here with the tolerances of their
`generate_ode.py`; every value is multiplied by 1 + s N(0, 1), s = 10^(-SNR / 20).

Every method sees the first 120 samples. Its derivatives at the last 30 samples, noise included, are compared with the true ones of the
clean trajectory: NMSE = sum of squared errors / sum of squares. `truth` is what the true equations reach, the limit under noise. A
fit that fails, has no finite value or exceeds `--time-limit` counts as infinitely wrong.

Methods: those of `odebench.py`, and `truth`. A line a job stands in `--out`; a run that was interrupted goes on where it was. Needs
numpy, scipy, sympy, gpsindy, pysindy.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import warnings
from pathlib import Path

import odebench

METHODS = ("gpsindy", "gpsindy-trig", "pysindy", "pysindy-trig", "truth")
# Length in s, samples, and the share that is learnt from, as in their data_loader.py.
SECONDS, SAMPLES, TRAINED = 10.0, 150, 0.8


def right_side(system):
    """The true right side, (samples x states) to the same."""
    import numpy as np
    import sympy

    states = sympy.symbols([f"x_{i}" for i in range(system["dim"])])
    sides = [sympy.lambdify(states, sympy.sympify(text), "numpy") for text in system["substituted"][0]]
    return lambda x: np.column_stack([np.broadcast_to(side(*x.T), len(x)) for side in sides])


def clean(system):
    """Sample times, true states and true derivatives of the first start."""
    import numpy as np
    from scipy.integrate import solve_ivp

    side = right_side(system)
    times = np.linspace(0, SECONDS, SAMPLES)
    start = system["init"][0]
    options = {"method": "LSODA", "rtol": 1e-5, "atol": 1e-7, "first_step": 1e-6, "min_step": 1e-10}
    found = solve_ivp(lambda _, x: side(x[None, :])[0], (0, SECONDS), start, t_eval=times, **options)
    return times, found.y.T, side(found.y.T)


def learnt(method, x, t):
    """Equations as text, a function of states to derivatives, and whether the method said anything of its result."""
    if method.startswith("gpsindy"):
        import gpsindy

        found = gpsindy.GPSINDy(trig=method.endswith("trig")).fit(x, t)
        return found.equations(), found.predict, bool(found.notes_) or found.poor_
    model = odebench.pysindy_model(x, t, method.endswith("trig"))
    return model.equations(), model.predict, False


def job(system, snr, method, results):
    """Learns one system by one method, in a process of its own."""
    import numpy as np

    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    times, true, rates = clean(system)
    size = 0.0 if math.isinf(snr) else 10 ** (-snr / 20)
    generator = np.random.default_rng([system["id"], 0 if math.isinf(snr) else round(snr)])
    x = true * (1 + size * generator.standard_normal(true.shape))
    cut = int(TRAINED * SAMPLES)
    line = {"equations": None, "nmse": None}
    try:
        if method == "truth":
            predict = right_side(system)
        else:
            line["equations"], predict, line["noted"] = learnt(method, x[:cut], times[:cut])
        wrong = np.asarray(predict(x[cut:])) - rates[cut:]
        nmse = float((wrong**2).sum() / ((rates[cut:] ** 2).sum() + 1e-10))
        line["nmse"] = nmse if math.isfinite(nmse) else None
    except Exception as failure:
        line["note"] = f"{type(failure).__name__}: {failure}"[:200]
    results.put(line)


def table(lines):
    """Markdown: median NMSE and the share below a hundredth, by noise and method."""
    rows = ["| SNR, dB | method | systems | median NMSE | NMSE below 0.01 | median time, s |", "| --- | --- | --- | --- | --- | --- |"]
    for snr in sorted({line["snr"] for line in lines}, reverse=True):
        for method in METHODS:
            of = [line for line in lines if line["snr"] == snr and line["method"] == method]
            if not of:
                continue
            errors = sorted(math.inf if line["nmse"] is None else line["nmse"] for line in of)
            below = 100 * sum(error < 0.01 for error in errors) / len(of)
            seconds = sorted(line["seconds"] for line in of)[len(of) // 2]
            level = "none" if math.isinf(snr) else f"{snr:g}"
            rows.append(f"| {level} | {method} | {len(of)} | {errors[len(of) // 2]:.2g} | {below:.1f} % | {seconds:.1f} |")
    return "\n".join(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="ODEBench's strogatz_extended.json")
    parser.add_argument("--snr", type=float, nargs="+", default=[math.inf, 40.0, 30.0, 20.0, 10.0], help="dB; inf: no noise")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--systems", type=int, nargs="+", help="ids; default: all")
    parser.add_argument("--time-limit", type=float, default=300.0, help="s, of one fit")
    parser.add_argument("--out", type=Path, default=Path("out/mdbench.jsonl"))
    asked = parser.parse_args()
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")
    systems = [s for s in json.loads(asked.data.read_text(encoding="utf-8")) if not asked.systems or s["id"] in asked.systems]
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    print(table(odebench.lines_at([{"snr": snr} for snr in asked.snr], systems, asked, job, {"equations": None, "nmse": None})))


if __name__ == "__main__":
    main()
