"""Pictures draw what they say, and nobody else needs matplotlib."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import gpsindy

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def closed():
    yield
    from matplotlib import pyplot

    pyplot.close("all")


def test_matplotlib_is_imported_by_the_plots_only():
    code = "import sys, gpsindy; assert not {'matplotlib', 'pandas', 'polars', 'pyarrow', 'sklearn'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_rollouts_stand_beside_their_samples(cart, runs):
    t, x, u = runs[0]
    figure = cart.plot([{"t": t, "x": x[:, 0], "v": x[:, 1], "u": u}] * 2)
    assert len(figure.axes) == 4
    assert figure.axes[0].get_ylabel() == "x [m]"
    assert [line.get_label() for line in figure.axes[0].lines] == ["measured", "model"]


def test_an_estimator_plots_its_model(fitted, runs):
    t, x, u = runs[0]
    assert len(fitted.plot(x, t, u).axes) == 2


def test_smoothed_columns_have_bands():
    t = np.linspace(0, 5, 60)
    log = {"t": t, "x": np.sin(t)}
    figure = gpsindy.smooth(log, kernel="se").plot(log)
    assert len(figure.axes[0].collections) == 1
    assert [line.get_label() for line in figure.axes[0].lines] == ["measured", "smoothed"]


def test_a_diagnosis_draws_the_held_out_runs():
    text = """{"figures": {"rollouts": [{"run": "a", "column": "x", "unit": "m", "time": [0.0, 1.0],
        "measured": [1.0, null], "before": [1.0, 2.0], "after": [1.0, 1.5]}]}}"""
    figure = gpsindy.plot.diagnosis(gpsindy.Diagnosis(text, gpsindy.Model.from_toml(ONE)))
    assert [line.get_label() for line in figure.axes[0].lines] == ["measured", "nominal model", "augmented model"]


def test_a_diagnosis_draws_residuals_and_the_gap_of_an_equation():
    text = """{"figures": {"rollouts": [{"run": "a", "column": "x", "unit": "m", "time": [0.0, 1.0],
        "measured": [1.0, 2.0], "before": [0.5, 2.0], "after": [1.0, 1.5]}], "residuals": [{"state": "x", "unit": "m/s", "traces": [],
        "curve": {"variable": "v", "unit": "m/s", "x": [0.0, 1.0], "y": [0.1, 0.2], "band": [0.05, 0.05], "explained": [0.1, 0.2]}}]}}"""
    found = gpsindy.Diagnosis(text, gpsindy.Model.from_toml(ONE))
    nominal, augmented = found.plot(kind="residuals").axes[0].lines
    np.testing.assert_array_equal(nominal.get_ydata(), [0.5, 0.0])
    np.testing.assert_array_equal(augmented.get_ydata(), [0.0, 0.5])
    axis = found.plot(kind="gap").axes[0]
    assert [line.get_label() for line in axis.lines[:2]] == ["residual", "included causes"]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("v [m/s]", "residual of x' [m/s]")
    with pytest.raises(ValueError, match="kind: expected"):
        found.plot(kind="causes")


ONE = "schema = 'gpsindy.model/1'\n[[state]]\nname = 'x'\nequation = '-x'\n"
