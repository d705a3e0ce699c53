"""Drawn systems with and without rates that saturate: how many keep polynomials, how many get their `x/(h + x)`.

    python experiments/saturating.py 100 140
    python experiments/saturating.py 100 140 --rational

Each seed draws one or two states that stay positive: growth, a limit to it (the capacity), a loss and, with two states, a
predator. With `--rational` what is lost or eaten saturates, by x/(h + x) or x^2/(h^2 + x^2), h between 0.1 and 1.5 of the
capacity. 300 samples over 30 time units from a drawn start, with white noise of 0, 0.01, 0.1 or 1 % of each state's
spread. Systems whose states rest, leave 0.001 to 1000, or hardly move are drawn again.

Needs numpy, scipy and the program `gpsindy`; the variable GPSINDY names another one.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

NOISE = (0.0, 1e-4, 1e-3, 1e-2)
SECONDS, SAMPLES = 30.0, 300


def drawn(random, rational):
    """Right side, start, and the true half-saturation."""
    two = random.random() < 0.5
    r, k, a = random.uniform(0.5, 2), random.uniform(1, 4), random.uniform(0.3, 1.5)
    h, order = k * random.uniform(0.1, 1.5), random.integers(1, 3)

    def rate(x):
        return x**order / (h**order + x**order) if rational else x

    if two:
        gain, death = random.uniform(0.4, 1.2), random.uniform(0.1, 0.6)

        def side(t, x):
            eaten = a * rate(x[0]) * x[1]
            return [r * x[0] * (1 - x[0] / k) - eaten, gain * eaten - death * x[1]]
    else:
        inflow = random.uniform(0.05, 0.5)

        def side(t, x):
            return [inflow + 0.2 * r * x[0] * (1 - x[0] / k) - a * rate(x[0])]

    return side, k * random.uniform(0.1, 1.2, 2 if two else 1), h


def log_of(seed, rational):
    """Times, samples with noise, the noise as a share of the spread, and the half-saturation."""
    random = np.random.default_rng([seed, int(rational)])
    while True:
        side, start, h = drawn(random, rational)
        t = np.linspace(0, SECONDS, SAMPLES)
        found = solve_ivp(side, (0, SECONDS), start, t_eval=t, rtol=1e-10, atol=1e-12)
        x = found.y.T
        if len(x) == SAMPLES and x.min() > 1e-3 and x.max() < 1e3 and (x.std(axis=0) > 0.1 * x.max(axis=0)).all():
            break
    noise = NOISE[random.integers(len(NOISE))]
    return t, x + noise * x.std(axis=0) * random.standard_normal(x.shape), noise, h


def identified(t, x):
    names = "xy"[: x.shape[1]]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        rows = [",".join(["t", *names])] + [",".join(f"{v:.12g}" for v in (time, *row)) for time, row in zip(t, x)]
        log.write_text("\n".join(rows) + "\n", encoding="utf-8")
        command = [os.environ.get("GPSINDY", "gpsindy"), "identify", str(log), "--threads", "1", "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("end", type=int)
    parser.add_argument("--rational", action="store_true", help="what is lost or eaten saturates")
    asked = parser.parse_args()
    counts = {}
    for seed in range(asked.first, asked.end):
        t, x, noise, h = log_of(seed, asked.rational)
        status, found = identified(t, x)
        numbers = {one["name"]: one["value"] for one in found["model"].get("parameter", [])}
        error = min((abs(value / h - 1) for value in numbers.values()), default=None)
        is_grown = any("larger library" in note for note in found["notes"])
        kind = "saturating" if numbers else "other" if is_grown else "polynomial"
        of = counts.setdefault(noise, {})
        of[kind] = of.get(kind, 0) + 1
        if error is not None and error < 0.05:
            of["within 5 %"] = of.get("within 5 %", 0) + 1
        equations = "; ".join(state["equation"] for state in found["model"]["state"])
        print(f"{seed}: noise {noise:g}, h {h:.4g}, status {status}, {kind}, {numbers}: {equations[:200]}", flush=True)
    for noise, of in sorted(counts.items()):
        print(f"noise {noise:g}: {of}")


if __name__ == "__main__":
    main()
