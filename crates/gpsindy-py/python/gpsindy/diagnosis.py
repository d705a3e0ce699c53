"""What a diagnosis of the gap between a simulator and the logs of the machine found."""

from __future__ import annotations

import html
import json
import os
import pathlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsindy import _gpsindy
from gpsindy.data.dataset import Path
from gpsindy.following.experiment import Experiment, Separation
from gpsindy.model import Model, Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gpsindy.following.randomizing import Randomization


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
        Effects that these logs cannot distinguish from this one; its own where it would do as well elsewhere, see ``twins``.
    next_experiment : str or None
        The experiment that would.
    stability : dict or None
        Whether its size agrees between parts of the logs: ``runs`` (the parts), ``agree``, ``p_value``, and in ``disagree`` the
        parts that do not.
    place : str or None
        The port or control at which it acts, where it does not act in the state's equation alone.
    twins : tuple of dict
        Where else, or as which other effect, these logs would have it just as well: ``effect``, ``state``, ``variables``, ``place`` (where it
        has one) and ``parameters``.
    between_runs : tuple of dict
        Each of its sizes by run, and pooled: ``parameter``, ``unit``, ``runs`` (``run``, ``value``, ``low``, ``high``), ``pooled``, ``low``,
        ``high``, ``spread`` (standard deviation of the machine's own values), ``share`` (of the spread, the machine's own) and ``p_value``.
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
    twins: tuple[dict[str, Any], ...] = field(default=(), hash=False)
    between_runs: tuple[dict[str, Any], ...] = field(default=(), hash=False)


class Diagnosis:
    """What a diagnosis found; its text is a screenful for people, its JSON follows ``gpsindy.diagnosis/1``."""

    __slots__ = ("_augmented", "_figures", "_nominal", "_open", "_report", "_text", "_without")

    def __init__(
        self,
        report: str,
        augmented: Model,
        left_open: _gpsindy.Open | None = None,
        nominal: Model | None = None,
        without: Sequence[Model] = (),
    ) -> None:
        self._text = report
        self._report: dict[str, Any] = json.loads(report)
        # The curves of the page are no part of the report: they may change in any version.
        self._figures: dict[str, Any] = self._report.pop("figures", None) or {}
        self._augmented = augmented
        self._open = left_open
        self._nominal = nominal
        self._without = tuple(without)

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
                    "twins": tuple(cause.get("twins", ())),
                    "between_runs": tuple(cause.get("between_runs", ())),
                }
            )
            for cause in self._report["causes"]
        )

    @property
    def included(self) -> tuple[Cause, ...]:
        """The causes that make up the augmented model."""
        return tuple(cause for cause in self.causes if cause.included)

    @property
    def prediction_set(self) -> dict[str, Any] | None:
        """Effects among which the missing ones are, with a stated coverage; None without a gap, and where there is no ground for one.

        Of machines like the drawn ones that calibrate it, in a share ``coverage`` at least every effect that the simulator lacks is one of
        ``causes`` (``effect``, ``state``, ``variables``, and ``place`` where it has one) or, where ``none_of_these`` is true, one that the report
        does not list. ``calibration`` has the number of drawn machines (``cases``) and which they are (``group``). See :attr:`no_prediction_set`.
        """
        found: dict[str, Any] | None = self._report.get("prediction_set")
        return found

    @property
    def no_prediction_set(self) -> str | None:
        """Why there is a gap and no :attr:`prediction_set`; None otherwise."""
        found: str | None = self._report.get("no_prediction_set")
        return found

    @property
    def by_joint(self) -> dict[str, str]:
        """What was found in each joint, in a sentence; empty where the simulator names none."""
        return {row["part"]: row["says"] for row in self._report.get("by_part", [])}

    @property
    def closure(self) -> dict[str, Any]:
        """How far the included causes close the gap on held-out logs."""
        return dict(self._report["closure"])

    @property
    def checks(self) -> tuple[dict[str, Any], ...]:
        """What must hold of the included causes: ``id``, ``passed``, ``p_value`` (None: it has none) and ``says``; empty without causes."""
        return tuple(dict(row) for row in self._report.get("checks", []))

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
        or seen as a gap, in every copy; None: at none), ``group`` (what it could not be distinguished from) and ``confused_with``;
        ``null`` counts the alarms in copies without any effect.
        """
        found: dict[str, Any] | None = self._report.get("power")
        return found

    @property
    def augmented(self) -> Model:
        """The nominal model with the included causes added."""
        return self._augmented

    @property
    def open(self) -> tuple[tuple[str, str], ...]:
        """Pairs of accounts, each by its effects, that these logs cannot distinguish; :meth:`design` makes the run that does."""
        return () if self._open is None else tuple(self._open.pairs)

    def design(
        self,
        limits: Mapping[str, tuple[float, float]],
        *,
        rate_limits: Mapping[str, float] | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        duration: float = 10.0,
        rate: float = 50.0,
        start: Mapping[str, float] | None = None,
        separate: tuple[str, str] | None = None,
        seed: int = 0,
        time_limit: float | None = 600.0,
        progress: Progress | None = None,
    ) -> Experiment:
        """The control signal that best distinguishes what the logs left open.

        Maximises the separation of the pair that is hardest to distinguish, while each simulator may adjust its parameters as
        far as the logs allow (T-optimality, Atkinson and Fedorov 1975). Tries multisines, chirps, steps and free forms within
        the limits, and refines the best one.

        Parameters
        ----------
        limits : mapping of str to (float, float)
            Lowest and highest value of every control, in its unit; equal ones hold it still.
        rate_limits : mapping of str to float, optional
            Largest change of a control in a second.
        bounds : mapping of str to (float, float), optional
            Of states, which no simulator may leave.
        duration : float, default 10
            Length of the run, s.
        rate : float, default 50
            Samples a second.
        start : mapping of str to float, optional
            Where the run begins. Default: where the logs began.
        separate : (str, str), optional
            Distinguish these two effects instead. Default: every pair of :attr:`open`; where there is none, all accounts.
        seed : int
            Of the signals that are tried.
        time_limit : float or None, default 600
            Seconds after which the best signal so far is taken, see :attr:`Experiment.complete`; None or 0: no limit.
        progress : callable, optional
            Called with (stage, done, total).

        Returns
        -------
        Experiment

        Raises
        ------
        ValueError
            A control without a limit, an unknown name, limits within which a state leaves its bounds, or nothing to part.
        """
        if self._open is None:
            raise ValueError("this diagnosis does not know what it left open: it was read or copied; diagnose again")

        def spans(given: Mapping[str, tuple[float, float]] | None) -> list[tuple[str, float, float]]:
            return [(name, float(low), float(high)) for name, (low, high) in (given or {}).items()]

        settings = {
            "limits": spans(limits),
            "rate_limits": [(name, float(value)) for name, value in (rate_limits or {}).items()],
            "bounds": spans(bounds),
            "duration": float(duration),
            "rate": float(rate),
            "start": [(name, float(value)) for name, value in (start or {}).items()],
            "separate": separate,
            "seed": seed,
            "time_limit": float(time_limit) if time_limit else None,
        }
        t, names, values, form, pairs, complete = _gpsindy.design(self._open, self._augmented._inner, settings, progress)
        units = {control.name: control.unit for control in self._augmented.controls}
        return Experiment(t, dict(zip(names, values)), form, tuple(Separation(*pair) for pair in pairs), complete, units)

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
        """Writes ``report.json``, ``report.html`` and the corrected model, in its simulator's own format where it has one:
        ``augmented.toml``, ``augmented.xml`` (MuJoCo) or ``augmented.ssv`` (FMU). They replace those of an earlier diagnosis, all or none.
        """
        folder = pathlib.Path(os.fspath(directory))
        files = {"report.json": self.to_json(), "report.html": self.html()}
        source = self._augmented._source
        if not self._augmented._inner.calls_simulator:
            files["augmented.toml"] = _gpsindy.augmented_toml(self._text, self._augmented.to_toml())
            if self._open is not None and len(self._open.labels) > 1:
                files["open.json"] = self._open.to_json()
        elif source is not None and self._report.get("augmented_model"):
            name, text, _ = source._corrected_file(self._augmented._inner, folder)
            files[name] = text
        files.update(self._beside())
        folder.mkdir(parents=True, exist_ok=True)
        _gpsindy.write_report(os.fspath(folder), list(files.items()))

    def _beside(self) -> list[tuple[str, str]]:
        """Further files of a diagnosis of an engine's model."""
        if self._open is None or getattr(self._augmented._source, "_period", None) is None:
            return []
        return [("randomization.py", self.randomization().to_python())]

    def randomization(self, **options: Any) -> Randomization:
        """Ranges for training; see :func:`gpsindy.randomization`."""
        from gpsindy.following import randomizing

        return randomizing.randomization(self, **options)

    def plot(self, **options: Any) -> Figure:
        """Rollouts, residuals or the gap of each equation; see :func:`gpsindy.plot.diagnosis`. Needs matplotlib."""
        from gpsindy import plot

        return plot.diagnosis(self, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        # What a simulator's candidates call can't be written down.
        plain = self._open is not None and not self._augmented._inner.calls_simulator
        left = self._open.to_json() if plain and self._open else None
        return (_restored, (self._text, self._augmented, left, self._nominal, self._without))

    def __repr__(self) -> str:
        return self.summary(shutil.get_terminal_size((100, 24)).columns)

    def _repr_html_(self) -> str:
        # A frame of its own, so that the page's style stays inside it.
        page = html.escape(self.html(), quote=True)
        return f'<iframe srcdoc="{page}" title="gpsindy diagnosis" width="100%" height="720" style="border:0"></iframe>'


def _restored(
    report: str, augmented: Model, left_open: str | None, nominal: Model | None, without: Sequence[Model]
) -> Diagnosis:
    left = None if left_open is None else _gpsindy.Open.parse(left_open)
    return Diagnosis(report, augmented, left, nominal, without)
