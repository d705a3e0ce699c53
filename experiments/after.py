"""Ranges and consequences of diagnoses of drawn plants, against the plants themselves.

    python experiments/after.py 0 40

Each seed draws a plant of `gusts.py`, its parameters and its controls in steps. One parameter of the nominal model is off by 10 to 40 %;
in every third plant the control also comes late by two to five samples. Four runs of 400 samples at 50 Hz, the last held out, with noise
of 0.1 to 2 % of each column's spread.

Counted are: true values inside the ranges of `randomization()`, and how wide those that the logs identify are beside the prior ones; and
what `consequence()` says a controller pays for the gap, beside what it pays on the plant, which is stepped here.
"""

import argparse

import numpy as np
from gusts import PARTS, PERIOD, PLANTS, nominal, read

import gpsindy

SAMPLES, RUNS = 400, 4
TIMES = PERIOD * np.arange(200)
"""When the controller speaks, s."""


class Plant:
    """A plant that is stepped here, with its control late by some samples."""

    def __init__(self, kind, values, late):
        self.names, equations, _, _ = PLANTS[kind]
        self.code = [compile(text, "plant", "eval") for text in equations]
        self.scope = {"__builtins__": {}, "abs": abs, "sin": np.sin, **values}
        self.late = late

    def rates(self, x, control):
        self.scope.update(zip(self.names, x), u=control)
        return np.array([eval(code, self.scope) for code in self.code])

    def run(self, start, count, command):
        """The commands `command(i, x)`, held over a sample, and the states at the samples."""
        x, rows, commands = np.array(start, dtype=float), [], []
        h = PERIOD / PARTS
        for i in range(count):
            rows.append(x.copy())
            commands.append(command(i, x))
            control = commands[max(i - self.late, 0)]
            for _ in range(PARTS):
                k1 = self.rates(x, control)
                k2 = self.rates(x + h / 2 * k1, control)
                k3 = self.rates(x + h / 2 * k2, control)
                k4 = self.rates(x + h * k3, control)
                x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return np.array(commands), np.array(rows)


def drawn(seed):
    """A nominal model, the true values, the plant and its logs."""
    random = np.random.default_rng([seed, 7])
    kind = list(PLANTS)[seed % len(PLANTS)]
    names, _, ranges, amplitudes = PLANTS[kind]
    true = {name: random.uniform(*bounds) for name, bounds in ranges.items()}
    wrong = str(random.choice(list(true)))
    off = random.choice([-1, 1]) * random.uniform(0.1, 0.4)
    believed = {name: value / (1 + off) if name == wrong else value for name, value in true.items()}
    plant = Plant(kind, true, int(random.integers(2, 6)) if seed % 3 == 2 else 0)
    amplitude, noise = random.uniform(*amplitudes), 10 ** random.uniform(-3, -1.7)
    runs = []
    for _ in range(RUNS):
        steps = amplitude * np.repeat(random.uniform(-1, 1, SAMPLES), random.integers(10, 80, SAMPLES))[:SAMPLES]
        start = [0.3 * random.standard_normal()] + [0.0] * (len(names) - 1)
        runs.append(plant.run(start, SAMPLES, lambda i, x, steps=steps: steps[i]))
    return nominal(kind, believed), true, wrong, plant, read(names, runs, noise, random), amplitude


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    given = parser.parse_args()
    inside, identified, delays, widths, costs = [], [], [], [], []
    for seed in range(given.first, given.last):
        model, true, wrong, plant, logs, amplitude = drawn(seed)
        found = gpsindy.diagnose(model, logs[:-1], holdout=logs[-1:], hold="zero")
        ranges = found.randomization()
        for one in ranges.ranges:
            holds = one.low <= true[one.name] <= one.high
            (identified if one.identified else inside).append(holds)
            if one.identified:
                widths.append((one.high - one.low) / (2 * 0.3 * one.nominal))
        if plant.late:
            delays.extend(one.low <= plant.late * PERIOD <= one.high for one in ranges.delays)

        def controller(t, y, amplitude=amplitude):
            return [float(np.clip(2 * amplitude * (0.2 - y[0]) - 0.5 * amplitude * (y[1] if len(y) > 1 else 0.0), -amplitude, amplitude))]

        start = dict.fromkeys(plant.names, 0.0)
        said = gpsindy.consequence(found, controller, lambda loop: np.mean((loop[plant.names[0]] - 0.2) ** 2), t=TIMES, start=start)
        _, x = plant.run([0.0] * len(plant.names), len(TIMES), lambda i, x: controller(0.0, x)[0])
        paid = float(np.mean((x[:, 0] - 0.2) ** 2))
        costs.append((said.nominal, said.corrected, paid))
        names = ", ".join(f"{cause.effect} {'/'.join(cause.variables)}" for cause in found.included)
        print(f"{seed} {wrong}{' late' if plant.late else ''} | {found.verdict}: {names}; costs {said.nominal:.4g} nominal, {said.corrected:.4g} corrected, {paid:.4g} on the plant", flush=True)  # fmt: skip
    before, corrected, paid = np.array(costs).T
    gap = np.abs(before - paid)
    print(f"identified: {sum(identified)} of {len(identified)} hold the true value, median width {np.median(widths):.3f} of the prior range")
    print(f"bounded or prior: {sum(inside)} of {len(inside)} hold it; delays: {sum(delays)} of {len(delays)}")
    print(f"cost of the controller: {np.sum(np.abs(corrected - paid) < 0.1 * gap)} of {len(gap)} are known to a tenth of what the gap costs")


if __name__ == "__main__":
    main()
