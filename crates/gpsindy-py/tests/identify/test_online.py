"""Online identification through Python."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import gpsindy
from conftest import oscillator


def fresh(**options):
    return gpsindy.Online(["x [m]", "v"], ["u"], degree=1, fix=["x' = v"], **options)


def stiffness(online):
    record = online.model.identification
    j = record.terms.index("x")
    return record.coefficients[1, j], record.standard_errors[1, j]


@pytest.fixture(scope="module")
def log():
    return oscillator(0, n=600)


def test_sample_by_sample_and_all_at_once_give_the_same_true_model(log):
    t, x, u = log
    one, other = fresh(window=200), fresh(window=200)
    for i in range(len(t)):
        one.update(t[i], x[i], u[i])
    other.update(t, x, u)
    assert one.n_samples == other.n_samples == 600
    np.testing.assert_array_equal(one.model.identification.coefficients, other.model.identification.coefficients)
    assert one.equations()[0] == "v"
    assert one.model.states[0].unit == "m"
    value, error = stiffness(one)
    # The true value, and what rounding a control's edges leaves.
    assert abs(value + 4) < 4 * error + 0.02


def test_the_estimate_is_near_the_truth(log):
    t, x, u = log
    online = fresh()
    online.update(t, x, u)
    now = online.estimate()
    assert now.value.shape == now.rate_std.shape == (2,)
    # Noise of 0.005 before smoothing.
    assert np.all(np.abs(now.value - x[-1]) < 0.03) and np.all(now.value_std < 0.01)
    assert not now.value.flags.writeable


def test_runs_missing_values_and_copies(log):
    t, x, u = log
    holes = x.copy()
    holes[5::9, 0] = np.nan
    online = fresh()
    online.update(t[:300], holes[:300], u[:300])
    twin = copy.copy(online)
    online.begin_run()
    online.update(t[:300], holes[300:], u[300:])
    assert (online.n_samples, twin.n_samples) == (600, 300)
    for each in (online, twin):
        assert abs(stiffness(each)[0] + 4) < 0.05


def test_a_model_needs_samples():
    online = fresh()
    for what in (lambda: online.model, online.equations, online.estimate):
        with pytest.raises(gpsindy.NotFittedError, match="needs at least 16 samples, found 0"):
            what()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, [1.0, 2.0, 3.0], 0.0), r"x: expected shape \(2,\), found \(3,\)"),
        ((0.0, [1.0, 2.0]), r"u: expected shape \(1,\), found \(0,\)"),
        (([0.0, 1.0], [1.0, 2.0], 0.0), r"x: expected shape \(2, 2\), found \(2,\)"),
        ((-1.0, [1.0, 2.0], 0.0), "time must increase, but a sample at 0 s is followed by one at -1 s"),
        ((1.0, [np.inf, 2.0], 0.0), "`x` at t = 1 s"),
        (("soon", [1.0, 2.0], 0.0), "t: not numbers"),
    ],
)
def test_bad_samples_are_one_clear_error(arguments, message):
    online = fresh()
    online.update(0.0, [1.0, 2.0], 0.0)
    with pytest.raises(ValueError, match=message):
        online.update(*arguments)
    assert online.n_samples == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"memory": -1}, "`memory` must be above 0"),
        ({"window": 3}, "`window` must be at least 64"),
        ({"kernel": "se"}, "`kernel` must be matern32 or matern52"),
        ({"hold": "cubic"}, "`hold` must be"),
        ({"select": "rollout"}, "`select` must be"),
        ({"angles": ["y"]}, "angle `y` is unknown"),
        ({"delays": {"w": 0.1}}, "control `w` is unknown"),
    ],
)
def test_bad_settings_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        fresh(**options)
