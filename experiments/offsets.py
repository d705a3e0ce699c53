"""Offsets of clocks estimated on drawn plants: in how many the 95 % interval holds the truth, and how wide it is.

    pip install ./crates/gpsindy-py numpy mcap
    python experiments/offsets.py 3000 3020

Each seed draws, for each kind of plant (a cart on a hardening spring, a boat under a rudder), its parameters, 30 s of commands in steps
at 50 Hz, states at 100 Hz, a second sensor of the speed at 200 Hz with a scale, a bias and noise of its own, jitter of a tenth of each
period, and the offset of one clock of up to 0.4 s: once that of the commands, once that of the second sensor. The log is MCAP with
messages in JSON; `offset={TOPIC: "auto"}` estimates.
"""

import json
import pathlib
import re
import sys
import tempfile
import warnings

import numpy as np
from mcap.writer import Writer

import gpsindy

STEP, SECONDS = 1e-3, 30.0
PLANTS = {
    "cart": (lambda p, x, v, u: (u - p["k"] * x - p["h"] * x**3 - p["b"] * v) / p["m"], {"m": (0.5, 2.0), "k": (2.0, 12.0), "h": (0.0, 6.0), "b": (0.1, 1.5)}),
    "boat": (lambda p, x, v, u: p["g"] * u - p["a"] * v - p["c"] * v * abs(v), {"g": (0.5, 2.0), "a": (0.2, 1.5), "c": (0.1, 0.8)}),
}
TOPICS = {"/state": ("x", "v"), "/command": ("u",), "/gyro": ("w",)}
TOLD = re.compile(r": (\S+) s were added .* \((\S+) to (\S+) at 95 %\)")


def drawn(kind: str, seed: int) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    """The topics of a log with their stamps, s, on one clock, and their columns."""
    random = np.random.default_rng([seed, list(PLANTS).index(kind)])
    rate, ranges = PLANTS[kind]
    p = {name: random.uniform(*limits) for name, limits in ranges.items()}

    def stamps(period: float) -> np.ndarray:
        count = int(SECONDS / period)
        return random.uniform(0, period) + period * (np.arange(count) + 0.1 * random.random(count))

    # Commands come with a step of the integration: between two they would act late.
    command, state, gyro = stamps(0.02).round(3), stamps(0.01), stamps(0.005)
    u = np.concatenate([np.full(random.integers(3, 30), random.normal(0, 2)) for _ in range(len(command))])[: len(command)]
    x, v, k, path = random.normal(), 0.0, 0, []
    for i in range(round((SECONDS + 1) / STEP)):
        path.append((x, v))
        while k + 1 < len(command) and command[k + 1] <= i * STEP:
            k += 1

        def rates(a: float, b: float) -> np.ndarray:
            return np.array([b, rate(p, a, b, u[k])])

        now = np.array([x, v])
        first = rates(*now)
        second = rates(*(now + STEP / 2 * first))
        x, v = now + STEP * second
    clock, path = STEP * np.arange(len(path)), np.array(path)
    spread = path.std(axis=0)

    def seen(at: np.ndarray, column: int, noise: float) -> np.ndarray:
        return np.interp(at, clock, path[:, column]) + noise * spread[column] * random.standard_normal(len(at))

    noise = 10 ** random.uniform(-3, -1.5)
    w = random.uniform(0.8, 1.2) * seen(gyro, 1, 3 * noise) + random.normal(0, 0.2)
    states = {"x": seen(state, 0, noise), "v": seen(state, 1, 2 * noise)}
    return {"/state": (state, states), "/command": (command, {"u": u}), "/gyro": (gyro, {"w": w})}


def save(path: pathlib.Path, topics: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]) -> None:
    messages = []
    for topic, (stamps, columns) in topics.items():
        for i, t in enumerate(stamps):
            messages.append((round(1e9 * (1000 + t)), topic, {name: float(column[i]) for name, column in columns.items()}))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        known = {topic: writer.register_channel(topic, "json", 0) for topic in topics}
        for ns, topic, message in sorted(messages, key=lambda m: m[0]):
            writer.add_message(known[topic], ns, json.dumps(message).encode(), ns)
        writer.finish()


def estimated(path: pathlib.Path, topic: str, read: list[str]) -> tuple[float, float, float]:
    """The offset and its interval, s."""
    places = {name: f"{own}.{name}" for own in ("/state", topic) for name in TOPICS[own] if name in read}
    with warnings.catch_warnings(record=True) as stated:
        warnings.simplefilter("always")
        gpsindy.read_log(path, map=places, controls=["u"] if "u" in read else None, offset={topic: "auto"})
    for warning in stated:
        if found := TOLD.search(str(warning.message)):
            return tuple(float(number) for number in found.groups())
    raise ValueError("no offset was stated")


def main() -> None:
    begin, end = (int(word) for word in sys.argv[1:3])
    for topic, read in (("/command", ["x", "v", "u"]), ("/gyro", ["x", "w"])):
        for kind in PLANTS:
            held, widths, errors, refused = 0, [], [], []
            for seed in range(begin, end):
                topics = drawn(kind, seed)
                truth = np.random.default_rng([seed, 7]).uniform(-0.4, 0.4)
                stamps, columns = topics[topic]
                topics[topic] = (stamps - truth, columns)
                with tempfile.TemporaryDirectory() as folder:
                    path = pathlib.Path(folder, "log.mcap")
                    save(path, topics)
                    try:
                        found, low, high = estimated(path, topic, read)
                    except ValueError as error:
                        refused.append(f"{seed}: {error}")
                        continue
                held += low <= truth <= high
                widths.append(high - low)
                errors.append(abs(found - truth))
                if not low <= truth <= high:
                    print(f"  {kind}, {topic}, seed {seed}: {1e3 * truth:.3f} ms outside {1e3 * low:.3f} to {1e3 * high:.3f}", flush=True)
            ms = 1e3 * np.array([np.median(widths), np.max(widths), np.median(errors), np.max(errors)])
            print(
                f"{kind}, {topic}: {held} of {len(widths)} intervals hold the truth; width {ms[0]:.2f} ms in the middle, {ms[1]:.2f} at most; "
                f"error {ms[2]:.2f} ms in the middle, {ms[3]:.2f} at most; {len(refused)} refused",
                *refused,
                sep="\n  ",
                flush=True,
            )


if __name__ == "__main__":
    main()
