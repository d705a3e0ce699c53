"""ODEBench: 63 small ODEs, each known from one noisy trajectory, judged on that trajectory and on another start.

    python benches/public/odebench.py --data strogatz_extended.json [--noise 0 0.05] [--kept 1] [--methods ...]

`strogatz_extended.json` is the benchmark's own file (github.com/sdascoli/odeformer, folder odeformer/odebench, MIT). It is read from
your copy and not shipped. d'Ascoli et al., "ODEFormer: Symbolic Regression of Dynamical Systems with Transformers", arXiv 2310.05573.

Every method sees the first trajectory: 512 samples over 10 s, each multiplied by 1 + noise * N(0, 1); of these the share `--kept`,
drawn at random, so that the times of half of them are uneven. Its equations are integrated from
the true first state (reconstruction) and from the benchmark's second start, which it never saw (generalisation). A system counts
where R2 against the true trajectory, weighted by variance over the states, is above 0.9. A method that fails, diverges or exceeds
`--time-limit` counts as wrong. `noted` says whether the method said anything of its result: a note, or that it is poor.

Methods: `gpsindy`, as it comes; `gpsindy-trig`, with sines and cosines; `pysindy`, as it comes; `pysindy-trig`, with the same library
as `gpsindy-trig`, smoothed differences, and the threshold that predicts the last quarter best.

A line a job stands in `--out`; a run that was interrupted goes on where it was. Needs numpy, scipy, gpsindy, pysindy.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
import warnings
from pathlib import Path

from jobs import carried_on

METHODS = ("gpsindy", "gpsindy-trig", "pysindy", "pysindy-trig")
SAMPLES = 512
EMPTY = {"equations": None, "reconstruction": None, "generalisation": None}


def r2(predicted, true):
    """Variance-weighted coefficient of determination; minus infinity where something is not finite."""
    import numpy as np

    predicted = np.asarray(predicted, dtype=float)
    if predicted.shape != true.shape or not np.isfinite(predicted).all():
        return float("-inf")
    spread = ((true - true.mean(axis=0)) ** 2).sum()
    return float(1 - ((predicted - true) ** 2).sum() / max(spread, 1e-12))


def learn_gpsindy(x, t, trig):
    import gpsindy

    found = gpsindy.GPSINDy(trig=trig).fit(x, t)
    return found.equations(), found.simulate, bool(found.notes_) or found.poor_


def learn_pysindy(x, t, trig):
    model = pysindy_model(x, t, trig)
    return model.equations(), model.simulate, False


def pysindy_model(x, t, trig):
    """As it comes; with `trig` the library of `gpsindy-trig`, and the threshold that predicts the last quarter best."""
    import numpy as np
    import pysindy

    if not trig:
        model = pysindy.SINDy()
        model.fit(x, t=t)
        return model

    def fit(threshold, x, t):
        library = pysindy.PolynomialLibrary(degree=3) + pysindy.FourierLibrary(n_frequencies=1)
        slope = pysindy.SmoothedFiniteDifference()
        model = pysindy.SINDy(optimizer=pysindy.STLSQ(threshold), feature_library=library, differentiation_method=slope)
        model.fit(x, t=t)
        return model

    cut = 3 * len(t) // 4

    def error(threshold):
        try:
            held = fit(threshold, x[:cut], t[:cut]).simulate(x[cut], t[cut:] - t[cut])
            return float(((held - x[cut:]) ** 2).sum()) if held.shape == x[cut:].shape and np.isfinite(held).all() else np.inf
        except Exception:
            return np.inf

    return fit(min((0.01, 0.03, 0.1, 0.3, 1.0), key=error), x, t)


def job(system, noise, kept, method, results):
    """Learns one system by one method, in a process of its own."""
    import numpy as np

    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    seen, unseen = ((np.array(s["t"]), np.array(s["y"]).T) for s in system["solutions"][0][:2])
    t, true = seen
    generator = np.random.default_rng([system["id"], round(1000 * noise)])
    x = true * (1 + noise * generator.standard_normal(true.shape))
    rows = np.sort(generator.permutation(len(t))[: round(kept * len(t))])
    learn = learn_gpsindy if method.startswith("gpsindy") else learn_pysindy
    line = dict(EMPTY)
    try:
        line["equations"], simulate, line["noted"] = learn(x[rows], t[rows], method.endswith("trig"))
        for name, (times, truth) in (("reconstruction", seen), ("generalisation", unseen)):
            try:
                line[name] = r2(simulate(truth[0], times), truth)
            except Exception as failure:
                line[name], line["note"] = float("-inf"), f"{name}: {failure}"[:200]
    except Exception as failure:
        line["note"] = f"{type(failure).__name__}: {failure}"[:200]
    results.put({key: None if value == float("-inf") else value for key, value in line.items()})


def within(limit, job, empty, *arguments):
    """The job's line, or the empty one with a note that it took too long."""
    # The packages are loaded once, where the platform can copy a process; the time of a job is then its own.
    context = multiprocessing.get_context("forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn")
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload(["numpy", "gpsindy", "pysindy"])
    results = context.Queue()
    process = context.Process(target=job, args=(*arguments, results))
    started = time.monotonic()
    process.start()
    try:
        line = results.get(timeout=limit)
    except Exception:
        line = {**empty, "note": f"no answer within {limit} s"}
    process.terminate()
    process.join()
    return {**line, "seconds": round(time.monotonic() - started, 1)}


def table(lines):
    """Markdown: the share of systems above 0.9, by noise, samples and method."""
    rows = ["| noise | samples | method | systems | reconstruction | generalisation | median time, s |"]
    rows.append("| --- | --- | --- | --- | --- | --- | --- |")
    for noise, kept in sorted({(line["noise"], line["kept"]) for line in lines}, key=lambda level: (level[0], -level[1])):
        for method in METHODS:
            of = [line for line in lines if (line["noise"], line["kept"], line["method"]) == (noise, kept, method)]
            if not of:
                continue
            share = [sum((line[key] or 0) > 0.9 for line in of) / len(of) for key in ("reconstruction", "generalisation")]
            seconds = sorted(line["seconds"] for line in of)[len(of) // 2]
            samples = round(kept * SAMPLES)
            rows.append(f"| {noise:g} | {samples} | {method} | {len(of)} | {share[0]:.3f} | {share[1]:.3f} | {seconds:.1f} |")
    return "\n".join(rows)


def lines_at(levels, systems, asked, job, empty):
    """The lines of `systems` at every one of `levels`, dicts of what `job` gets, by every asked method; those that `asked.out` lacks are run."""
    jobs = (
        ({"system": system["id"], **level, "method": method}, system, level)
        for level in levels
        for system in systems
        for method in asked.methods
    )

    def run(about, system, level):
        found = within(asked.time_limit, job, empty, system, *level.values(), about["method"])
        return {"dimension": system["dim"], **found}

    lines = carried_on(asked.out, jobs, run)
    chosen = {system["id"] for system in systems}
    return [line for line in lines if line["system"] in chosen and line["method"] in asked.methods]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="the benchmark's strogatz_extended.json")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.05])
    parser.add_argument("--kept", type=float, nargs="+", default=[1.0], help="shares of the samples that are learnt from")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--systems", type=int, nargs="+", help="ids; default: all")
    parser.add_argument("--time-limit", type=float, default=300.0, help="s, of one fit with its simulations")
    parser.add_argument("--out", type=Path, default=Path("out/odebench.jsonl"))
    asked = parser.parse_args()
    # One thread a job, so that times can be compared.
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")
    systems = json.loads(asked.data.read_text(encoding="utf-8"))
    if asked.systems:
        systems = [system for system in systems if system["id"] in asked.systems]
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    levels = [{"noise": noise, "kept": kept} for noise in asked.noise for kept in asked.kept]
    print(table(lines_at(levels, systems, asked, job, EMPTY)))


if __name__ == "__main__":
    main()
