"""A machine written by hand: what its simulator says, what it does, how it is driven, and its logs."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

Rates = Callable[[float, list[float], list[float]], list[float]]


@dataclass(frozen=True)
class Plant:
    """A machine: what its simulator says, what it does, and how it is driven and logged."""

    states: dict[str, tuple[str, str]]
    """Unit and nominal right side by state."""
    controls: dict[str, str]
    parameters: dict[str, float]
    rates: Rates
    drive: list[Callable]
    """For each control: what makes, of the number of a log, a function of sample, time and state."""
    period: float
    samples: int
    noise: list[float]
    right: list[set[str]] | None = None
    """Sets of effects that would be right; an empty list where nothing is planted, nothing where the catalogue lacks the effect."""
    start: tuple[float, ...] = ()
    hidden: tuple[float, ...] = ()
    """Starts of states that the simulator lacks."""
    late: float = 0.0
    reads: Callable[[list[float], float], list[float]] | None = None
    fine: int = 20
    gust: tuple[float, float] | None = None
    """Deviation and correlation time of the last hidden state."""


def one(*names: str) -> list[set[str]]:
    return [{name} for name in names]


def sign(v: float, width: float = 1e-3) -> float:
    return math.tanh(v / width)


def mix(size: float, slow: float, fast: float, every: int, seed: int) -> Callable:
    """Two sines and random steps."""

    def of(log: int) -> Callable:
        draw = random.Random(seed * 77 + log)
        a, b = draw.uniform(0, 6.28), draw.uniform(0, 6.28)
        steps = [draw.uniform(-1, 1) for _ in range(2000)]
        return lambda k, t, x: size * (
            0.4 * math.sin(slow * t + a) + 0.3 * math.sin(fast * t + b) + 0.5 * steps[k // every]
        )

    return of


def simulate(plant: Plant, log: int, seed: int) -> list[list[float]]:
    """Rows of time, readings and controls; Runge and Kutta's fourth order between held controls."""
    draw = random.Random(seed)
    count = len(plant.states)
    start = plant.start or (0.0,) * count
    x = [v * (1 + 0.1 * math.sin(3.7 * log + i)) for i, v in enumerate(start)] + list(plant.hidden)
    drives = [of(log) for of in plant.drive]
    step = plant.period / plant.fine
    held, rows = [], []
    for k in range(plant.samples):
        t = k * plant.period
        held.append([drive(k, t, x) for drive in drives])
        read = plant.reads(x, t) if plant.reads else x[:count]
        rows.append([t, *(v + draw.gauss(0.0, s) for v, s in zip(read, plant.noise)), *held[-1]])
        for j in range(plant.fine):
            now = t + j * step
            u = held[max(0, math.floor((now - plant.late) / plant.period + 1e-9))]
            a = plant.rates(now, x, u)
            b = plant.rates(now + step / 2, [v + step / 2 * r for v, r in zip(x, a)], u)
            c = plant.rates(now + step / 2, [v + step / 2 * r for v, r in zip(x, b)], u)
            d = plant.rates(now + step, [v + step * r for v, r in zip(x, c)], u)
            x = [v + step / 6 * (p + 2 * q + 2 * r + s) for v, p, q, r, s in zip(x, a, b, c, d)]
            if plant.gust:
                size, time = plant.gust
                x[-1] += size * math.sqrt(2 * step / time) * draw.gauss(0.0, 1.0)
    return rows


def steps(low: float, size: float, every: int) -> Callable:
    """Levels that differ from log to log."""

    def of(log: int) -> Callable:
        return lambda k, t, x: low + size * (1 if ((k // every) * 7 + 2 * log) % 3 else -1) * (
            0.5 + 0.5 * ((k // every + log) % 2)
        )

    return of
