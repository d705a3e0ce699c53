"""Errors of a model's predictions on logs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsindy import _gpsindy
from gpsindy.data.dataset import Path, as_dataset

if TYPE_CHECKING:
    from gpsindy.identifying.estimator import GPSINDy
    from gpsindy.model import Hold, Model, Progress


@dataclass(frozen=True)
class StateError:
    """Prediction error of one logged state.

    Attributes
    ----------
    state, unit : str
    rmse : float
        Root mean square error, in the unit.
    normalised : float
        The same divided by the column's standard deviation in the data.
    n_samples : int
        Samples compared.
    """

    state: str
    unit: str
    rmse: float
    normalised: float
    n_samples: int


@dataclass(frozen=True)
class Errors:
    """Errors of one kind of prediction.

    Attributes
    ----------
    pooled : float
        Root mean square, over samples and columns, of the error divided by the column's standard deviation:
        0 is perfect, 1 as bad as the mean.
    n_started, n_diverged : int
        Predictions started, and those of them that diverged.
    by_state : tuple of StateError
    """

    pooled: float
    n_started: int
    n_diverged: int
    by_state: tuple[StateError, ...]

    def rmse(self) -> dict[str, float]:
        """Root mean square error by state, in its unit."""
        return {entry.state: entry.rmse for entry in self.by_state}


@dataclass(frozen=True)
class Score:
    """How far a model's predictions lie from logs.

    Attributes
    ----------
    rollout : Errors
        Of whole runs from their first sample.
    windowed : Errors
        Of windows, each started from the log.
    one_step : Errors
        From each sample to the next.
    """

    rollout: Errors
    windowed: Errors
    one_step: Errors

    def __repr__(self) -> str:
        kinds = (("rollout", self.rollout), ("windowed", self.windowed), ("one_step", self.one_step))
        return f"Score({', '.join(f'{name}={errors.pooled:.4g}' for name, errors in kinds)}, relative)"


def score(
    model: Model | GPSINDy | Path,
    logs: Any,
    *,
    window: float | None = None,
    hold: Hold | None = None,
    progress: Progress | None = None,
) -> Score:
    """Errors of whole runs, windows and single steps, by state.

    Parameters
    ----------
    model : Model, path of a model file or fitted GPSINDy
    logs : Dataset, paths of CSV files, frame or list of frames
    window : float, optional
        Length of the windows, s. Default: a tenth of each run.
    hold : {"zero", "linear"}, optional
        What controls do between samples. Default: what the model was identified with, else "zero".
    progress : callable, optional
        Called with (stage, done, total).

    Returns
    -------
    Score

    Examples
    --------
    >>> import gpsindy
    >>> model = gpsindy.Model.from_callable(lambda t, x, u: [1.0], ["x"])
    >>> log = {"t": [0.0, 1.0, 2.0], "x": [0.0, 1.0, 2.3]}
    >>> round(gpsindy.score(model, log).rollout.by_state[0].rmse, 4)
    0.1732
    """
    from gpsindy.model import as_model

    found = as_model(model)
    kinds = _gpsindy.score(found._inner, as_dataset(logs)._inner, window, hold or found.hold, progress)
    return Score(*(_errors(*kind) for kind in kinds))


def _errors(pooled: float, started: int, diverged: int, states: Iterable[tuple[Any, ...]]) -> Errors:
    return Errors(pooled, started, diverged, tuple(StateError(*entry) for entry in states))
