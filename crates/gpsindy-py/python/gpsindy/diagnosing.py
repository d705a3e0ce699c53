"""The diagnosis of the gap between a simulator and the logs of the machine."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gpsindy import _gpsindy
from gpsindy.catalogue import CustomEffect
from gpsindy.data._tables import names_of
from gpsindy.data.dataset import Path, as_dataset
from gpsindy.diagnosis import Diagnosis
from gpsindy.model import Hold, Model, Progress, Simulator, as_model

if TYPE_CHECKING:
    from gpsindy.identifying.estimator import GPSINDy


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
    joints: str | Iterable[str] = (),
    actuators: str | Iterable[str] = (),
    allow_place: bool = False,
    all_suspects: bool = False,
    confidence: float = 0.95,
    most_effects: int = 6,
    hold: Hold | None = None,
    material: float = 0.0,
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
        Suspects of the user's own.
    joints, actuators : str or sequence of str
        Test only effects in these joints of a MuJoCo model (the actuators that drive them and the mass of their own bodies included), and
        of these actuators (command, gains and delay). Default: everywhere.
    allow_place : bool
        Let effects depend on where the machine is, or which way it faces, although no rate of the model does.
    all_suspects : bool
        Suspect every effect everywhere, also where it makes no sense by units or place.
    confidence : float
        Confidence level of the intervals, 0.5 to 0.999; no test and no verdict depends on it.
    most_effects : int
        Largest number of effects in one explanation, 1 to 6; never more than four in one equation.
    hold : {"zero", "linear"}, optional
        How controls behave between samples. Default: estimated.
    time_limit : float or None, default 600
        Seconds after which the search stops with the best result so far and says so; ``None`` or 0: no limit.
    material : float, default 0
        Share of the motion of each column, 0 to 0.5, below which a gap counts as none.
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
        "joints": list(names_of(joints)),
        "actuators": list(names_of(actuators)),
        "allow_place": allow_place,
        "all_suspects": all_suspects,
        "confidence": confidence,
        "most_effects": most_effects,
        "hold": hold,
        "material": float(material),
        "keep_function": keep_function,
        "time_limit": float(time_limit) if time_limit else None,
        "power": int(seed) if power else None,
    }
    train = as_dataset(logs)._inner
    held = None if holdout is None else as_dataset(holdout, "holdout")._inner
    named = options["joints"] or options["actuators"]
    if simulated is not None:
        _refuse_parts(named)
        identify = _identify_settings(model, states, controls)
        paired = as_dataset(simulated, "simulated")._inner
        report, *models, left = _gpsindy.diagnose_paired(paired, identify, train, held, options, progress)
        return _diagnosis(report, models, left, None)
    if callable(model):
        if states is None:
            raise ValueError("states: a callable needs the names of its states (and of its controls, where it has any)")
        nominal = Model.from_callable(model, states, controls, kinematic=kinematic, vectorized=vectorized)
    else:
        nominal = as_model(model)
    parts = getattr(nominal._source, "_parts", None)
    if parts is None:
        _refuse_parts(named)
    else:
        options["parts"] = parts()
    report, *models, left = _gpsindy.diagnose(nominal._inner, train, held, options, progress)
    return _diagnosis(report, models, left, nominal._source)


def _refuse_parts(named: Any) -> None:
    if named:
        raise ValueError("joints, actuators: this simulator does not name its joints and actuators, as a MuJoCo model does")


def _diagnosis(report: str, models: Sequence[Any], left: _gpsindy.Open, source: Any) -> Diagnosis:
    inner, augmented, without = models
    corrected = Model._of(augmented, source)
    text = _with_file(report, corrected) if augmented.calls_simulator else report
    return Diagnosis(text, corrected, left, Model._of(inner, source), [Model._of(one, source) for one in without])


def _with_file(report: str, augmented: Model) -> str:
    """The report of a simulator that is no equations: the name of its corrected file, and what changed in it."""
    stated = json.loads(report)
    stated["augmented_model"] = None
    if augmented._source is not None:
        try:
            stated["augmented_model"], _, difference = augmented._source._corrected_file(augmented._inner, ".")
        except ValueError:
            # Made from what has no file, such as a compiled model.
            return json.dumps(stated)
        if stated.get("figures"):
            stated["figures"]["difference"] = difference
    return json.dumps(stated)


def _identify_settings(model: Any, states: Sequence[str] | None, controls: Sequence[str]) -> dict[str, Any]:
    from gpsindy.data._layout import Layout
    from gpsindy.identifying.estimator import GPSINDy

    estimator = GPSINDy() if model is None else model
    if not isinstance(estimator, GPSINDy):
        kind = type(model).__name__
        raise ValueError(f"simulated: in place of the model hand in None or a GPSINDy with settings, found {kind}")
    if states is None:
        raise ValueError("states: simulated logs need the names of their states (and of their controls, where they have any)")
    return estimator._settings(Layout(names_of(states), names_of(controls), []))
