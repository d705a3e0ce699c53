"""The paper's simulated systems: Lotka-Volterra and the unicycle, 30 s, white noise on states and given derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from library import Array, terms

SPAN = 30.0
TRAIN = 0.8
SIGMAS = [0.05, 0.1, 0.15, 0.2, 0.25]
REGIMES = {"given10": 0.1, "free10": 0.1, "given5": 0.2, "free5": 0.2, "irregular": 0.1}
"""Mean time between samples, s; in those that are `given` the log carries noisy derivatives."""


@dataclass(frozen=True)
class System:
    """Equations, start and library of a system, with its true coefficients by state and term."""

    states: list[str]
    controls: list[str]
    initial: list[float]
    rate: Callable[[float, Array], list[float]]
    control: Callable[[Array], Array]
    degree: int
    truth: dict[tuple[str, str], float]
    author_degree: int

    @property
    def terms(self) -> list[str]:
        """The library."""
        return terms([*self.states, *self.controls], self.degree, True)

    @property
    def coefficients(self) -> Array:
        """The truth, (n x p)."""
        return np.array([[self.truth.get((state, term), 0.0) for term in self.terms] for state in self.states])


SYSTEMS = {
    "lotka-volterra": System(
        ["x1", "x2"],
        [],
        [10.0, 5.0],
        lambda t, x: [1.1 * x[0] - 0.4 * x[0] * x[1], -x[1] + 0.4 * x[0] * x[1]],
        lambda t: np.empty((len(t), 0)),
        3,
        {("x1", "x1"): 1.1, ("x1", "x1*x2"): -0.4, ("x2", "x2"): -1.0, ("x2", "x1*x2"): 0.4},
        2,
    ),
    "unicycle": System(
        ["x1", "x2", "x3", "x4"],
        ["u1", "u2"],
        [0.0, 0.0, 0.5, 0.5],
        lambda t, x: [x[2] * np.cos(x[3]), x[2] * np.sin(x[3]), np.sin(t), 0.5 * np.cos(t)],
        lambda t: np.column_stack([np.sin(t), 0.5 * np.cos(t)]),
        1,
        {("x1", "x3*cos(x4)"): 1.0, ("x2", "x3*sin(x4)"): 1.0, ("x3", "u1"): 1.0, ("x4", "u2"): 1.0},
        1,
    ),
}


@dataclass(frozen=True)
class Sample:
    """The part of a simulated log that is learnt from; `dx` only where derivatives are given."""

    t: Array
    x: Array
    u: Array
    dx: Array | None
    clean: Array

    def standardised(self, system: System) -> tuple[Array, Array]:
        """States and given derivatives as the authors' recorded errors say that they made them for Lotka-Volterra.

        The noisy states to mean 0 and standard deviation 1; the true right side at the standardised clean states, plus the
        noise: the coefficients stay those of the truth, but it needs the truth, and the two are no trajectory together.
        """
        scaled = [(rows - rows.mean(axis=0)) / rows.std(axis=0) for rows in (self.x, self.clean)]
        right = [np.array([system.rate(t, row) for t, row in zip(self.t, rows)]) for rows in (scaled[1], self.clean)]
        return scaled[0], right[0] + (self.dx - right[1])


def sample(name: str, regime: str, sigma: float, seed: int) -> Sample:
    """One draw of noise, and of times where they are irregular."""
    system = SYSTEMS[name]
    random = np.random.default_rng([seed, round(1000 * sigma), list(REGIMES).index(regime), list(SYSTEMS).index(name)])
    count = round(SPAN / REGIMES[regime]) + 1
    t = np.linspace(0.0, SPAN, count)
    if regime == "irregular":
        t = np.sort(random.uniform(0.0, SPAN, count))
    x = solve_ivp(system.rate, (0.0, SPAN), system.initial, t_eval=t, rtol=1e-10, atol=1e-10).y.T
    dx = np.array([system.rate(time, row) for time, row in zip(t, x)])
    noisy = x + sigma * random.standard_normal(x.shape)
    rates = dx + sigma * random.standard_normal(x.shape)
    kept = t <= TRAIN * SPAN
    given = rates[kept] if regime.startswith("given") else None
    return Sample(t[kept], noisy[kept], system.control(t[kept]), given, x[kept])
