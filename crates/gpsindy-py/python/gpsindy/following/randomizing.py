"""Ranges for domain randomisation out of a diagnosis: as numbers, and as a Python file for mjlab and Isaac Lab.

What the logs identify keeps their error, with what differs from run to run added to it. What would do on these logs what another number does
has no range: both errors together would be twice the machine's. Of the rest, an error that the logs would have shown is left out of its
range, and the rest keeps its prior range.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np

from gpsindy import _gpsindy
from gpsindy.data.dataset import Path
from gpsindy.diagnosis import Diagnosis
from gpsindy.following._events import EVENTS
from gpsindy.model import Model
from gpsindy.parts import Parameter
from gpsindy.stepper import seconds_late

#: Attributes of joints, actuators and bodies that cannot be negative.
_POSITIVE = re.compile(r"\.(frictionloss|damping|armature|stiffness|kp|kv|kd|mass|forcerange|actuatorfrcrange)$")

#: Least and longest time, s, for which a random force of ``FORCES`` stays: longer than a controller's step, far shorter than an episode.
FORCE_HELD = (0.1, 0.5)


@dataclass(frozen=True)
class Range:
    """The range of one number of the simulator.

    Attributes
    ----------
    name : str
        ``JOINT.frictionloss``, ``ACTUATOR.kp``, ``BODY.mass``; a parameter's name where the simulator is equations.
    low, high : float
        In ``unit``; of a delay in seconds.
    unit : str
    nominal : float
        In the nominal simulator.
    identified : bool
        The logs identify it; otherwise it keeps its prior range.
    bounded : bool
        The logs do not identify it, but they narrow its prior range: a larger error would have shown in them.
    """

    name: str
    low: float
    high: float
    unit: str
    nominal: float
    identified: bool
    bounded: bool = False


@dataclass(frozen=True)
class Randomization:
    """Ranges for training; ``print`` it for a table.

    Attributes
    ----------
    ranges : tuple of Range
        Numbers of the simulator.
    delays : tuple of Range
        Delays of commands, s, by their actuators where the simulator has such.
    forces : tuple of Range
        What no cause explains, as a bounded random force on a joint.
    notes : tuple of str
        What is in the corrected simulator and has no range here.
    step : float or None
        The simulator's own step, s; None where it is equations.
    drives : dict of str to str
        Joint of each actuator, where the simulator has actuators.
    gears : dict of str to float
        Gear of each of these actuators.
    """

    ranges: tuple[Range, ...]
    delays: tuple[Range, ...]
    forces: tuple[Range, ...]
    notes: tuple[str, ...]
    step: float | None
    drives: Mapping[str, str] = field(default_factory=dict)
    gears: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Range:
        """A range by its name."""
        for one in (*self.ranges, *self.delays, *self.forces):
            if one.name == name:
                return one
        raise KeyError(name)

    def steps(self, delay: Range) -> tuple[int, int]:
        """A delay in whole steps of the simulator."""
        if not self.step:
            raise ValueError("the simulator is equations and has no step of its own")
        # Rounding must not add a step to a delay of whole steps.
        return max(0, math.floor(delay.low / self.step + 1e-6)), max(0, math.ceil(delay.high / self.step - 1e-6))

    def to_python(self) -> str:
        """A Python file: the ranges as data, and functions that make the events of mjlab and of Isaac Lab from them."""
        lines = ['"""Ranges for domain randomisation, written by gpsindy from a diagnosis of the machine\'s logs."""', ""]

        def table(name: str, ranges: list[Range], comment: str) -> None:
            lines.extend([f"# {comment}", f"{name} = {{"])
            for one in ranges:
                unit = f" {one.unit}" if one.unit else ""
                lines.append(f"    {one.name!r}: ({one.low:.6g}, {one.high:.6g}),  # nominal {one.nominal:.6g}{unit}")
            lines.extend(["}", ""])

        lines.extend(["# In the nominal simulator.", "NOMINAL = {"])
        lines.extend(f"    {one.name!r}: {one.nominal!r}," for one in self.ranges)
        lines.extend(["}", "", "# Joint and gear of each actuator."])
        lines.extend([f"DRIVES = {dict(self.drives)!r}", f"GEARS = {dict(self.gears)!r}", ""])
        bounded = [one for one in self.ranges if one.bounded]
        kept = [one for one in self.ranges if not one.identified and not one.bounded]
        stated = [one for one in self.ranges if one.identified]
        table("IDENTIFIED", stated, "What the logs identify: the estimate with its error, widened where runs disagree.")
        table("BOUNDED", bounded, "What the logs only bound: an error beyond this range would have shown in them.")
        table("PRIOR", kept, "What the logs do not identify: the prior range, unchanged.")
        steps = {one.name: self.steps(one) for one in self.delays} if self.step else {}
        period = f" of {self.step:g} s" if self.step else ""
        lines.extend([f"# Delays of commands in physics steps{period}, fewest and most.", "DELAY_STEPS = {"])
        lines.extend(f"    {name!r}: {span!r}," for name, span in steps.items())
        lines.extend(["}", ""])
        table("FORCES", list(self.forces), "What no cause explains, as a bounded random force: of a joint, low and high.")
        lines.extend(["# Least and longest time for which such a force stays, s.", f"FORCE_HELD = {FORCE_HELD!r}", ""])
        lines.extend(f"# {note}" for note in self.notes)
        return "\n".join([*lines, "", EVENTS])

    def save(self, path: Path) -> None:
        """Writes :meth:`to_python` to a file; whole or not at all."""
        _gpsindy.write_whole(os.fspath(path), self.to_python())

    def __repr__(self) -> str:
        def source(one: Range) -> str:
            return "" if one.identified else "  (bounded by the logs)" if one.bounded else "  (prior)"

        rows = (*self.ranges, *self.delays, *self.forces)
        return "\n".join(f"{one.name}: {one.low:.4g} to {one.high:.4g} {one.unit}{source(one)}" for one in rows)


def randomization(
    diagnosis: Diagnosis,
    *,
    prior: Mapping[str, tuple[float, float]] | None = None,
    share: float = 0.3,
    confidence: float = 0.95,
) -> Randomization:
    """Ranges for training from a diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
    prior : mapping of str to (float, float), optional
        Ranges of numbers that the logs do not identify.
    share : float, default 0.3
        The prior range of all others, above and below their nominal value, as a share of it. Where the logs exclude an error
        that the prior range holds, the range ends there. A number that is 0 and that the logs do not bound has no range.
    confidence : float, default 0.95
        That the true value lies in its range, where the logs identify it.

    Returns
    -------
    Randomization

    Raises
    ------
    ValueError
        A diagnosis without its simulators, an unknown name, a share or confidence out of range.
    """
    if diagnosis._open is None or diagnosis._nominal is None:
        raise ValueError("this diagnosis does not have its simulators: it was read from a report; diagnose again")
    if not 0.5 <= confidence < 1.0:
        raise ValueError(f"confidence: expected 0.5 to 1, found {confidence}")
    if not share >= 0.0:
        raise ValueError(f"share: expected at least 0, found {share}")
    given = dict(prior or {})
    source = diagnosis.augmented._source
    nominal = {p.name: p for p in diagnosis._nominal.parameters}
    unknown = [name for name in given if name not in nominal]
    if unknown:
        raise ValueError(f"prior: no parameter {unknown[0]!r}; the simulator has {', '.join(nominal)}")
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence) * _disagreement(diagnosis)
    values, deviations = _spread(diagnosis)
    for key, between in _between_runs(diagnosis).items():
        if deviations.get(key, 0.0) > 0.0:
            deviations[key] = math.hypot(deviations[key], between)
    excluded, twins = _excluded(diagnosis), _twins(diagnosis)
    ranges, notes = [], []
    # A delay is an actuator's, whatever its column is called.
    acting: Mapping[str, str] = getattr(source, "_acting", {})
    late = {f"{actuator}.delay" for actuator in acting.values()}
    for name, parameter in nominal.items():
        if name in late:
            continue
        value, deviation = values.get(("parameter", name), parameter.value), deviations.get(("parameter", name), 0.0)
        if deviation > 0.0:
            low, high = value - z * deviation, value + z * deviation
            low = max(low, 0.0) if _POSITIVE.search(name) else low
            ranges.append(Range(name, low, high, parameter.unit, parameter.value, True))
            continue
        if name in twins and name not in given:
            notes.append(f"No range: {name} does on these logs what {twins[name]} does, which has one; both together would double the error.")
            continue
        one = _untold(name, parameter, given.get(name), share, excluded.get(name))
        if one is None:
            notes.append(f"No range: {name} is 0 in the simulator and the logs do not bound it; prior={{{name!r}: (0, ...)}} gives it one.")
        else:
            ranges.append(one)
    delays = []
    for (kind, name), value in values.items():
        if kind == "delay":
            actuator, deviation = acting.get(name, name), deviations.get((kind, name), 0.0)
            own = nominal.get(f"{actuator}.delay")
            stated = deviation > 0.0 or own is None
            reach = z * deviation if stated else share * value
            delays.append(Range(actuator, max(value - reach, 0.0), value + reach, "s", own.value if own else 0.0, stated))
    notes = [*(f"Not a range of a simulator's field: {note}" for note in _notes(diagnosis)), *notes]
    return Randomization(
        tuple(ranges),
        tuple(delays),
        _forces(diagnosis),
        tuple(notes),
        getattr(source, "_period", None),
        getattr(source, "_drives", {}),
        getattr(source, "_gears", {}),
    )


def _untold(
    name: str, parameter: Parameter, given: tuple[float, float] | None, share: float, excluded: float | None
) -> Range | None:
    """The range of a number that the logs do not identify: the prior one, up to where they exclude an error. None if nothing says it."""
    value, unit = parameter.value, parameter.unit
    wide = share * abs(value)
    low, high = given or (value - wide, value + wide)
    if given is None and not wide > 0.0:
        if excluded is None:
            return None
        low, high = -math.inf, math.inf
    bounded = excluded is not None and (low < value - excluded or value + excluded < high)
    if bounded and excluded is not None:
        # A prior range without the nominal value stays if all of it is excluded: the user knows more than these logs.
        narrow = max(low, value - excluded), min(high, value + excluded)
        bounded = narrow[0] < narrow[1]
        low, high = narrow if bounded else (low, high)
    low = max(low, 0.0) if _POSITIVE.search(name) else low
    return Range(name, float(low), float(high), unit, value, False, bounded)


def _number(diagnosis: Diagnosis, effect: str, place: str | None, variables: Sequence[str]) -> str | None:
    """The number of the simulator that an effect changes, where it changes one."""
    if effect == "parameter_error" and variables:
        return variables[0]
    carried: Mapping[tuple[str, str], str] = getattr(diagnosis.augmented._source, "_carried", {})
    return carried.get((effect, place or ""))


def _excluded(diagnosis: Diagnosis) -> dict[str, float]:
    """Sizes of errors of the simulator's numbers above which the logs would have shown them."""
    found: dict[str, float] = {}
    for row in diagnosis._report["excluded"]:
        name = _number(diagnosis, row["effect"], row.get("place"), row.get("variables", ()))
        if name is not None:
            found[name] = max(found.get(name, 0.0), float(row["above"]))
    return found


def _twins(diagnosis: Diagnosis) -> dict[str, str]:
    """Numbers of the simulator that would do as well as the one that a cause changes, and that one."""
    found: dict[str, str] = {}
    for cause in diagnosis.included:
        own = _number(diagnosis, cause.effect, cause.place, cause.variables)
        for twin in cause.twins:
            name = _number(diagnosis, twin["effect"], twin.get("place"), twin["variables"])
            if own is not None and name is not None and name != own:
                found[name] = own
    return found


def _between_runs(diagnosis: Diagnosis) -> dict[tuple[str, str], float]:
    """How far a number of the simulator, or a delay, differs from run to run: a deviation beside that of the fit."""
    found: dict[tuple[str, str], float] = {}
    for cause in diagnosis.included:
        is_late = cause.effect == "input_delay"
        name = cause.variables[0] if is_late else _number(diagnosis, cause.effect, cause.place, cause.variables)
        if cause.between_runs and name is not None:
            found["delay" if is_late else "parameter", name] = float(cause.between_runs[0]["spread"])
    return found


def _disagreement(diagnosis: Diagnosis) -> float:
    """How much wider errors are where the causes' sizes disagree between runs: the Birge ratio of the least likely cause.

    A cause with sizes by run has the spread itself instead.
    """
    widest = 1.0
    for cause in diagnosis.included:
        stated = None if cause.between_runs else cause.stability
        if stated and stated["runs"] > 1 and stated["p_value"] < 0.5:
            degrees = stated["runs"] - 1
            quantile = NormalDist().inv_cdf(1.0 - max(stated["p_value"], 1e-12))
            # Wilson and Hilferty's approximation of the chi-square quantile.
            squares = degrees * (1.0 - 2.0 / (9.0 * degrees) + quantile * math.sqrt(2.0 / (9.0 * degrees))) ** 3
            widest = max(widest, math.sqrt(squares / degrees))
    return widest


def _spread(diagnosis: Diagnosis) -> tuple[dict[tuple[str, str], float], dict[tuple[str, str], float]]:
    """Values of what goes into the simulator in the corrected model, and the deviations that the logs leave of them."""
    assert diagnosis._open is not None
    names, _, covariance = diagnosis._open.sizes
    augmented = diagnosis.augmented
    base = _inputs(augmented)
    own = {p.name: p.value for p in augmented.parameters}
    slopes: dict[tuple[str, str], np.ndarray[Any, Any]] = {}
    for place, name in enumerate(names):
        if name not in own:
            # No cause was included, so the corrected model is the nominal one.
            continue
        change = 1e-4 * max(abs(own[name]), math.sqrt(covariance[place][place]), 1e-9)
        moved = _inputs(augmented.with_parameters(**{name: own[name] + change}))
        for key, value in moved.items():
            if key in base and value != base[key]:
                slopes.setdefault(key, np.zeros(len(names)))[place] = (value - base[key]) / change
    matrix = np.array(covariance).reshape(len(names), len(names))
    return base, {key: math.sqrt(max(float(slope @ matrix @ slope), 0.0)) for key, slope in slopes.items()}


def _inputs(model: Model) -> dict[tuple[str, str], float]:
    """Parameters and delays of commands, as numbers."""
    found: dict[tuple[str, str], float] = {}
    if not model._inner.calls_simulator:
        found.update({("parameter", p.name): p.value for p in model.parameters})
        known = {p.name: p.value for p in model.parameters}
        for control in model.controls:
            for state in model.states:
                late = re.search(rf"delay\({re.escape(control.name)}, ([^()]+)\)", state.equation)
                if late:
                    text = late.group(1).strip()
                    found["delay", control.name] = known[text] if text in known else float(text)
        return found
    for kind, name, expression, value in model._inner.simulator_inputs():
        if kind == "parameter" and value is not None:
            found[kind, name] = value
        seconds = seconds_late(expression, name) if kind == "command" else None
        if seconds:
            found["delay", name] = seconds
    return found


def _forces(diagnosis: Diagnosis) -> tuple[Range, ...]:
    """What is left, where it is more than noise: twice its root mean square, as a force where the simulator has forces."""
    report = diagnosis._report
    left = report["unexplained"]
    if left["probability"] < 0.5 or not left["share"] > 0.0:
        return ()
    source = diagnosis.augmented._source
    inertia = getattr(source, "_inertia", None)
    if inertia is None:
        return ()
    found = []
    for row in report["gap"]["by_state"]:
        if row["state"] in inertia:
            name, mass, unit = inertia[row["state"]]
            size = 2.0 * math.sqrt(left["share"]) * row["residual_rms"] * mass
            found.append(Range(name, -size, size, unit, 0.0, True))
    return tuple(found)


def _notes(diagnosis: Diagnosis) -> list[str]:
    """Corrections that are neither a number of the simulator nor a delay."""
    augmented = diagnosis.augmented
    # A force that is a number of the simulator, such as friction in a joint, does not act at its port.
    inputs = augmented._inner.simulator_inputs() if augmented._inner.calls_simulator else []
    idle = {name for kind, name, expression, _ in inputs if kind == "force" and expression == "0"}
    notes = []
    for cause in diagnosis.included:
        sizes = ", ".join(f"{p['name']} = {p['value']:.4g} {p['unit']}".strip() for p in cause.parameters)
        if cause.effect not in ("parameter_error", "input_delay") and cause.place not in idle:
            notes.append(f"{cause.effect} at {cause.place or cause.state}: {cause.form} with {sizes}")
    return notes
