"""Diagnoses of drawn plants that are pushed at random: how many are called "no gap", with the random force named.

    python experiments/gusts.py 100 140
    python experiments/gusts.py 100 140 --loop

Each seed draws a plant (a cart on a spring, a boat under a rudder, a pendulum, a heater), its parameters, its controls in steps,
and an Ornstein-Uhlenbeck process in the row of its rate: a correlation time of 0.05 to 3 s and a strength of 6 to 60 % of the
control's. Five runs of 300 to 700 samples at 50 Hz, with noise of 0.1 to 2 % of each column's spread. The nominal model is right but
for the random force. With `--loop` a controller feeds the rate back, so that the control answers the force, and every parameter has a
tolerance of 5 %.
"""

import argparse

import numpy as np

import gpsindy

PLANTS = {
    "cart": (["x", "v"], ["v", "(u - k*x - b*v)/m"], {"m": (0.5, 2.0), "k": (1.0, 8.0), "b": (0.1, 1.0)}, (1.0, 3.0)),
    "boat": (["psi", "w"], ["w", "-a*w - c*w*abs(w) + g*u"], {"a": (0.2, 1.0), "c": (0.1, 0.6), "g": (0.5, 2.0)}, (0.3, 1.0)),
    "pendulum": (["th", "w"], ["w", "-g*sin(th) - b*w + u"], {"g": (5.0, 15.0), "b": (0.05, 0.5)}, (1.0, 4.0)),
    "heater": (["T"], ["-a*T + g*u"], {"a": (0.2, 1.0), "g": (1.0, 3.0)}, (1.0, 1.0)),
}
PERIOD, PARTS, RUNS = 0.02, 10, 5


def simulated(equations, names, values, u, start, push, random, feedback=0.0):
    """States at the samples, and the controls, under the commands `u` and a random force (deviation, time) in the last row."""
    code = [compile(text, "plant", "eval") for text in equations]
    scope = {"abs": abs, "sin": np.sin, **values}

    def rates(x, control, force):
        scope.update(zip(names, x), u=control)
        found = np.array([eval(c, {"__builtins__": {}}, scope) for c in code])
        found[-1] += force
        return found

    deviation, time = push
    h = PERIOD / PARTS
    kept = np.exp(-h / time)
    x, force = np.array(start, dtype=float), deviation * random.standard_normal()
    rows, controls = [], []
    for command in u:
        control = command - feedback * x[-1]
        rows.append(x.copy())
        controls.append(control)
        for _ in range(PARTS):
            after = force * kept + deviation * np.sqrt(1 - kept**2) * random.standard_normal()
            middle = 0.5 * (force + after)
            k1 = rates(x, control, force)
            k2 = rates(x + h / 2 * k1, control, middle)
            k3 = rates(x + h / 2 * k2, control, middle)
            k4 = rates(x + h * k3, control, after)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            force = after
    return np.array(controls), np.array(rows)


def read(names, runs, noise, random):
    """Logs of `runs`, each its controls and states, with noise of a share of each column's spread."""
    spread = np.concatenate([x for _, x in runs]).std(axis=0)
    logs = []
    for u, x in runs:
        measured = x + noise * spread * random.standard_normal(x.shape)
        logs.append({"t": PERIOD * np.arange(len(u)), **dict(zip(names, measured.T)), "u": u})
    return logs


def nominal(kind, values, more=""):
    """The model of a plant with these parameters; `more` lines belong to each of them."""
    names, equations, _, _ = PLANTS[kind]
    states = "".join(f'[[state]]\nname = "{n}"\nequation = "{e}"\n' for n, e in zip(names, equations))
    parameters = "".join(f'[[parameter]]\nname = "{n}"\nvalue = {v}\n{more}' for n, v in values.items())
    text = f'schema = "gpsindy.model/1"\nname = "{kind}"\n{states}[[control]]\nname = "u"\n{parameters}'
    return gpsindy.Model.from_toml(text)


def case(seed, loop):
    """A nominal model, five runs, and the random force that was drawn."""
    random = np.random.default_rng(seed)
    kind = list(PLANTS)[seed % len(PLANTS)]
    names, equations, ranges, amplitudes = PLANTS[kind]
    values = {name: random.uniform(*bounds) for name, bounds in ranges.items()}
    amplitude = random.uniform(*amplitudes)
    count = int(random.integers(300, 700))
    time, noise = 10 ** random.uniform(-1.3, 0.5), 10 ** random.uniform(-3, -1.7)
    deviation = amplitude * 10 ** random.uniform(-1.2, -0.2)
    feedback = np.random.default_rng([seed, 1]).uniform(0.3, 1.0) if loop else 0.0
    runs = []
    for _ in range(RUNS):
        steps = np.repeat(random.uniform(-1, 1, count), random.integers(10, 80, count))[:count]
        start = [0.3 * random.standard_normal()] + [0.0] * (len(names) - 1)
        runs.append(simulated(equations, names, values, amplitude * steps, start, (deviation, time), random, feedback))
    model = nominal(kind, values, "tolerance = 0.05\n" if loop else "")
    return model, read(names, runs, noise, random), names[-1], deviation, time


def main(first, last, loop):
    right, inside, stated = 0, 0, 0
    for seed in range(first, last):
        model, logs, row, deviation, time = case(seed, loop)
        found = gpsindy.diagnose(model, logs[:-1], holdout=logs[-1:])
        named = [c for c in found.included if c.effect == "process_noise"]
        is_right = found.verdict == "explained" and [c.state for c in named] == [row]
        right += is_right
        words = f"{seed} {model.name}: {found.verdict}"
        if is_right:
            sizes = {p["name"]: p for p in named[0].parameters}
            for name, truth in (("rms", deviation), ("tau", time)):
                size = sizes[name]
                stated += 1
                value, low, high = (size[key] for key in ("value", "low", "high"))
                inside += low <= truth <= high
                words += f", {name} {value:.3g} ({low:.3g} to {high:.3g}), true {truth:.3g}"
        print(words, flush=True)
    print(f"{right} of {last - first} right; {inside} of {stated} sizes within their intervals")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--loop", action="store_true")
    given = parser.parse_args()
    main(given.first, given.last, given.loop)
