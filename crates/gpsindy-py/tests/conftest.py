"""Data with known answers."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy


def oscillator(seed: int = 0, n: int = 120, period: float = 0.05, noise: float = 0.005):
    """x' = v, v' = -4 x + u, with u held between samples; returns t, (x, v), u."""
    t = period * np.arange(n)
    u = np.sign(np.sin(0.9 * t + seed)) * 2.0
    a = np.array([[0.0, 1.0], [-4.0, 0.0]])
    c, s = np.cos(2 * period), np.sin(2 * period)
    step = np.array([[c, s / 2], [-2 * s, c]])
    push = np.linalg.solve(a, (step - np.eye(2)) @ np.array([0.0, 1.0]))
    x = np.empty((n, 2))
    x[0] = [1.0 - 0.3 * seed, 0.2]
    for i in range(n - 1):
        x[i + 1] = step @ x[i] + push * u[i]
    return t, x + noise * np.random.default_rng(seed).standard_normal(x.shape), u


@pytest.fixture(scope="session")
def runs():
    return [oscillator(seed) for seed in range(2)]


@pytest.fixture(scope="session")
def fitted(runs):
    x = [run[1] for run in runs]
    estimator = gpsindy.GPSINDy(degree=1, kernel="se", fix=["x' = v"])
    return estimator.fit(x, runs[0][0], u=[run[2] for run in runs], feature_names=["x", "v", "u"])


@pytest.fixture
def cart():
    return gpsindy.Model.from_toml(CART)


CART = """
schema = "gpsindy.model/1"
name = "cart"

[[state]]
name = "x"
unit = "m"
equation = "v"

[[state]]
name = "v"
unit = "m/s"
equation = "-k*x + u"

[[control]]
name = "u"

[[parameter]]
name = "k"
value = 4.0
"""
