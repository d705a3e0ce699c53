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
    from gpsindy import plot

    t = np.linspace(0, 5, 60)
    figure = plot.smoothed(gpsindy.smooth({"t": t, "x": np.sin(t)}, kernel="se"))
    assert len(figure.axes[0].collections) == 1
