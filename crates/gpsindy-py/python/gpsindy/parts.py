"""The parts of a model: its states, controls, ports and parameters, and the record of its identification."""

from __future__ import annotations

from dataclasses import dataclass, field

from gpsindy.data._tables import Array


@dataclass(frozen=True)
class State:
    """A state: its name, how it changes, and what its column reads.

    Attributes
    ----------
    name, unit : str
    equation : str
        Right side of its differential equation, in its unit per second.
    measured : str or None
        What the log's column reads; None: the state itself.
    """

    name: str
    unit: str
    equation: str
    measured: str | None


@dataclass(frozen=True)
class Control:
    """A control: an input that the log carries."""

    name: str
    unit: str


@dataclass(frozen=True)
class Port:
    """A place where a force that nobody modelled may act, zero in the model.

    Attributes
    ----------
    name : str
    variable : str
        The state that moves there.
    unit : str
    position : str or None
        The state that is its position.
    """

    name: str
    variable: str
    unit: str
    position: str | None


@dataclass(frozen=True)
class Parameter:
    """A parameter.

    Attributes
    ----------
    name : str
    value : float
    unit : str
    tolerance : float or None
        Relative 1-sigma belief; None: taken as exact.
    """

    name: str
    value: float
    unit: str
    tolerance: float | None


@dataclass(frozen=True)
class Identification:
    """How a model was learnt.

    Attributes
    ----------
    terms : tuple of str
        The library, in order.
    coefficients, standard_errors : ndarray of shape (n_states, n_terms)
    inclusion_probabilities : ndarray of shape (n_states, n_terms) or None
        Where an ensemble was run.
    lam : ndarray of shape (n_states,)
        Tuning value of the sparse regression.
    """

    terms: tuple[str, ...]
    coefficients: Array
    standard_errors: Array
    inclusion_probabilities: Array | None
    lam: Array = field(repr=False)
