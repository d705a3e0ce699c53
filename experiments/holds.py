"""Diagnoses of drawn carts whose controller or sensor is slower than the log: how often the hold is named, with its period.

    python experiments/holds.py 200 232

Each seed draws a cart on a spring, four sines as its control, and by turns a position sensor that is sampled and held with noise on
every row of the log, one whose noise is held with the value, a controller whose commands are sampled and held, and no hold at all.
Periods are 2.5 to 12 samples of the log, six in ten of them whole. Five runs of 600 samples at 50, 100 or 200 Hz, with noise of
0.3 % of each column's spread.
"""

import sys

import numpy as np

import gpsindy

KINDS = ["sensor_hold", "sensor_hold, noise held", "input_hold", "none"]
COUNT, RUNS, NOISE, PARTS = 600, 5, 0.003, 10


def last_sampled(t, period):
    return np.floor(t / period + 1e-9) * period


def simulated(stiffness, damping, u, step, start):
    """Position and velocity at the samples under the control `u(t)`, and their rates."""

    def rates(x, control):
        return np.array([x[1], control - damping * x[1] - stiffness * x[0]])

    h, x, rows = step / PARTS, np.array(start), []
    for i in range(COUNT):
        rows.append(x)
        for k in range(PARTS):
            control = u(i * step + (k + 0.5) * h)
            k1 = rates(x, control)
            k2 = rates(x + h / 2 * k1, control)
            k3 = rates(x + h / 2 * k2, control)
            k4 = rates(x + h * k3, control)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(rows)


def between(t, step, values, rates):
    """Cubic interpolation of samples by their values and rates."""
    i = np.minimum((t / step + 1e-9).astype(int), COUNT - 2)
    s = t / step - i
    return (
        (2 * s**3 - 3 * s**2 + 1) * values[i]
        + (s**3 - 2 * s**2 + s) * step * rates[i]
        + (3 * s**2 - 2 * s**3) * values[i + 1]
        + (s**3 - s**2) * step * rates[i + 1]
    )


def case(seed):
    """A nominal model, five runs, what holds and with which period."""
    random = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    step = random.choice([0.005, 0.01, 0.02])
    stiffness, damping = random.uniform(3, 30), random.uniform(0.1, 1.5)
    period = step * (random.integers(3, 12) if random.random() < 0.6 else random.uniform(2.5, 12))
    t = step * np.arange(COUNT)
    runs = []
    for _ in range(RUNS):
        speed, phase, size = random.uniform(1, 8, 4), random.uniform(0, 2 * np.pi, 4), random.uniform(0.5, 2, 4)
        u = (size * np.sin(np.outer(t, speed) + phase)).sum(axis=1)

        def acts(now, u=u):
            now = last_sampled(now, period) if kind == "input_hold" else now
            return u[min(int(now / step + 1e-6), COUNT - 1)]

        runs.append((u, simulated(stiffness, damping, acts, step, 0.3 * random.standard_normal(2))))
    noise = NOISE * np.concatenate([x for _, x in runs]).std(axis=0)
    logs = []
    for u, x in runs:
        errors = noise * random.standard_normal(x.shape)
        shown = x.copy()
        if kind.startswith("sensor"):
            shown[:, 0] = between(last_sampled(t, period), step, x[:, 0], x[:, 1])
        if kind.endswith("held"):
            errors[:, 0] = errors[np.round(last_sampled(t, period) / period).astype(int), 0]
        logs.append({"t": t, "x": shown[:, 0] + errors[:, 0], "v": shown[:, 1] + errors[:, 1], "u": u})
    text = f"""
    name = "cart"
    state = [{{ name = "x", equation = "v" }}, {{ name = "v", equation = "u - d*v - k*x" }}]
    control = [{{ name = "u" }}]
    parameter = [
        {{ name = "k", value = {stiffness}, tolerance = 0.02 }}, {{ name = "d", value = {damping}, tolerance = 0.05 }},
    ]
    """
    return gpsindy.Model.from_toml(text), logs, kind, period


def main(first, last):
    right, near = 0, 0
    for seed in range(first, last):
        model, logs, kind, period = case(seed)
        found = gpsindy.diagnose(model, logs[:-1], holdout=logs[-1:])
        named = [cause.effect for cause in found.included]
        if kind == "none":
            is_right = found.verdict == "no_gap"
        else:
            is_right = found.verdict == "explained" and named[:1] == [kind.split(",")[0]]
        right += is_right
        words = f"{seed} {kind}: {found.verdict} {named}"
        if is_right and named:
            size = found.included[0].parameters[0]
            near += size["low"] <= period <= size["high"]
            words += f", T {size['value']:.5f} ({size['low']:.5f} to {size['high']:.5f}), true {period:.5f}"
        print(words, flush=True)
    print(f"{right} of {last - first} right; {near} periods within their intervals")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
