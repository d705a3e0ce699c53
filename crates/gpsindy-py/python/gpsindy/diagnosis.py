"""The diagnosis of the gap between a simulator and the logs of the machine."""

from __future__ import annotations

import html
import json
import os
import pathlib
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gpsindy import _gpsindy
from gpsindy._tables import names_of
from gpsindy.dataset import Path, as_dataset
from gpsindy.model import Hold, Model, Progress, Simulator, as_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gpsindy.estimator import GPSINDy


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
    """

    id: str
    form: str
    parameters: str
    signature: str


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


@dataclass(frozen=True)
class Cause:
    """One candidate cause of a gap.

    Attributes
    ----------
    effect : str
        Id of the catalogue.
    state : str
        The state in whose equation, or in whose column, it acts; for an effect at a place, the one that it moves most.
    variables : tuple of str
        What it depends on.
    included : bool
        It is part of the augmented model.
    probability : float
    form : str
        What it adds to the equation, or becomes, with the names of ``parameters``.
    parameters : tuple of dict
        ``name``, ``value``, ``low``, ``high``, ``unit``.
    equivalent : tuple of str
        Effects that these logs cannot distinguish from this one.
    next_experiment : str or None
        The experiment that would.
    stability : dict or None
        Whether its size agrees between parts of the logs: ``runs`` (the parts), ``agree``, ``p_value``, and in ``disagree`` the
        parts that do not.
    place : str or None
        The port or control at which it acts, where it does not act in the state's equation alone.
    """

    effect: str
    state: str
    variables: tuple[str, ...]
    included: bool
    probability: float
    form: str
    parameters: tuple[dict[str, Any], ...] = field(hash=False)
    equivalent: tuple[str, ...]
    next_experiment: str | None
    stability: dict[str, Any] | None = field(default=None, hash=False)
    place: str | None = None


class Diagnosis:
    """What a diagnosis found; its text is a screenful for people, its JSON follows ``gpsindy.diagnosis/1``."""

    __slots__ = ("_augmented", "_figures", "_report", "_text")

    def __init__(self, report: str, augmented: Model) -> None:
        self._text = report
        self._report: dict[str, Any] = json.loads(report)
        # The curves of the page are no part of the report: they may change in any version.
        self._figures: dict[str, Any] = self._report.pop("figures", None) or {}
        self._augmented = augmented

    @property
    def verdict(self) -> str:
        """``no_gap``, ``explained``, ``partly_explained`` or ``unexplained``."""
        return str(self._report["verdict"])

    @property
    def p_value(self) -> float:
        """Of the hypothesis that the nominal model plus noise explains the logs."""
        return float(self._report["gap"]["p_value"])

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Candidate causes, best first."""
        return tuple(
            Cause(
                **{
                    **cause,
                    "variables": tuple(cause["variables"]),
                    "parameters": tuple(cause["parameters"]),
                    "equivalent": tuple(cause["equivalent"]),
                }
            )
            for cause in self._report["causes"]
        )

    @property
    def included(self) -> tuple[Cause, ...]:
        """The causes that make up the augmented model."""
        return tuple(cause for cause in self.causes if cause.included)

    @property
    def closure(self) -> dict[str, Any]:
        """How far the included causes close the gap on held-out logs."""
        return dict(self._report["closure"])

    @property
    def parameters(self) -> tuple[dict[str, Any], ...]:
        """Parameters of the augmented model: ``name``, ``nominal`` (None: a cause brought it), ``value``, ``deviation``, ``unit``."""
        return tuple(dict(row) for row in self._report.get("parameters", []))

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the result."""
        return tuple(self._report["notes"])

    @property
    def power(self) -> dict[str, Any] | None:
        """Which effects these logs could reveal, where ``diagnose(..., power=True)`` asked for it.

        ``effects`` lists every planted effect with ``named_from`` and ``detected_from`` (the smallest sizes tried that were named,
        or seen as a gap, in every copy; None: at none), ``group`` (what it could not be told from) and ``confused_with``;
        ``null`` counts the alarms in copies without any effect.
        """
        found: dict[str, Any] | None = self._report.get("power")
        return found

    @property
    def augmented(self) -> Model:
        """The nominal model with the included causes added."""
        return self._augmented

    def to_dict(self) -> dict[str, Any]:
        """The whole report."""
        found: dict[str, Any] = json.loads(self.to_json())
        return found

    def to_json(self) -> str:
        """The whole report as JSON, the same as the command line's ``report.json``."""
        return _gpsindy.report_json(self._text)

    def html(self) -> str:
        """The report as one self-contained page."""
        return _gpsindy.render(self._text)

    def summary(self, width: int = 100, *, colour: bool = False) -> str:
        """A screenful of text."""
        return _gpsindy.summary(self._text, width, colour)

    def save(self, directory: Path) -> None:
        """Writes ``report.json``, ``report.html`` and, where the model has a file, ``augmented.toml``."""
        folder = pathlib.Path(os.fspath(directory))
        folder.mkdir(parents=True, exist_ok=True)
        files = {"report.json": self.to_json(), "report.html": self.html()}
        if not self._augmented._inner.calls_simulator:
            files["augmented.toml"] = _gpsindy.augmented_toml(self._text, self._augmented.to_toml())
        for name, text in files.items():
            _gpsindy.write_whole(os.fspath(folder / name), text)

    def plot(self, **options: Any) -> Figure:
        """Rollouts, residuals or the gap of each equation; see :func:`gpsindy.plot.diagnosis`. Needs matplotlib."""
        from gpsindy import plot

        return plot.diagnosis(self, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return (Diagnosis, (self._text, self._augmented))

    def __repr__(self) -> str:
        return self.summary(shutil.get_terminal_size((100, 24)).columns)

    def _repr_html_(self) -> str:
        # A frame of its own, so that the page's style stays inside it.
        page = html.escape(self.html(), quote=True)
        return f'<iframe srcdoc="{page}" title="gpsindy diagnosis" width="100%" height="720" style="border:0"></iframe>'


def diagnose(
    model: Model | GPSINDy | Path | Simulator | None,
    logs: Any,
    holdout: Any = None,
    *,
    simulated: Any = None,
    states: Sequence[str] | None = None,
    controls: Sequence[str] = (),
    kinematic: Mapping[str, str] | None = None,
    vectorized: bool = False,
    effects: str | Iterable[str] = (),
    custom: Iterable[CustomEffect] = (),
    confidence: float = 0.95,
    most_effects: int = 6,
    hold: Hold | None = None,
    keep_function: bool = False,
    time_limit: float | None = 600.0,
    power: bool = False,
    seed: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find where a simulator differs from the machine, which effect causes it, and how much a correction helps.

    Parameters
    ----------
    model : Model, path of a model file, fitted GPSINDy, callable or None
        The nominal simulator; a callable ``f(t, x, u)`` needs ``states`` and ``controls``. With ``simulated``: None, or a GPSINDy
        with the settings for identifying a model from the simulated logs.
    logs : Dataset, paths of CSV files, frame or list of frames
        The real logs, with the model's controls and states as columns.
    holdout : as logs, optional
        Logs for validation only, never for a fit or a selection. Default: the last quarter of the runs; of a single run, its last quarter
        in time.
    simulated : as logs, optional
        Logs of a simulator that is neither equations nor callable, preferably of the same runs as the real ones; name ``states`` and
        ``controls``. A model is first identified from them. It must explain 99 % of held-out simulated logs, and its error there
        does not count as a gap.
    states, controls, kinematic, vectorized
        For a callable, as in :meth:`Model.from_callable`.
    effects : str or sequence of str
        Ids of the effects to test; ``!`` before an id leaves it out. Default: the whole catalogue, see :func:`effects`.
    custom : sequence of CustomEffect
        Custom effects to test.
    confidence : float
        Confidence level of the intervals, 0.5 to 0.999; no test and no verdict depends on it.
    most_effects : int
        Largest number of effects in one explanation, 1 to 6; never more than four in one equation.
    hold : {"zero", "linear"}, optional
        How controls behave between samples. Default: estimated.
    time_limit : float or None, default 600
        Seconds after which the search stops with the best result so far and says so; ``None``: no limit.
    keep_function : bool
        Add the part that no effect explains to the augmented model, as a fitted function.
    power : bool
        Also study which effects these logs could reveal, see :attr:`Diagnosis.power`: each is added to simulated copies of the
        logs. Takes a hundred times as long as the diagnosis.
    seed : int
        Seed of the noise in that study.
    progress : callable, optional
        Called with (stage, done, total).

    Returns
    -------
    Diagnosis

    Raises
    ------
    ValueError
        Logs without a column that the model needs, or a setting out of range.
    NumericalError
        A nominal model that diverges from every initial state.
    """
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed: expected an integer of at least 0, found {seed!r}")
    chosen = names_of(effects)
    options = {
        "effects": [name for name in chosen if not name.startswith("!")],
        "without": [name[1:] for name in chosen if name.startswith("!")],
        "custom": [effect._entry() for effect in custom],
        "confidence": confidence,
        "most_effects": most_effects,
        "hold": hold,
        "keep_function": keep_function,
        "time_limit": None if time_limit is None else float(time_limit),
        "power": int(seed) if power else None,
    }
    train = as_dataset(logs)._inner
    held = None if holdout is None else as_dataset(holdout, "holdout")._inner
    if simulated is not None:
        identify = _identify_settings(model, states, controls)
        paired = as_dataset(simulated, "simulated")._inner
        report, augmented = _gpsindy.diagnose_paired(paired, identify, train, held, options, progress)
        return Diagnosis(report, Model._of(augmented))
    if callable(model):
        if states is None:
            raise ValueError("states: a callable needs the names of its states (and of its controls, where it has any)")
        nominal = Model.from_callable(model, states, controls, kinematic=kinematic, vectorized=vectorized)
    else:
        nominal = as_model(model)
    report, augmented = _gpsindy.diagnose(nominal._inner, train, held, options, progress)
    return Diagnosis(report, Model._of(augmented, nominal._source))


def _identify_settings(model: Any, states: Sequence[str] | None, controls: Sequence[str]) -> dict[str, Any]:
    from gpsindy._layout import Layout
    from gpsindy.estimator import GPSINDy

    estimator = GPSINDy() if model is None else model
    if not isinstance(estimator, GPSINDy):
        kind = type(model).__name__
        raise ValueError(f"simulated: in place of the model hand in None or a GPSINDy with settings, found {kind}")
    if states is None:
        raise ValueError("states: simulated logs need the names of their states (and of their controls, where they have any)")
    return estimator._settings(Layout(names_of(states), names_of(controls), []))


def effects() -> tuple[Effect, ...]:
    """The catalogue of effects.

    Examples
    --------
    >>> import gpsindy
    >>> gpsindy.effects()[1].id
    'bias'
    """
    return tuple(Effect(*entry) for entry in _gpsindy.effects())
