"""The next experiment from Python, of equations and of a simulator that steps."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import gpsindy
from carts import carts, stepper

LIMITS = {"u": (-3.0, 3.0)}


def quiet_log(seed, drag=0.5):
    """The stepper's cart with quadratic drag, moved so little that viscous friction does as well."""
    rng = np.random.default_rng(seed)
    t = np.arange(200) / 50
    u = np.repeat(rng.uniform(-0.4, 0.4, 10), 20)
    x = np.zeros((1, 2))
    rows = []
    for i in range(len(t)):
        rows.append(x[0])
        for _ in range(4):
            force = -drag * x[:, 1:] * np.abs(x[:, 1:])
            x = carts(x, np.array([[u[i]]]), force, np.array([[1.2, 4.0]]), 0.005)
    values = np.array(rows)
    return {
        "t": t,
        "x": values[:, 0] + 1e-3 * rng.standard_normal(len(t)),
        "v": values[:, 1] + 4e-3 * rng.standard_normal(len(t)),
        "u": u,
    }


@pytest.fixture(scope="module")
def diagnosis():
    logs = [quiet_log(seed) for seed in range(3)]
    return gpsindy.diagnose(stepper(), logs, effects=["viscous_friction", "quadratic_drag"], most_effects=1, hold="zero")


def test_a_signal_within_the_limits_parts_two_accounts(diagnosis, tmp_path):
    found = diagnosis.design(LIMITS, rate_limits={"u": 50.0}, duration=4.0, separate=("viscous_friction", "quadratic_drag"))
    u = found.controls["u"]
    assert len(found.t) == len(u) == 201 and np.abs(u).max() <= 3.0
    assert np.abs(np.diff(u)).max() <= 1.0 + 1e-12
    (pair,) = found.pairs
    assert {pair.one, pair.other} == {"viscous_friction", "quadratic_drag"}
    # A motion ten times as large shows the curvature of the drag beyond doubt.
    assert pair.nats > 20 and pair.seconds is not None and pair.seconds < 4.0
    found.save(tmp_path / "next.csv")
    assert np.array_equal(gpsindy.read_csv(tmp_path / "next.csv")[0]["u"], u)
    assert "viscous_friction" in repr(found) and found.complete
    cut = diagnosis.design(LIMITS, duration=4.0, separate=("viscous_friction", "quadratic_drag"), time_limit=1e-9)
    assert not cut.complete and len(cut.t) == 201 and "ended early" in repr(cut)


def test_mistakes_are_stated(diagnosis):
    with pytest.raises(ValueError, match="control `u` has no limit"):
        diagnosis.design({})
    with pytest.raises(ValueError, match="no pair of bias and cogging"):
        diagnosis.design(LIMITS, separate=("bias", "cogging"))


def test_a_copy_of_a_diagnosis_of_equations_can_still_design(cart):
    rng = np.random.default_rng(1)
    t = np.arange(150) / 25
    logs = []
    for _ in range(3):
        u = np.repeat(rng.uniform(-1, 1, 10), 15)
        x = cart.simulate([0.0, 0.0], t, u=u[:, None]).x + 0.01 * rng.standard_normal((150, 2))
        logs.append({"t": t, "x": x[:, 0] + 0.2, "v": x[:, 1], "u": u})
    found = gpsindy.diagnose(cart, logs, effects=["bias", "sensor_bias", "input_bias"], hold="zero")
    copy = pickle.loads(pickle.dumps(found))
    assert copy.open == found.open
    signal = copy.design({"u": (-1, 1)}, duration=2.0, rate=20.0)
    assert len(signal.pairs) >= 1
