"""Diagnoses of drawn machines whose dry friction holds them at rest: how many have the right friction named in the right joint.

    python experiments/sticking.py 100 120

Each seed draws a machine (a drive with its speed, a stage on a spring, an arm of two coupled joints with ports and gravity), its
parameters, its controls (a sine and steps), and dry friction in one joint that truly holds: a level in motion of 15 to 50 % of what
drives the joint, and for two seeds of five a level at rest that is 1.3 to 2 times as high. Five runs of 300 to 500 samples at 50 Hz,
with noise of 0.1 to 1 % of each column's spread. The machines are integrated in short steps, each of which solves for the force of
the friction; the nominal model is right but for it.
"""

import math
import sys

import numpy as np

import gpsindy

PERIOD, PARTS, RUNS = 0.02, 40, 5
SINGLE = {
    "drive": (["w"], ["(u - d*w)/m"], {"m": (0.05, 0.2), "d": (0.02, 0.1)}),
    "stage": (["x", "w"], ["w", "(u - k*x - d*w)/m"], {"m": (0.5, 2.0), "k": (0.5, 3.0), "d": (0.05, 0.3)}),
}
ARM = {"m1": (0.8, 1.5), "m2": (0.3, 0.6), "h": (0.15, 0.25), "g1": (3.0, 6.0), "g2": (1.0, 2.0), "d": (0.05, 0.2)}


def held(speed, free, inertia, step, levels):
    """Speed after a step in which friction of (level in motion, level at rest) acts beside what leads to the free speed."""
    slides, holds = levels
    slowed = free - math.copysign(step * slides / inertia, speed)
    if speed != 0.0 and slowed * speed > 0.0:
        return slowed
    # It is at rest, or comes to rest within the step.
    if abs(free - speed) * inertia <= step * holds:
        return 0.0
    return math.copysign(max(abs(free) - step * slides / inertia, 0.0), free)


def single(values, u, x, levels):
    """Rows (x, w) of a machine with one joint."""
    m, k, d = values["m"], values.get("k", 0.0), values["d"]
    h, w, rows = PERIOD / PARTS, 0.0, []
    for control in u[:, 0]:
        rows.append((x, w))
        for _ in range(PARTS):
            free = w + h * (control - k * x - d * w) / m
            w = held(w, free, m, h, levels)
            x += h * w
    return np.array(rows)


def arm(values, u, q, joint, levels):
    """Rows (q1, q2, v1, v2) of the arm, with friction in `joint`."""
    m1, m2, b, g1, g2, d = (values[name] for name in ARM)
    h, q, v, rows = PERIOD / PARTS, list(q), [0.0, 0.0], []
    for control in u:
        rows.append((*q, *v))
        for _ in range(PARTS):
            c, s = math.cos(q[1]), math.sin(q[1])
            a11, a12, a22 = m1 + m2 + 2 * b * c, m2 + b * c, m2
            weight = g2 * math.cos(q[0] + q[1])
            t1 = control[0] - d * v[0] - g1 * math.cos(q[0]) - weight + b * s * (2 * v[0] * v[1] + v[1] ** 2)
            t2 = control[1] - d * v[1] - weight - b * s * v[0] ** 2
            det = a11 * a22 - a12 * a12
            free = [v[0] + h * (a22 * t1 - a12 * t2) / det, v[1] + h * (a11 * t2 - a12 * t1) / det]
            own = (a22 if joint == 0 else a11) / det
            after = held(v[joint], free[joint], 1 / own, h, levels)
            impulse = (after - free[joint]) / own
            free[1 - joint] -= a12 / det * impulse
            free[joint] = after
            v = free
            q = [q[0] + h * v[0], q[1] + h * v[1]]
    return np.array(rows)


def controls(random, time, amplitudes):
    """A sine and steps for every control."""
    columns = []
    for amplitude in amplitudes:
        f, phase = random.uniform(0.15, 0.5), random.uniform(0, 2 * np.pi)
        steps = np.repeat(random.uniform(-1, 1, len(time)), random.integers(20, 90, len(time)))[: len(time)]
        columns.append(amplitude * (0.7 * np.sin(2 * np.pi * f * time + phase) + 0.5 * steps))
    return np.stack(columns, axis=1)


def text_of(kind, states, equations, names, values, ports=""):
    rows = "".join(f'[[state]]\nname = "{n}"\nequation = "{e}"\n' for n, e in zip(states, equations))
    inputs = "".join(f'[[control]]\nname = "{n}"\n' for n in names)
    parameters = "".join(f'[[parameter]]\nname = "{n}"\nvalue = {v}\n' for n, v in values.items())
    return f'schema = "gpsindy.model/1"\nname = "{kind}"\n{rows}{inputs}{ports}{parameters}'


def arm_text(values):
    weight = "g2*cos(q1 + q2)"
    t1 = f"(u1 + f1 - d*v1 - g1*cos(q1) - {weight} + h*sin(q2)*(2*v1*v2 + v2^2))"
    t2 = f"(u2 + f2 - d*v2 - {weight} - h*sin(q2)*v1^2)"
    a11, a12, a22 = "(m1 + m2 + 2*h*cos(q2))", "(m2 + h*cos(q2))", "m2"
    det = f"({a11}*{a22} - {a12}^2)"
    equations = ["v1", "v2", f"({a22}*{t1} - {a12}*{t2})/{det}", f"({a11}*{t2} - {a12}*{t1})/{det}"]
    ports = "".join(f'[[port]]\nname = "f{i}"\nvariable = "v{i}"\nposition = "q{i}"\n' for i in (1, 2))
    return text_of("arm", ["q1", "q2", "v1", "v2"], equations, ["u1", "u2"], values, ports)


def case(seed):
    """A nominal model, five runs, the joint with friction, its place, and the levels in the unit of the effect."""
    random = np.random.default_rng(seed)
    kind = ["drive", "stage", "arm"][seed % 3]
    ranges = ARM if kind == "arm" else SINGLE[kind][2]
    values = {name: float(f"{random.uniform(*bounds):.4g}") for name, bounds in ranges.items()}
    count, noise = int(random.integers(300, 500)), 10 ** random.uniform(-3, -2)
    time = PERIOD * np.arange(count)
    joint = int(random.integers(2)) if kind == "arm" else 0
    amplitudes = [random.uniform(4, 7), random.uniform(1.5, 3)] if kind == "arm" else [random.uniform(0.7, 2.0)]
    slides = amplitudes[joint] * random.uniform(0.15, 0.5)
    holds = slides * (random.uniform(1.3, 2.0) if random.random() < 0.4 else 1.0)
    runs = []
    for _ in range(RUNS):
        u = controls(random, time, amplitudes)
        if kind == "arm":
            start = [-np.pi / 2 + 0.3 * random.standard_normal(), 0.3 * random.standard_normal()]
            x = arm(values, u, start, joint, (slides, holds))
        else:
            x = single(values, u, 0.3 * random.standard_normal(), (slides, holds))
        runs.append((u, x))
    if kind == "arm":
        model, states, row = arm_text(values), ["q1", "q2", "v1", "v2"], f"v{joint + 1}"
        place, unit = f"f{joint + 1}", 1.0
    else:
        states, equations, _ = SINGLE[kind]
        model, row = text_of(kind, states, equations, ["u"], values), "w"
        runs = [(u, x[:, -len(states) :]) for u, x in runs]
        place, unit = None, values["m"]
    spread = np.concatenate([x for _, x in runs]).std(axis=0)
    names = ["u1", "u2"] if kind == "arm" else ["u"]
    logs = []
    for u, x in runs:
        measured = x + noise * spread * random.standard_normal(x.shape)
        logs.append({"t": time, **dict(zip(states, measured.T)), **dict(zip(names, u.T))})
    return gpsindy.Model.from_toml(model), logs, (row, place), (slides / unit, holds / unit)


def main(first, last):
    right, placed, explained, inside = 0, 0, 0, 0
    for seed in range(first, last):
        model, logs, (row, place), (slides, holds) = case(seed)
        found = gpsindy.diagnose(model, logs[:-1], holdout=logs[-1:])
        wanted = {"coulomb_friction"} if slides == holds else {"stiction", "stribeck_friction"}
        named = [c for c in found.included if c.effect in wanted]
        is_right = len(found.included) == 1 and len(named) == 1
        right += is_right
        is_placed = is_right and (named[0].place == place if place else row in named[0].variables)
        placed += is_placed
        explained += found.verdict == "explained"
        words = f"{seed} {model.name}: {found.verdict}, {'right' if is_placed else 'WRONG'}; true c {slides:.4g}, s {holds:.4g}"
        for cause in found.included:
            stated = ", ".join(f"{p['name']} {p['value']:.4g} ({p['low']} to {p['high']})" for p in cause.parameters)
            words += f"; {cause.effect} {cause.place or cause.state} {cause.probability:.2f}: {stated}"
            level = cause.parameters[0]
            if is_placed and level["low"] is not None:
                inside += level["low"] <= slides <= level["high"]
        print(words, flush=True)
    count = last - first
    print(f"{right} of {count} have the right effect and no other, {placed} in the right joint, {explained} explained;")
    print(f"the level in motion within its interval in {inside} of {placed}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
