"""Plots; the only module that imports matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

from gpsindy.data.dataset import as_dataset
from gpsindy.identifying.smoothing import Smoothed
from gpsindy.model import Hold, Model
from gpsindy.simulation import simulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from gpsindy.diagnosis import Diagnosis

# The report's names and colours.
NOMINAL: dict[str, Any] = {"color": "#c04a00", "linestyle": "--", "label": "nominal model"}
AUGMENTED: dict[str, Any] = {"color": "#0067a8", "label": "augmented model"}
MEASURED: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3, "color": "0.55", "label": "measured"}


def _grid(rows: int, columns: int, figsize: tuple[float, float] | None) -> tuple[Figure, Any]:
    size = figsize or (min(max(4.0 * columns, 6.4), 16.0), max(2.2 * rows, 3.2))
    return plt.subplots(rows, columns, sharex="col", squeeze=False, figsize=size, layout="constrained")


def _label(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _finish(figure: Figure, axes: Any, titles: list[str]) -> Figure:
    for j, title in enumerate(titles):
        axes[0, j].set_title(title)
        axes[-1, j].set_xlabel("t [s]")
    axes[0, 0].legend(loc="best", fontsize="small")
    return _shown(figure)


def _shown(figure: Figure) -> Figure:
    if "inline" in str(matplotlib.get_backend()):
        # A notebook shows the figure that a cell ends with, and would show an open one once more.
        plt.close(figure)
    return figure


def rollouts(
    model: Model, logs: Any, *, hold: Hold | None = None, max_runs: int = 4, figsize: tuple[float, float] | None = None
) -> Figure:
    """Rollouts of a model from the first sample of each run, and the samples.

    Parameters
    ----------
    model : Model
    logs : Dataset, paths of CSV files, frame or list of frames
    hold : {"zero", "linear"}, optional
    max_runs : int
        Runs shown, at most.
    figsize : (float, float), optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    data = as_dataset(logs)[:max_runs]
    predicted = simulate(model, data, hold=hold)
    figure, axes = _grid(len(model.states), len(data), figsize)
    for j, (run, rollout) in enumerate(zip(data, predicted)):
        for i, state in enumerate(model.states):
            axis: Axes = axes[i, j]
            if state.name in run.columns:
                axis.plot(run.t, run[state.name], **MEASURED)
            axis.plot(rollout.t, rollout[state.name], color="C0", label="model")
            if j == 0:
                axis.set_ylabel(_label(state.name, state.unit))
    return _finish(figure, axes, [run.name for run in data])


def smoothed(
    found: Smoothed, logs: Any = None, *, max_runs: int = 4, figsize: tuple[float, float] | None = None
) -> Figure:
    """Smoothed columns with their 95 % bands.

    Parameters
    ----------
    found : Smoothed
    logs : Dataset, paths of CSV files, frame or list of frames, optional
        What was smoothed, to be drawn with it.
    max_runs : int
        Runs shown, at most.
    figsize : (float, float), optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    runs = found.runs[:max_runs]
    samples = None if logs is None else as_dataset(logs)
    figure, axes = _grid(len(found.columns), len(runs), figsize)
    for j, run in enumerate(runs):
        for i, fit in enumerate(found.fits):
            axis: Axes = axes[i, j]
            middle, half = run.x[:, i], 1.96 * run.x_std[:, i]
            if samples is not None:
                axis.plot(samples[j].t, samples[j][fit.column], **MEASURED)
            axis.fill_between(run.t, middle - half, middle + half, color="C0", alpha=0.25, linewidth=0)
            axis.plot(run.t, middle, color="C0", label="smoothed")
            if j == 0:
                axis.set_ylabel(_label(fit.column, fit.unit))
    return _finish(figure, axes, [run.name for run in runs])


def diagnosis(
    found: Diagnosis,
    *,
    kind: Literal["rollouts", "residuals", "gap"] = "rollouts",
    max_runs: int = 4,
    figsize: tuple[float, float] | None = None,
) -> Figure:
    """Curves of a diagnosis.

    Parameters
    ----------
    found : Diagnosis
    kind : {"rollouts", "residuals", "gap"}
        ``rollouts``: held-out logs and the rollouts of the nominal and of the augmented model. ``residuals``: measured minus
        predicted. ``gap``: the residual of each equation, with its 95 % band, against the variable that it depends on most, and what
        the included causes add there.
    max_runs : int
        Runs shown, at most.
    figsize : (float, float), optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    if kind == "gap":
        return _gap(found, figsize)
    if kind not in ("rollouts", "residuals"):
        raise ValueError(f"kind: expected 'rollouts', 'residuals' or 'gap', found {kind!r}")
    curves = found._figures.get("rollouts", [])
    if not curves:
        raise ValueError("the diagnosis carries no curves to draw")
    runs = list(dict.fromkeys(curve["run"] for curve in curves))[:max_runs]
    columns = list(dict.fromkeys(curve["column"] for curve in curves))
    figure, axes = _grid(len(columns), len(runs), figsize)
    for curve in curves:
        if curve["run"] not in runs:
            continue
        i, j = columns.index(curve["column"]), runs.index(curve["run"])
        axis: Axes = axes[i, j]
        measured = _numbers(curve["measured"])
        if kind == "rollouts":
            axis.plot(curve["time"], measured, **MEASURED)
        for values, style in ((curve["before"], NOMINAL), (curve["after"], AUGMENTED)):
            if values:
                predicted = _numbers(values)
                axis.plot(curve["time"], predicted if kind == "rollouts" else measured - predicted, **style)
        if j == 0:
            name = curve["column"] if kind == "rollouts" else f"residual of {curve['column']}"
            axis.set_ylabel(_label(name, curve["unit"]))
    return _finish(figure, axes, runs)


def _gap(found: Diagnosis, figsize: tuple[float, float] | None) -> Figure:
    residuals = [one for one in found._figures.get("residuals", []) if one.get("curve")]
    if not residuals:
        raise ValueError("no equation of the diagnosis has a residual that depends on a variable")
    size = figsize or (6.4, max(2.6 * len(residuals), 3.2))
    figure, axes = plt.subplots(len(residuals), 1, squeeze=False, figsize=size, layout="constrained")
    for axis, residual in zip(axes[:, 0], residuals):
        curve = residual["curve"]
        x, y, band = (np.asarray(curve[key], dtype=float) for key in ("x", "y", "band"))
        axis.fill_between(x, y - band, y + band, color="0.55", alpha=0.25, linewidth=0)
        axis.plot(x, y, color="0.35", label="residual")
        if curve["explained"]:
            axis.plot(x, curve["explained"], color=AUGMENTED["color"], label="included causes")
        axis.axhline(0.0, color="0.7", linewidth=0.8)
        axis.set_xlabel(_label(curve["variable"], curve["unit"]))
        axis.set_ylabel(_label(f"residual of {residual['state']}'", residual["unit"]))
    axes[0, 0].legend(loc="best", fontsize="small")
    return _shown(figure)


def _numbers(values: list[float | None]) -> Any:
    return np.array([np.nan if value is None else value for value in values])
