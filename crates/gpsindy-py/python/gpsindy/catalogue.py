"""The effects that a diagnosis may name: those of the catalogue, and the user's own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field

from gpsindy import _gpsindy
from gpsindy.data.dataset import Path


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue.

    Attributes
    ----------
    id : str
    form : str
        What it adds to the right side of the state's equation, or does to the control or the sensor.
    parameters : str
        Its parameters in words.
    signature : str
        What it looks like in a log.
    name : str
        Its name in everyday words.
    meaning : str
        What it does, for a reader who meets it first.
    twins : tuple of (str, str)
        Ids of the effects that logs may not distinguish from it, each with the experiment that would.
    """

    id: str
    form: str
    parameters: str
    signature: str
    name: str = ""
    meaning: str = ""
    twins: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class CustomEffect:
    """A custom effect, added to the right side of an equation.

    Attributes
    ----------
    id : str
        Its id in the report.
    state : str
        The state in whose equation it acts.
    form : str
        What is added, in the names of the model and of its own parameters.
    parameters : mapping of str to (float, float)
        Its parameters and their ranges; the first one that is free of sign scales the effect.
    units : mapping of str to str
        Units of the parameters, for the report.
    """

    id: str
    state: str
    form: str
    parameters: Mapping[str, tuple[float, float]]
    units: Mapping[str, str] = field(default_factory=dict)

    def _entry(self) -> tuple[str, str, str, list[tuple[str, float, float, str]]]:
        ranges = [(n, float(low), float(high), self.units.get(n, "")) for n, (low, high) in self.parameters.items()]
        return (self.id, self.state, self.form, ranges)


def read_effects(path: Path) -> tuple[CustomEffect, ...]:
    """Custom effects from the ``[[effect]]`` entries of a TOML file."""
    found = _gpsindy.read_effects(os.fspath(path))
    return tuple(
        CustomEffect(
            id, state, form, {n: (low, high) for n, low, high, _ in ranges}, {n: unit for n, _, _, unit in ranges if unit}
        )
        for id, state, form, ranges in found
    )


def effects() -> tuple[Effect, ...]:
    """The catalogue of effects.

    Examples
    --------
    >>> import gpsindy
    >>> gpsindy.effects()[1].id
    'bias'
    """
    return tuple(Effect(*entry[:6], twins=tuple(entry[6])) for entry in _gpsindy.effects())
