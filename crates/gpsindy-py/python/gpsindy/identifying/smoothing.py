"""Denoised columns and their time derivatives, by Gaussian processes over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsindy import _gpsindy
from gpsindy.data._tables import Array, floats, names_of
from gpsindy.data.dataset import as_dataset
from gpsindy.model import Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class SmoothedRun:
    """Smoothed columns of one run.

    Attributes
    ----------
    name : str
    t : ndarray of shape (n_samples,)
        Times, s.
    x, x_std : ndarray of shape (n_samples, n_columns)
        Posterior mean and standard deviation of the noise-free values, also where a value is missing.
    x_dot, x_dot_std : ndarray of shape (n_samples, n_columns)
        The same of the time derivative, per second.
    x_dot_covariance : tuple of ndarray of shape (n_samples, n_samples)
        One a column; empty unless asked for.
    """

    name: str
    t: Array
    x: Array
    x_std: Array
    x_dot: Array
    x_dot_std: Array
    x_dot_covariance: tuple[Array, ...]

    def __repr__(self) -> str:
        return f"SmoothedRun {self.name!r}: {self.x.shape[0]} samples, {self.x.shape[1]} columns"


@dataclass(frozen=True, eq=False)
class ColumnFit:
    """The Gaussian process of one column.

    Attributes
    ----------
    column, unit : str
    kernel : str
        The kernel of the lowest negative log marginal likelihood.
    hyper : ndarray
        Its hyperparameters, in the units of time and column.
    noise : float
        Standard deviation of the noise, in the column's unit.
    nll : float
        Negative log marginal likelihood of the standardised values.
    converged : bool
        Whether the optimiser reached a tolerance.
    weak : tuple of str
        Whatever makes the answer weak; empty is good.
    """

    column: str
    unit: str
    kernel: str
    hyper: Array
    noise: float
    nll: float
    converged: bool
    weak: tuple[str, ...]

    def __repr__(self) -> str:
        weak = f"; weak: {'; '.join(self.weak)}" if self.weak else ""
        return f"ColumnFit {self.column!r}: {self.kernel}, noise {self.noise:.4g}{weak}"


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed columns of all runs.

    Attributes
    ----------
    columns : tuple of str
    runs : tuple of SmoothedRun
    fits : tuple of ColumnFit
        One a column.
    """

    columns: tuple[str, ...]
    runs: tuple[SmoothedRun, ...]
    fits: tuple[ColumnFit, ...]

    def __repr__(self) -> str:
        samples = sum(len(run.t) for run in self.runs)
        fits = "; ".join(f"{fit.column}: {fit.kernel}, noise {fit.noise:.4g}" for fit in self.fits)
        return f"Smoothed {len(self.runs)} runs, {samples} samples; {fits}"

    def plot(self, logs: Any = None, **options: Any) -> Figure:
        """The columns with their 95 % bands; see :func:`gpsindy.plot.smoothed`. Needs matplotlib."""
        from gpsindy import plot

        return plot.smoothed(self, logs, **options)


def smooth(
    logs: Any,
    columns: str | Iterable[str] | None = None,
    *,
    kernel: str = "auto",
    noise: Sequence[float] | None = None,
    covariance: bool = False,
    progress: Progress | None = None,
) -> Smoothed:
    """Denoised columns and derivatives with standard deviations.

    One Gaussian process over time a column; hyperparameters are shared by all runs.

    Parameters
    ----------
    logs : Dataset, paths of CSV files, frame or list of frames
    columns : str or sequence of str, optional
        Default: all.
    kernel : str
        ``auto`` tries several, or one of ``se``, ``matern12``, ``matern32``, ``matern52``, ``periodic``, ``rq``, or a sum or
        product of them such as ``se+periodic``.
    noise : sequence of float, optional
        Known standard deviations, one a column, in its unit. Default: estimated.
    covariance : bool
        Whether the joint covariance of each derivative is kept.
    progress : callable, optional
        Called with (stage, done, total).

    Returns
    -------
    Smoothed

    Examples
    --------
    >>> import numpy as np
    >>> import gpsindy
    >>> t = np.linspace(0, 6, 60)
    >>> noise = 0.05 * np.random.default_rng(0).standard_normal(60)
    >>> found = gpsindy.smooth({"t": t, "x": np.sin(t) + noise})
    >>> bool(np.abs(found.runs[0].x_dot[:, 0] - np.cos(t)).max() < 0.2)
    True
    """
    data = as_dataset(logs)
    wanted = list(data.columns) if columns is None else names_of(columns)
    known = None if noise is None else [float(value) for value in floats(noise, "noise").ravel()]
    runs, fits = _gpsindy.smooth(data._inner, wanted, kernel, known, covariance, progress)
    smoothed = (SmoothedRun(**{**run, "x_dot_covariance": tuple(run["x_dot_covariance"])}) for run in runs)
    return Smoothed(tuple(wanted), tuple(smoothed), tuple(ColumnFit(**{**fit, "weak": tuple(fit["weak"])}) for fit in fits))
