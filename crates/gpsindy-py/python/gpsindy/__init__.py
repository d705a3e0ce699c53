"""Identify equations from sparse, noisy logs, and diagnose where a simulator is wrong.

Start with :class:`GPSINDy` (logs to a model), :func:`diagnose` (a simulator and logs to the causes of their gap),
:func:`read_log` and :class:`Dataset` (logs), :class:`Model` (load, simulate, score, export) and :func:`inspect` (what a log holds).

>>> import numpy as np
>>> import gpsindy
>>> t = np.linspace(0, 4, 81)
>>> found = gpsindy.GPSINDy(degree=1).fit(3 * np.exp(-0.5 * t), t, feature_names=["x"])
>>> found.equations(precision=3)
['-0.5*x']
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsindy._gpsindy import NumericalError, __version__
from gpsindy.catalogue import CustomEffect, Effect, effects, read_effects
from gpsindy.data.dataset import Dataset, Run, read_csv
from gpsindy.data.logs import Inspection, inspect, read_log
from gpsindy.diagnosing import diagnose
from gpsindy.diagnosis import Cause, Diagnosis
from gpsindy.errors import DataWarning, NotFittedError
from gpsindy.fleets import Fleet, fleet
from gpsindy.following.consequences import Consequence, Loop, Loss, closed_loop, consequence
from gpsindy.following.experiment import Experiment, Separation
from gpsindy.following.randomizing import Randomization, Range, randomization
from gpsindy.identifying.estimator import GPSINDy
from gpsindy.identifying.online import Estimate, Online
from gpsindy.identifying.reproduction import AuthorFit, author
from gpsindy.identifying.smoothing import ColumnFit, Smoothed, SmoothedRun, smooth
from gpsindy.model import Model
from gpsindy.parts import Control, Identification, Parameter, Port, State
from gpsindy.scoring import Errors, Score, StateError, score
from gpsindy.simulation import Rollout, simulate
from gpsindy.stepper import Stepper

__all__ = [
    "AuthorFit",
    "Cause",
    "ColumnFit",
    "Consequence",
    "Control",
    "CustomEffect",
    "DataWarning",
    "Dataset",
    "Diagnosis",
    "Effect",
    "Errors",
    "Estimate",
    "Experiment",
    "Fleet",
    "GPSINDy",
    "Identification",
    "Inspection",
    "Loop",
    "Loss",
    "Model",
    "NotFittedError",
    "NumericalError",
    "Online",
    "Parameter",
    "Port",
    "Randomization",
    "Range",
    "Rollout",
    "Run",
    "Score",
    "Separation",
    "Smoothed",
    "SmoothedRun",
    "State",
    "StateError",
    "Stepper",
    "__version__",
    "author",
    "closed_loop",
    "consequence",
    "diagnose",
    "effects",
    "fleet",
    "inspect",
    "randomization",
    "read_csv",
    "read_effects",
    "read_log",
    "score",
    "simulate",
    "smooth",
]


if TYPE_CHECKING:
    # A type checker sees the modules, and no __getattr__ that would hide a misspelt name from it.
    from gpsindy import fmu, mujoco, plot
else:

    def __getattr__(name: str) -> Any:
        if name in ("plot", "mujoco", "fmu"):
            # Each needs a package that everything else does not.
            import importlib

            return importlib.import_module(f"gpsindy.{name}")
        raise AttributeError(f"module 'gpsindy' has no attribute {name!r}")
