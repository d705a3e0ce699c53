"""Smoothing finds the noise and the derivative."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy


@pytest.fixture(scope="module")
def found():
    t = np.linspace(0, 10, 150)
    noise = 0.1 * np.random.default_rng(3).standard_normal(150)
    values = np.sin(t) + noise
    values[40] = np.nan
    return gpsindy.smooth({"t": t, "a [m]": values, "b": np.cos(t)}, "a", kernel="se", covariance=True)


def test_names_and_shapes_are_kept(found):
    assert found.columns == ("a",)
    run = found.runs[0]
    assert run.x.shape == run.x_dot_std.shape == (150, 1)
    assert run.x_dot_covariance[0].shape == (150, 150)
    assert (found.fits[0].unit, found.fits[0].kernel) == ("m", "se")
    assert not run.x.flags.writeable


def test_noise_and_derivative_are_found(found):
    run = found.runs[0]
    # 150 samples tell a standard deviation within 6 %; this is four times that.
    assert found.fits[0].noise == pytest.approx(0.1, rel=0.25)
    assert np.sqrt(np.mean((run.x_dot[:, 0] - np.cos(run.t)) ** 2)) < 0.15
    assert found.fits[0].converged


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kernel": "spline"}, "kernel `spline` is unknown; known: se"),
        ({"columns": "z"}, "column `z` is unknown; known: a"),
        ({"noise": [0.1, 0.2]}, "noise: expected 1 values"),
        ({"noise": [-1.0]}, "`noise` must be above 0"),
    ],
)
def test_wrong_settings_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        gpsindy.smooth({"t": [0.0, 1.0, 2.0], "a": [0.0, 1.0, 0.0]}, **options)


def test_progress_is_reported_and_its_error_ends_the_work():
    t = np.linspace(0, 30, 100)
    rng = np.random.default_rng(0)
    columns = {"t": t, **{f"x{i}": np.sin(t + i) + 0.1 * rng.standard_normal(100) for i in range(100)}}

    def fail(stage, done, total):
        assert (stage, total) == ("smooth", 100)
        raise LookupError(stage)

    with pytest.raises(LookupError, match="smooth"):
        gpsindy.smooth(columns, kernel="matern52", progress=fail)
