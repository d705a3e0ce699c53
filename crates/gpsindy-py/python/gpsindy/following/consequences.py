"""What a gap costs the user: the same controller in the nominal simulator, in the corrected one, and without each cause."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np

from gpsindy.data._tables import Array, readonly
from gpsindy.diagnosis import Cause, Diagnosis
from gpsindy.model import Model

Controller = Callable[[float, Array], Any]
"""``controller(t, y)`` from the time, s, and what the sensors read (n_states,) to the controls (n_controls,)."""


@dataclass(frozen=True, eq=False)
class Loop:
    """A rollout with a controller in the loop.

    Attributes
    ----------
    t : ndarray of shape (n_samples,)
        Times, s.
    x, y : ndarray of shape (n_samples, n_states)
        The states, and what their columns would read.
    u : ndarray of shape (n_samples, n_controls)
        What the controller said, held until the next time.
    states, controls : tuple of str
        Names of the columns.
    """

    t: Array
    x: Array
    y: Array
    u: Array
    states: tuple[str, ...]
    controls: tuple[str, ...]

    def __getitem__(self, name: str) -> Array:
        """What the column of a state reads, or a control."""
        if name in self.states:
            return self.y[:, self.states.index(name)]
        if name in self.controls:
            return self.u[:, self.controls.index(name)]
        raise KeyError(f"no state or control {name!r}; found {', '.join((*self.states, *self.controls))}")


@dataclass(frozen=True)
class Loss:
    """What one cause costs.

    Attributes
    ----------
    cause : Cause
    cost : float
        Of the corrected simulator with this cause alone taken out.
    loss : float
        By how much the cost of the corrected simulator is above that.
    share : float
        Of the corrected simulator's cost above the nominal one's; shares of causes that act on each other need not add
        up to one. NaN where the two costs are the same.
    """

    cause: Cause
    cost: float
    loss: float
    share: float


@dataclass(frozen=True, eq=False)
class Consequence:
    """What a gap costs; ``print`` it for a table.

    Attributes
    ----------
    nominal, corrected : float
        Cost in the nominal simulator and in the corrected one.
    losses : tuple of Loss
        What each included cause costs, the largest first.
    loops : tuple of Loop
        The rollouts in the nominal and in the corrected simulator.
    """

    nominal: float
    corrected: float
    losses: tuple[Loss, ...]
    loops: tuple[Loop, Loop]

    def __repr__(self) -> str:
        lines = [f"cost {self.nominal:.4g} in the nominal simulator, {self.corrected:.4g} in the corrected one"]
        for loss in self.losses:
            share = "" if np.isnan(loss.share) else f", {100 * loss.share:.0f} % of the difference"
            cause = loss.cause
            # A wrong parameter is known by its name, not by the equation that it moves most.
            where = cause.variables[0] if cause.effect == "parameter_error" else cause.place or cause.state
            lines.append(f"  {cause.effect} ({where}): {loss.loss:+.4g}{share}")
        return "\n".join(lines)


def closed_loop(
    model: Model,
    controller: Controller,
    t: Sequence[float] | Array,
    start: Mapping[str, float] | None = None,
    *,
    n_seen: int | None = None,
    tolerance: float = 1e-8,
) -> Loop:
    """A rollout of a model with a controller in the loop.

    Parameters
    ----------
    model : Model
    controller : callable
        ``controller(t, y)`` gives the controls, held until the next time. One that has a method ``reset`` is reset first.
    t : sequence of float
        Times at which the controller speaks, s, rising.
    start : mapping of str to float, optional
        Where states begin. Default: the model's own initial values, else zero.
    n_seen : int, optional
        How many states the controller sees, the first ones. Default: all.
    tolerance : float
        Of the integration, relative.

    Returns
    -------
    Loop

    Examples
    --------
    >>> import gpsindy
    >>> import numpy as np
    >>> cart = gpsindy.Model.from_callable(lambda t, x, u: [x[1], u[0]], ["x", "v"], ["u"])
    >>> loop = gpsindy.closed_loop(cart, lambda t, y: [-4 * y[0] - 4 * y[1]], np.linspace(0, 5, 501), {"x": 1.0})
    >>> bool(abs(loop["x"][-1]) < 0.01)
    True
    """
    states = tuple(state.name for state in model.states)
    given = {**model.initial, **(start or {})}
    unknown = [name for name in given if name not in states]
    if unknown:
        raise ValueError(f"start: no state {unknown[0]!r}; the model has {', '.join(states)}")
    if hasattr(controller, "reset"):
        controller.reset()
    seen = len(states) if n_seen is None else n_seen
    times = np.ascontiguousarray(t, dtype=np.float64)
    initial = [float(given.get(name, 0.0)) for name in states]

    def speak(now: float, y: Array) -> list[float]:
        return [float(value) for value in np.atleast_1d(controller(now, y[:seen]))]

    x, y, u = model._inner.closed_loop(initial, times, speak, tolerance)
    return Loop(readonly(times), x, y, u, states, tuple(control.name for control in model.controls))


def consequence(
    diagnosis: Diagnosis,
    controller: Controller | Union[str, os.PathLike[str]],
    cost: Callable[[Loop], float],
    *,
    t: Sequence[float] | Array,
    start: Mapping[str, float] | None = None,
    observe: Callable[[float, Array], Any] | None = None,
    tolerance: float = 1e-8,
) -> Consequence:
    """What the gap costs a controller, and which cause costs how much.

    The controller runs in the nominal simulator, in the corrected one, and in the corrected one without each cause.

    Parameters
    ----------
    diagnosis : Diagnosis
    controller : callable, or path of an ONNX policy
        ``controller(t, y)`` from the time, s, and what the nominal simulator's sensors read to the controls, held until the
        next time. One that has a method ``reset`` is reset before each rollout. A policy in ONNX needs the package
        ``onnxruntime``; it gets one row of float32, the sensors' readings in the order of the states.
    cost : callable
        ``cost(loop)`` of a :class:`Loop`: the smaller the better.
    t : sequence of float
        Times at which the controller speaks, s, rising.
    start : mapping of str to float, optional
        Where states begin. Default: the model's own initial values, else zero. States that a cause adds begin at zero.
    observe : callable, optional
        ``observe(t, y)``: what a policy in ONNX sees in place of the readings, such as the error of tracking.
    tolerance : float
        Of the integration, relative.

    Returns
    -------
    Consequence

    Raises
    ------
    ValueError
        A diagnosis that does not have its simulators any more, or a cost that is no number.
    NumericalError
        A loop that diverges.
    """
    if diagnosis._nominal is None:
        raise ValueError("this diagnosis does not have its simulators: it was read from a report; diagnose again")
    policy = controller if callable(controller) else _onnx_policy(controller, observe)
    seen = len(diagnosis._nominal.states)
    names = {state.name for state in diagnosis._nominal.states}
    begin = dict(diagnosis._nominal.initial)
    begin.update(start or {})
    unknown = [name for name in begin if name not in names]
    if unknown:
        raise ValueError(f"start: no state {unknown[0]!r}; the simulator has {', '.join(sorted(names))}")

    def judged(model: Model) -> tuple[float, Loop]:
        loop = closed_loop(model, policy, t, begin, n_seen=seen, tolerance=tolerance)
        value = float(cost(loop))
        if not np.isfinite(value):
            raise ValueError(f"cost: expected a number, found {value}")
        return value, loop

    nominal, before = judged(diagnosis._nominal)
    corrected, after = judged(diagnosis.augmented)
    gap = corrected - nominal
    losses = []
    for cause, model in zip(diagnosis.included, diagnosis._without):
        without, _ = judged(model)
        loss = corrected - without
        losses.append(Loss(cause, without, loss, loss / gap if gap else float("nan")))
    losses.sort(key=lambda one: -abs(one.loss))
    return Consequence(nominal, corrected, tuple(losses), (before, after))


def _onnx_policy(path: Any, observe: Callable[[float, Array], Any] | None) -> Controller:
    """A policy of one input and one output row."""
    file = pathlib.Path(os.fspath(path))
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file; hand in a callable or an ONNX policy")
    try:
        import onnxruntime
    except ImportError as missing:
        raise ImportError("an ONNX policy needs the package onnxruntime: pip install onnxruntime") from missing
    session = onnxruntime.InferenceSession(os.fspath(file), providers=["CPUExecutionProvider"])
    name = session.get_inputs()[0].name

    def policy(t: float, y: Array) -> Any:
        seen = np.asarray(y if observe is None else observe(t, y), dtype=np.float32)
        return np.ravel(session.run(None, {name: seen.reshape(1, -1)})[0])

    return policy
