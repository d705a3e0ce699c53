"""One instance of an FMU, with parameters of its own; FMI 2 and 3, model exchange and co-simulation behind the same words."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from gpsindy.data._tables import Array

Kind = Literal["model exchange", "co-simulation"]

#: Share of a step by which the time that a co-simulation reached may miss it: rounding.
_ROUNDING = 1e-6

#: Parts of a step to which an event is located; the flow between two events is smooth, so halving it is enough.
_LOCATED = 1e-9

#: Events in one step, above which they are taken to accumulate, as the bounces of a ball at rest do.
_MOST_EVENTS = 100


class Instance:
    """An instance that makes single steps, each from a state of its own.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    folder : str
        Where the FMU is unpacked.
    kind : Kind
    references : list of list of int
        Value references of states, controls, ports and parameters.
    parameters : ndarray
        Values of the parameters.
    """

    def __init__(self, description: Any, folder: str, kind: Kind, references: list[list[int]], parameters: Array) -> None:
        from fmpy.simulation import instantiate_fmu

        self.two = description.fmiVersion.startswith("2")
        self.exchange = kind == "model exchange"
        self.states, controls, ports, self.own = references
        self.inputs = [*controls, *ports]
        self.parameters = [float(value) for value in parameters]
        self.name = description.modelName
        clock = [v for v in description.modelVariables if v.causality == "independent" and v.type in ("Real", "Float64")]
        self.clock = [v.valueReference for v in clock]
        self.slopes = [unknown.variable.valueReference for unknown in description.derivatives]
        self.indicators = int(description.numberOfEventIndicators or 0)
        words = "ModelExchange" if self.exchange else "CoSimulation"
        self.fmu = instantiate_fmu(folder, description, words, require_functions=False)
        if self.exchange:
            double = ctypes.c_double * len(self.states)
            self.x, self.dx = double(), double()
            self.z = (ctypes.c_double * self.indicators)()
            self.begin()
            self.settle()
            self.fmu.enterContinuousTimeMode()

    def set(self, references: list[int], values: Sequence[float]) -> None:
        if references:
            (self.fmu.setReal if self.two else self.fmu.setFloat64)(references, values)

    def get(self, references: list[int]) -> list[float]:
        return [float(value) for value in (self.fmu.getReal if self.two else self.fmu.getFloat64)(references)]

    def begin(self, x: Array | None = None, inputs: Sequence[float] = ()) -> None:
        """Initialises with the parameters, from start values where they are given."""
        if self.two:
            self.fmu.setupExperiment(startTime=0.0)
        self.set(self.own, self.parameters)
        if x is not None:
            self.set(self.states, [float(value) for value in x])
        self.fmu.enterInitializationMode()
        if x is not None:
            self.set(self.inputs, [float(value) for value in inputs])
        self.fmu.exitInitializationMode()

    def settle(self) -> None:
        """Repeats events until there is none.

        Raises
        ------
        ValueError
            An event in time: a step that begins anywhere knows no time.
        """
        for _ in range(_MOST_EVENTS):
            again, _, _, _, timed, _ = self.fmu.newDiscreteStates() if self.two else self.fmu.updateDiscreteStates()
            if timed:
                raise ValueError(f"{self.name}: has events at set times, which a step from any state does not know; export it without")
            if not again:
                return

    def step(self, x: Array, inputs: Sequence[float], dt: float) -> Array:
        """States ``dt`` s after ``x``, the inputs held."""
        if not self.exchange:
            return self.co_simulated(x, inputs, dt)
        if self.indicators:
            return self.through_events(x, inputs, dt)
        self.fmu.setTime(0.0)
        self.set(self.inputs, [float(value) for value in inputs])
        return self.flown(x, dt)

    def co_simulated(self, x: Array, inputs: Sequence[float], dt: float) -> Array:
        """
        Raises
        ------
        ValueError
            The FMU did not go so far, as its own steps are longer.
        """
        self.fmu.reset()
        self.begin(x, inputs)
        slopes = np.array(self.get(self.slopes)) if not self.clock else np.zeros(0)
        self.fmu.doStep(0.0, dt)
        found = np.array(self.get(self.states))
        # A slope that moves no state is of an FMU that made no step; how far it went its own clock says, where it has one.
        stuck = bool(np.any((found == x) & (np.abs(slopes) * dt > _ROUNDING * np.abs(x)))) if len(slopes) == len(x) else False
        reached = self.get(self.clock)[0] if self.clock else (0.0 if stuck else dt)
        if abs(reached - dt) > _ROUNDING * dt:
            raise ValueError(
                f"{self.name}: asked for a step of {dt:g} s, the FMU went {reached:g} s: its own steps are longer. Hand in dt as a "
                "whole number of them, logs whose period is a whole number of dt, or use the FMU as model exchange"
            )
        return found

    def through_events(self, x: Array, inputs: Sequence[float], dt: float) -> Array:
        """A step of model exchange from event to event.

        What an FMU keeps in addition to its states, such as the side of a contact, follows from the state at the step's beginning.
        """
        self.fmu.reset()
        self.begin()
        self.settle()
        self.fmu.enterContinuousTimeMode()
        self.fmu.setTime(0.0)
        self.set(self.inputs, [float(value) for value in inputs])
        x = self.after_event(x)
        left = dt
        for _ in range(_MOST_EVENTS):
            before = self.signs(x)
            found = self.flown(x, left)
            if bool(np.all(self.signs(found) == before)):
                return found
            # Behind the event, where its condition holds.
            low, high = 0.0, 1.0
            while high - low > _LOCATED:
                middle = 0.5 * (low + high)
                is_before = bool(np.all(self.signs(self.flown(x, middle * left)) == before))
                low, high = (middle, high) if is_before else (low, middle)
            x = self.after_event(self.flown(x, high * left))
            left *= 1.0 - high
        return x

    def signs(self, x: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Signs of the event indicators."""
        self.put(x)
        self.fmu.getEventIndicators(self.z, self.indicators)
        return np.array(self.z) > 0.0

    def after_event(self, x: Array) -> Array:
        """The state that an event makes of ``x``, where there is one."""
        self.put(x)
        self.fmu.enterEventMode()
        self.settle()
        self.fmu.enterContinuousTimeMode()
        self.fmu.getContinuousStates(self.x, len(self.states))
        return np.array(self.x)

    def flown(self, x: Array, dt: float) -> Array:
        """A step of Runge-Kutta of order 4."""
        first = self.rates(x)
        second = self.rates(x + 0.5 * dt * first)
        third = self.rates(x + 0.5 * dt * second)
        fourth = self.rates(x + dt * third)
        found: Array = x + dt / 6 * (first + 2 * second + 2 * third + fourth)
        return found

    def put(self, x: Array) -> None:
        self.x[:] = x.tolist()
        self.fmu.setContinuousStates(self.x, len(self.states))

    def rates(self, x: Array) -> Array:
        self.put(x)
        (self.fmu.getDerivatives if self.two else self.fmu.getContinuousStateDerivatives)(self.dx, len(self.states))
        return np.array(self.dx)

    def free(self) -> None:
        self.fmu.freeInstance()
