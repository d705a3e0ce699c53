"""Measured systems of nonlinearbenchmark.org: equations from the training log, judged by free runs over the test log.

    python benches/public/nonlinear.py --data FOLDER [--methods gpsindy pysindy] [--systems emps silverbox tanks]

The data are read from your copy and not shipped. FOLDER holds, as CSV with `t` in s:

    emps/train.csv, emps/test_pulses.csv              t, q [m], u [V]            every tenth sample is used
    silverbox/multisine.csv, silverbox/arrow.csv      t, y [V], u [V]            trained on the multisine
    tanks/train.csv, tanks/test.csv                   t, y [V], u [V]            level of the lower tank, voltage of the pump

Every method is given the same structure: the position and its unlogged velocity, with the terms named below; it gets no
starting values. A free run sees the inputs and the first state alone. Error: root mean square over the whole test log, in
the unit of the table.

Methods: `gpsindy`, the command line as it comes; `gpsindy-structure`, with the physical structure of the system and every number in it
free, for the tanks alone: the upper level is not logged; `pysindy`, degree and terms the same, the velocity and the derivatives
from smoothed differences, the threshold of the best free run over the last quarter of the training log,
classical Runge-Kutta with a step a sample.

A line a job stands in `--out`; a run that was interrupted goes on where it was. Needs numpy; pysindy for the peer.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import tempfile
import warnings
from pathlib import Path

from jobs import carried_on

METHODS = ("gpsindy", "gpsindy-structure", "pysindy")
# Files, the position, every so many samples, degree of the library, further terms, factor and unit of the error.
SYSTEMS = {
    "emps": ("train", "test_pulses", "q", 10, 1, ("sign(w)",), 1e3, "mm"),
    "silverbox": ("multisine", "arrow", "y", 1, 3, (), 1e3, "mV"),
    "tanks": ("train", "test", "y", 1, 3, (), 1.0, "V"),
}

# What is known of a system: its states, the range of its sensor, and equations whose numbers are free within ranges.
STRUCTURES = {
    "tanks": {
        "--state": ("y,h",),
        "--range": ("y=:10",),
        "--free": ("b=0.01:1,d=0:20,m=0.001:1,c=0.1:100,k=0.0001:1,a=-0.1:0.1,q=0.001:1,e=0.001:1,r=0:1",),
        "--fix": (
            "y' = sqrt(max(h, 0)) - b*sqrt(max(y + d, 0)) + c*max(h - m, 0) - r*max(y - 10, 0)",
            "h' = k*u + a - q*sqrt(max(h, 0)) - e*max(h - m, 0)",
        ),
    }
}


def read(path, position, stride):
    """Time, position and input of every `stride`-th sample."""
    import numpy as np

    lines = path.read_text(encoding="utf-8").splitlines()
    header = [name.split("[")[0].strip() for name in lines[0].split(",")]
    columns = [header.index(name) for name in ("t", position, "u")]
    rows = np.array([[float(line.split(",")[c]) for c in columns] for line in lines[1::stride]])
    return rows[:, 0], rows[:, 1], rows[:, 2]


def write(path, names, columns):
    rows = [",".join(names)] + [",".join(f"{value:.12g}" for value in row) for row in zip(*columns)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def run_gpsindy(train, test, position, options):
    import numpy as np

    program = os.environ.get("GPSINDY", "gpsindy")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder / "train.csv", ("t", position, "u"), train)
        write(folder / "test.csv", ("t", position, "u"), test)
        command = [program, "identify", "train.csv", "--control", "u", *options, "--threads", "1", "--json", "--out", "model.toml"]
        learnt = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if not learnt.stdout.strip():
            raise RuntimeError(learnt.stderr.strip()[-300:])
        found = json.loads(learnt.stdout)
        command = [program, "simulate", "model.toml", "--data", "test.csv", "--hold", found["hold"]]
        rolled = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        about = {"status": learnt.returncode, "hold": found["hold"], "notes": found["notes"]}
        about["equation"] = found["model"]["state"][1]["equation"]
        if rolled.returncode:
            return None, {**about, "note": rolled.stderr.strip()[-200:]}
        lines = rolled.stdout.splitlines()
        place = lines[0].split(",").index(position)
        return np.array([float(line.split(",")[place]) for line in lines[1:]]), about


def as_it_comes(position, degree, terms):
    """The options that give the position and its unlogged velocity."""
    options = ["--state", f"{position},w", "--fix", f"{position}' = w", "--degree", str(degree)]
    return options + [part for term in terms for part in ("--term", term)]


def structure(system):
    """The options that give all that is known of `system`."""
    return [part for option, values in STRUCTURES[system].items() for value in values for part in (option, value)]


def run_pysindy(train, test, position, degree, terms):
    import numpy as np
    import pysindy
    smoothed = pysindy.SmoothedFiniteDifference()
    library = pysindy.PolynomialLibrary(degree=degree)
    if terms:
        library = library + pysindy.CustomLibrary([lambda value: np.sign(value)], [lambda name: f"sign({name})"])

    def fit(threshold, t, q, u):
        w = smoothed._differentiate(q[:, None], t)
        model = pysindy.SINDy(
            optimizer=pysindy.STLSQ(threshold=threshold), feature_library=library, differentiation_method=smoothed
        )
        model.fit(np.column_stack([q, w[:, 0]]), t=t, u=u)
        return model

    def free_run(model, t, q, u):
        # As PySINDy prints it, so that forty thousand samples take seconds.
        parts = zip(model.coefficients()[1], model.get_feature_names())
        text = "+".join(f"{c!r}*{name.replace(' ', '*').replace('^', '**')}" for c, name in ((float(c), n) for c, n in parts) if c) or "0.0"
        rate = eval(f"lambda x0, x1, u0: {text}", {"sign": lambda value: (value > 0) - (value < 0)})
        path, x = [float(q[0])], (float(q[0]), float(smoothed._differentiate(q[:50, None], t[:50])[0, 0]))
        for step, (now, after) in zip(np.diff(t).tolist(), zip(u.tolist(), u[1:].tolist())):
            middle, slopes = (now + after) / 2, []
            for share, control in ((0.0, now), (0.5, middle), (0.5, middle), (1.0, after)):
                z = tuple(v + share * step * slope for v, slope in zip(x, slopes[-1] if slopes else (0.0, 0.0)))
                slopes.append((z[1], rate(*z, control)))
            x = tuple(v + step / 6 * (a + 2 * b + 2 * c + d) for v, a, b, c, d in zip(x, *slopes))
            if not abs(x[0]) < 1e6:
                return None
            path.append(x[0])
        return np.array(path)

    cut = 3 * len(train[0]) // 4

    def error(threshold):
        try:
            rest = [column[cut : cut + 2000] for column in train]
            found = free_run(fit(threshold, *(column[:cut] for column in train)), *rest)
            return float(((found - rest[1]) ** 2).sum())
        except Exception:
            return np.inf

    model = fit(min((0.001, 0.01, 0.1, 1.0), key=error), *train)
    return free_run(model, *test), {"equation": model.equations()[1]}


def job(folder, system, method):
    import numpy as np

    train_name, test_name, position, stride, degree, terms, factor, unit = SYSTEMS[system]
    train = read(folder / f"{train_name}.csv", position, stride)
    test = read(folder / f"{test_name}.csv", position, stride)
    begun = processor_time()
    try:
        if method == "pysindy":
            found, about = run_pysindy(train, test, position, degree, terms)
        else:
            options = as_it_comes(position, degree, terms) if method == "gpsindy" else structure(system)
            found, about = run_gpsindy(train, test, position, options)
        usable = found is not None and np.isfinite(found).all()
        about["error"] = factor * float(np.sqrt(np.mean((found - test[1]) ** 2))) if usable else None
        about["mean"] = factor * float(test[1].std())
    except Exception as failure:
        about = {"error": None, "note": f"{type(failure).__name__}: {failure}"[:300]}
    return {**about, "unit": unit, "processor": round(processor_time() - begun, 1)}


def processor_time():
    return sum(
        use.ru_utime + use.ru_stime for use in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def table(lines):
    rows = [
        "| system | method | error of the free run | of the mean | status | processor time, s |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for line in lines:
        error = "diverges or fails" if line["error"] is None else f"{line['error']:.3g} {line['unit']}"
        mean = f"{line['mean']:.3g} {line['unit']}" if "mean" in line else "-"
        status = line.get("status", "-")
        rows.append(f"| {line['system']} | {line['method']} | {error} | {mean} | {status} | {line['processor']:.1f} |")
    return "\n".join(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="the folder with your copy of the data")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--systems", nargs="+", choices=list(SYSTEMS), help="default: those that FOLDER holds")
    parser.add_argument("--out", type=Path, default=Path("out/nonlinear.jsonl"))
    asked = parser.parse_args()
    if any(method.startswith("gpsindy") for method in asked.methods) and not shutil.which(os.environ.get("GPSINDY", "gpsindy")):
        parser.error("the program `gpsindy` is not on the path; name it in the variable GPSINDY")
    warnings.simplefilter("ignore")
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    systems = asked.systems or [name for name in SYSTEMS if (asked.data / name).is_dir()]
    jobs = (
        ({"system": system, "method": method},)
        for system in systems
        for method in asked.methods
        if method != "gpsindy-structure" or system in STRUCTURES
    )
    lines = carried_on(asked.out, jobs, lambda about: job(asked.data / about["system"], **about))
    print(table(lines))


if __name__ == "__main__":
    main()
