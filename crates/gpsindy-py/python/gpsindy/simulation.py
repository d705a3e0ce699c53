"""Rollouts of a model under the controls of logs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gpsindy.data._tables import Array, readonly
from gpsindy.data.dataset import Path, as_dataset

if TYPE_CHECKING:
    from gpsindy.identifying.estimator import GPSINDy
    from gpsindy.model import Hold, Method, Model


@dataclass(frozen=True, eq=False)
class Rollout:
    """A simulated run.

    Attributes
    ----------
    name : str
        Name of the run.
    t : ndarray of shape (n_samples,)
        Times, s.
    x : ndarray of shape (n_samples, n_states)
        The states.
    y : ndarray of shape (n_samples, n_states)
        What the log's columns would read, by the model's ``measured``.
    states : tuple of str
        Names of the columns of ``x`` and ``y``.
    """

    name: str
    t: Array
    x: Array
    y: Array
    states: tuple[str, ...]

    def __getitem__(self, state: str) -> Array:
        """What the column of one state reads."""
        if state not in self.states:
            raise KeyError(f"no state {state!r}; found {', '.join(self.states)}")
        return self.y[:, self.states.index(state)]

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f", {self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else ""
        return f"Rollout {self.name!r}: {', '.join(self.states)}; {len(self.t)} samples{span}"


def simulate(
    model: Model | GPSINDy | Path,
    logs: Any,
    *,
    initial: Mapping[str, float] | None = None,
    start: float | None = None,
    stop: float | None = None,
    hold: Hold | None = None,
    method: Method = "auto",
    tolerance: float = 1e-8,
) -> list[Rollout]:
    """A rollout of every run, under the log's controls and from its first sample.

    Parameters
    ----------
    model : Model, path of a model file or fitted GPSINDy
    logs : Dataset, paths of CSV files, frame or list of frames
    initial : mapping of str to float, optional
        Initial values that override those of the log.
    start, stop : float, optional
        Only the samples between these times, s; delays see the log before ``start``.
    hold, method, tolerance
        As in :meth:`Model.simulate`.

    Returns
    -------
    list of Rollout
        One a run.

    Examples
    --------
    >>> import gpsindy
    >>> model = gpsindy.Model.from_callable(lambda t, x, u: [-2 * x[0] + u[0]], ["x"], ["u"])
    >>> log = {"t": [0.0, 0.5, 1.0], "x": [1.0, 0.4, 0.1], "u": [0.0, 0.0, 0.0]}
    >>> gpsindy.simulate(model, log)[0]["x"].round(4)
    array([1.    , 0.3679, 0.1353])
    """
    from gpsindy.model import as_model

    model, data = as_model(model), as_dataset(logs)
    pairs = [(name, float(value)) for name, value in (initial or {}).items()]
    found = model._inner.simulate_runs(data._inner, pairs, (start, stop), (hold or model.hold, method, tolerance))
    names = tuple(state.name for state in model.states)
    return [Rollout(name, readonly(np.array(t)), x, y, names) for name, t, x, y in found]
