"""Simulators that step: any function from a state to the next one."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data._tables import Array
from gpsindy.model import Model

Step = Callable[..., Any]
"""``step(x, u, force, parameters, dt)`` to the next states."""


class Stepper:
    """A simulator that makes its own steps, in place of a model.

    ``x' = step(x, u, force, parameters, dt)``. Effects act in four places: on the command before it, as a force, on a
    parameter, and at the sensors after it; the function itself is never looked into.

    Parameters
    ----------
    step : callable
        Next states, from states ``x`` (n_states,), commands ``u`` (n_controls,), forces (n_forces,) and parameters
        (n_parameters,), ``dt`` seconds later. ``dt`` is never longer than the one below: a sample's period is walked in
        whole steps, and where it is no whole number of them the last step is shortened. Nothing may be remembered between
        two calls. What it raises is passed on unchanged.
    states, controls : sequence of str
        Names, in the order of ``x`` and ``u``.
    dt : float
        The simulator's own step, s.
    parameters : mapping of str to float, or to (value, lowest, highest), optional
        What may be wrong in the simulator itself. A value that does not move a state is no suspect.
    forces : mapping of str to str, or to (str, str), optional
        Places where a force that nobody modelled may act: for each the state that moves there, or that and its position.
        ``{"tau_1": ("w1", "th1")}``.
    kinematic : mapping of str to str, optional
        ``{"x": "v"}`` says that state ``v`` is the time derivative of state ``x``. With it, ``v`` may be missing in logs.
    vectorized : bool
        The function takes many rows at once: ``x`` (n, n_states) and so on, to (n, n_states). Far faster where it is numpy
        code or an engine that steps many copies.
    units : mapping of str to str, optional
        Of states, controls, forces and parameters.
    initial : mapping of str to float, optional
        Default initial state.
    name : str, optional

    Examples
    --------
    >>> import gpsindy
    >>> def step(x, u, force, parameters, dt):
    ...     return [x[0] + dt * (u[0] + force[0] - parameters[0] * x[0])]
    >>> cart = gpsindy.Stepper(step, ["v"], ["u"], 0.01, parameters={"drag": 0.5}, forces={"f": "v"})
    >>> run = cart.model.simulate([1.0], [0.0, 0.02], u=[0.0, 0.0])
    >>> run["v"]
    array([1.      , 0.990025])
    """

    def __init__(
        self,
        step: Step,
        states: Sequence[str],
        controls: Sequence[str] = (),
        dt: float = 0.01,
        *,
        parameters: Mapping[str, float | tuple[float, float, float]] | None = None,
        forces: Mapping[str, str | tuple[str, str]] | None = None,
        kinematic: Mapping[str, str] | None = None,
        vectorized: bool = False,
        units: Mapping[str, str] | None = None,
        initial: Mapping[str, float] | None = None,
        name: str = "simulator",
    ) -> None:
        if not callable(step):
            raise ValueError(f"step: expected a callable step(x, u, force, parameters, dt), found {type(step).__name__}")
        unit = dict(units or {})
        ports: list[tuple[str, str, str, str | None, list[Any]]] = []
        for port, place in (forces or {}).items():
            variable, position = (place, None) if isinstance(place, str) else place
            ports.append((port, variable, unit.get(port, ""), position, []))
        values = []
        for parameter, value in (parameters or {}).items():
            number, span = (value[0], (float(value[1]), float(value[2]))) if isinstance(value, tuple) else (value, None)
            values.append((parameter, float(number), unit.get(parameter, ""), None, span, None))
        self._model = stepping_model(
            step if vectorized else _by_rows(step),
            name,
            dt,
            states=[(state, unit.get(state, "")) for state in states],
            controls=[(control, unit.get(control, "")) for control in controls],
            kinematic=list((kinematic or {}).items()),
            ports=ports,
            parameters=values,
            initial=[(state, float(value)) for state, value in (initial or {}).items()],
            measured=[],
        )

    @property
    def model(self) -> Model:
        """The simulator as a model: names, rollouts, scores."""
        return self._model

    def _as_model(self) -> Model:
        return self._model

    def __repr__(self) -> str:
        states = ", ".join(state.name for state in self._model.states)
        return f"Stepper {self._model.name!r} of {states}"


def stepping_model(
    step: Step, name: str, dt: float, *, source: Any = None, several: bool = False, copies: Any = None, **parts: Any
) -> Model:
    """A model around a step function of many rows; ``source`` can write a corrected model in its own format. With ``several`` the function
    takes commands and forces of many samples, (n, samples, ...), and as its last argument the number of steps of each, to states (n, samples,
    n_states); ``dt`` may be one a row. Native ``copies`` make the steps in place of the function, an FMU's unless they are long."""
    return Model._of(_gpsindy.Model.from_stepper(step, name, float(dt), {"delays": [], **parts}, several, copies), source)


def seconds_late(expression: str, name: str) -> float | None:
    """How much later ``delay(name, a)`` is than ``name``, s; delays of delays add up. None where it is something else."""
    if expression == name:
        return 0.0
    found = re.fullmatch(r"delay\((.*), ([0-9.e+-]+)\)", expression)
    inner = None if found is None else seconds_late(found.group(1), name)
    return None if found is None or inner is None else inner + float(found.group(2))


def _by_rows(step: Step) -> Step:
    """A function of one row as one of many."""

    def rows(x: Array, u: Array, force: Array, parameters: Array, dt: float) -> Array:
        found = np.empty_like(x)
        for i in range(len(x)):
            answer = np.asarray(step(x[i], u[i], force[i], parameters[i], dt), dtype=np.float64)
            if answer.shape != (x.shape[1],):
                raise ValueError(
                    f"simulator: step must return the next {x.shape[1]} states as a 1-D array, found shape {answer.shape}"
                )
            found[i] = answer
        return found

    return rows
