"""Chaotic systems of dysts with polynomial right sides, each known from one noisy trajectory.

    python benches/public/dysts_systems.py [--noise 0.01] [--samples 1000] [--methods gpsindy pysindy] [--systems Lorenz ...]

The equations are those of the package `dysts` (Gilpin, "Chaos as an interpretable benchmark", arXiv 2110.05266; Apache
2.0). They are integrated here. Those with polynomials of degree 4 at most are taken, as Kaptanoglu et al. do ("Benchmarking
sparse system identification with low-dimensional chaos", arXiv 2302.10787); there they are 70, and the package has grown
since.

Every method sees one trajectory after a transient of 5 periods: `--samples` of them, 100 a period, each state with white
noise of `--noise` standard deviations. A library of all monomials up to the degree of the system (at least 3) is given to
everyone. What counts: whether exactly the true terms were found, the largest relative error of a true coefficient, and the
processor time. `rates` is how the equations predict the rates along the true motion of as many samples more: the sum of squared errors
by the sum of squares, the largest one of a state.

Methods: `gpsindy`, the command line as it comes; `pysindy`, as it comes with that degree; `pysindy-esindy`, bagged and
smoothed, with the threshold of the best held-out last quarter of derivatives.

A line a job stands in `--out`; a run that was interrupted goes on where it was. Needs numpy, scipy, sympy, dysts; pysindy
for the peers.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import resource
import shutil
import subprocess
import tempfile
import time
import warnings
from pathlib import Path

from jobs import carried_on

METHODS = ("gpsindy", "pysindy", "pysindy-esindy")
NAMES = "xyzwvs"
# Samples in a period of the system, and periods of the transient.
PER_PERIOD, TRANSIENT = 100, 5


def right_side(name):
    """The system's equations as a function of time and state."""
    import numpy as np
    from dysts import flows

    model = getattr(flows, name)()
    return lambda t, x: np.array(model.rhs(x, t), dtype=float)


def polynomials(name, dimension):
    """True coefficients, `{term: value}` a state, and the degree; None where that is above 4 or a side no polynomial."""
    import numpy as np
    import sympy
    from dysts import flows

    states = sympy.symbols(" ".join(NAMES[:dimension]))
    t = sympy.Symbol("t")
    try:
        sides = getattr(flows, name)().rhs(np.array(states, dtype=object), t)
        found = [sympy.Poly(sympy.expand(sympy.sympify(side)), *states) for side in sides]
    except Exception:
        return None
    degree = max(side.total_degree() for side in found)
    if degree > 4 or any(t in side.free_symbols for side in found):
        return None
    return [{term_name(powers): float(value) for powers, value in side.terms() if value != 0} for side in found], degree


def term_name(powers):
    """Name of a monomial: `1`, `x`, `x*y`, `x^2*z`."""
    parts = [name if power == 1 else f"{name}^{power}" for name, power in zip(NAMES, powers) if power]
    return "*".join(parts) or "1"


def systems():
    """Name, start, period, true coefficients and degree of every system that is taken."""
    import dysts
    import numpy as np

    table = json.loads((Path(dysts.__file__).parent / "data" / "chaotic_attractors.json").read_text(encoding="utf-8"))
    for name, about in sorted(table.items()):
        start = np.atleast_2d(np.array(about["initial_conditions"], dtype=float))[0]
        if about["delay"] or about["nonautonomous"] or len(start) > len(NAMES):
            continue
        found = polynomials(name, len(start))
        if found:
            yield {"name": name, "start": start.tolist(), "period": about["period"], "terms": found[0], "degree": found[1]}


def trajectory(system, samples):
    """Sample times from 0, and the true states."""
    import numpy as np
    from scipy.integrate import solve_ivp

    side, period = right_side(system["name"]), system["period"]
    times = np.arange(samples) * (period / PER_PERIOD)
    settled = solve_ivp(side, (0, TRANSIENT * period), system["start"], method="LSODA", rtol=1e-9, atol=1e-9).y[:, -1]
    return times, solve_ivp(side, (0, times[-1]), settled, t_eval=times, method="LSODA", rtol=1e-11, atol=1e-11).y.T


def continued(system, last, samples):
    """True states of as many samples behind `last`, and their rates."""
    import numpy as np
    from scipy.integrate import solve_ivp

    side = right_side(system["name"])
    times = np.arange(samples) * (system["period"] / PER_PERIOD)
    states = solve_ivp(side, (0, times[-1]), last, t_eval=times, method="LSODA", rtol=1e-9, atol=1e-9).y.T
    return states, np.array([side(0.0, state) for state in states])


def missed_rates(found, numbers, states, rates):
    """Sum of squared errors of the rates by the sum of squares, the largest one of a state."""
    import numpy as np

    scope = {name: getattr(np, name) for name in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt", "abs", "sign")}
    scope |= {**numbers, **dict(zip(NAMES, states.T))}
    shares = []
    for side, true in zip(found, rates.T):
        # The terms are what the methods print, a power as `^`.
        predicted = sum((v * eval(term.replace("^", "**"), {"__builtins__": {}}, scope) for term, v in side.items()), 0.0 * true)
        shares.append(float(((predicted - true) ** 2).sum() / max((true**2).sum(), 1e-300)))
    return max(shares)


def learn_gpsindy(x, t, degree):
    names = NAMES[: x.shape[1]]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        rows = [",".join(["t", *names])] + [",".join(f"{v:.10g}" for v in (time, *row)) for time, row in zip(t, x)]
        log.write_text("\n".join(rows) + "\n", encoding="utf-8")
        command = [
            os.environ.get("GPSINDY", "gpsindy"),
            "identify",
            str(log),
            "--degree",
            str(degree),
            "--threads",
            "1",
            "--json",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout.strip():
        raise RuntimeError(done.stderr.strip()[-200:])
    found = json.loads(done.stdout)
    record = found["model"]["identification"]
    sides = [{term: v for term, v in zip(record["terms"], row) if v != 0} for row in record["coefficients"]]
    numbers = {number["name"]: number["value"] for number in found["model"].get("parameter", [])}
    return sides, {"status": done.returncode, "notes": found["notes"]}, numbers


def learn_pysindy(x, t, degree):
    import pysindy

    library = pysindy.PolynomialLibrary(degree=degree)
    model = pysindy.SINDy(feature_library=library)
    model.fit(x, t=t)
    return named(library, model.coefficients()), {}, {}


def learn_esindy(x, t, degree):
    import numpy as np
    import pysindy

    library = pysindy.PolynomialLibrary(degree=degree)

    def fit(threshold, x, t):
        optimizer = pysindy.EnsembleOptimizer(pysindy.STLSQ(threshold=threshold), bagging=True, n_models=20)
        slope = pysindy.SmoothedFiniteDifference()
        model = pysindy.SINDy(optimizer=optimizer, feature_library=library, differentiation_method=slope)
        model.fit(x, t=t)
        return model

    cut = 3 * len(t) // 4
    slopes = pysindy.SmoothedFiniteDifference()._differentiate(x, t)

    def error(threshold):
        try:
            return float(((fit(threshold, x[:cut], t[:cut]).predict(x[cut:]) - slopes[cut:]) ** 2).sum())
        except Exception:
            return np.inf

    best = fit(min((0.01, 0.03, 0.1, 0.3, 1.0), key=error), x, t)
    return named(library, best.coefficients()), {}, {}


def named(library, coefficients):
    return [{term_name(powers): float(v) for powers, v in zip(library.powers_, row) if v != 0} for row in coefficients]


LEARN = {"gpsindy": learn_gpsindy, "pysindy": learn_pysindy, "pysindy-esindy": learn_esindy}


def judge(found, true):
    """Whether the terms are exactly the true ones, and the largest relative error of a true coefficient."""
    exact = all(set(f) == set(t) for f, t in zip(found, true))
    errors = [abs(f.get(term, 0.0) / value - 1) for f, t in zip(found, true) for term, value in t.items()]
    return exact, max(errors)


def processor_time():
    return sum(
        use.ru_utime + use.ru_stime for use in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def job(system, asked, method, results):
    """Learns one system by one method, in a process of its own."""
    import numpy as np

    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    times, true = trajectory(system, asked["samples"])
    name = [ord(letter) for letter in system["name"]]
    generator = np.random.default_rng([asked["seed"], *name])
    x = true + asked["noise"] * true.std(axis=0) * generator.standard_normal(true.shape)
    begun = processor_time()
    try:
        found, more, numbers = LEARN[method](x, times, max(3, system["degree"]))
        spent = processor_time() - begun
        exact, error = judge(found, system["terms"])
        missed = missed_rates(found, numbers, *continued(system, true[-1], asked["samples"]))
        line = {"exact": exact, "error": error, "rates": missed if math.isfinite(missed) else None, **more}
    except Exception as failure:
        spent = processor_time() - begun
        line = {"exact": False, "error": None, "rates": None, "note": f"{type(failure).__name__}: {failure}"[:200]}
    results.put({**line, "processor": round(spent, 2)})


def within(limit, *arguments):
    """The job's line, or one that says that it took too long."""
    # The packages are loaded once, where the platform can copy a process.
    context = multiprocessing.get_context(
        "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    )
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload(["numpy", "scipy.integrate", "sympy", "dysts.flows", "pysindy"])
    results = context.Queue()
    process = context.Process(target=job, args=(*arguments, results))
    begun = time.monotonic()
    process.start()
    try:
        line = results.get(timeout=limit)
    except Exception:
        line = {"exact": False, "error": None, "rates": None, "processor": None, "note": f"no answer within {limit} s"}
    process.terminate()
    process.join()
    return {**line, "seconds": round(time.monotonic() - begun, 1)}


def table(lines, methods):
    """Markdown: share of exact systems, median error of those, processor time."""
    rows = [
        "| noise | samples | method | systems | exact terms | median error where exact | median, longest time, s |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for noise, samples in sorted({(line["noise"], line["samples"]) for line in lines}):
        for method in methods:
            of = [line for line in lines if (line["noise"], line["samples"], line["method"]) == (noise, samples, method)]
            if not of:
                continue
            exact = sorted(line["error"] for line in of if line["exact"])
            spent = sorted(line["processor"] for line in of if line["processor"] is not None) or [float("nan")]
            middle = f"{exact[len(exact) // 2]:.1e}" if exact else "-"
            share, times = len(exact) / len(of), f"{spent[len(spent) // 2]:.1f}, {spent[-1]:.1f}"
            rows.append(f"| {noise:g} | {samples} | {method} | {len(of)} | {share:.3f} | {middle} | {times} |")
    return "\n".join(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.01], help="in standard deviations of each state")
    parser.add_argument("--samples", type=int, nargs="+", default=[1000])
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--systems", nargs="+", help="names; default: all")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    parser.add_argument("--time-limit", type=float, default=300.0, help="s, of one fit")
    parser.add_argument("--out", type=Path, default=Path("out/dysts.jsonl"))
    asked = parser.parse_args()
    if "gpsindy" in asked.methods and not shutil.which(os.environ.get("GPSINDY", "gpsindy")):
        parser.error("the program `gpsindy` is not on the path; name it in the variable GPSINDY")
    warnings.simplefilter("ignore")
    # One thread a job, so that times can be compared.
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")
    all_systems = [system for system in systems() if not asked.systems or system["name"] in asked.systems]
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    jobs = (
        ({"system": system["name"], "noise": noise, "samples": samples, "seed": asked.seed, "method": method}, system)
        for noise in asked.noise
        for samples in asked.samples
        for system in all_systems
        for method in asked.methods
    )

    def run(about, system):
        return within(asked.time_limit, system, {part: about[part] for part in ("noise", "samples", "seed")}, about["method"])

    lines = carried_on(asked.out, jobs, run)
    chosen = {system["name"] for system in all_systems}
    print(table([line for line in lines if line["system"] in chosen and line["seed"] == asked.seed], asked.methods))


if __name__ == "__main__":
    main()
