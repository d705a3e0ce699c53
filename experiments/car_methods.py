"""The rows of the car's table: each learns from the first part of a run and predicts the rest in one rollout."""

from __future__ import annotations

from collections.abc import Callable

import gpsindy
import numpy as np
from jetracer import CONTROLS, STATES, Array, Run

Predict = Callable[[Run], Array]
"""States over the rows of the test, from the first of them as it was logged."""

CAR_LIBRARY = {"degree": 1, "products": True}
"""The authors' library for the car: constant, linear, sine, cosine and variable times sine and cosine, 91 terms."""


def hold(run: Run) -> Array:
    """Nothing moves."""
    return np.repeat(run.x[run.test][:1], len(run.t[run.test]), axis=0)


def mean(run: Run) -> Array:
    """The mean of what was learnt from."""
    return np.repeat(run.x[: run.n_train].mean(axis=0)[None], len(run.t[run.test]), axis=0)


def fitted(estimator: gpsindy.GPSINDy) -> Predict:
    """An estimator of the package, its model integrated with the controls as it took them."""

    def predict(run: Run) -> Array:
        part = slice(0, run.n_train)
        found = estimator.fit(run.x[part], run.t[part], u=run.u[part], feature_names=[*STATES, *CONTROLS])
        try:
            return np.array(found.simulate(run.x[run.test][0], run.t[run.test], run.u[run.test]))
        except gpsindy.NumericalError:
            return np.full(run.x[run.test].shape, np.nan)

    return predict


KINEMATICS = {"fix": ["x' = v*cos(heading)", "y' = v*sin(heading)"]}
"""What everybody knows about a car: it moves where it points to."""

PHYSICS = ["v", "v^2", "throttle", "steering", "v*steering", "v*steering^2", "v*steering^3"]
"""Candidates that somebody who knows cars would write down."""

METHODS: dict[str, Predict] = {
    "hold": hold,
    "mean": mean,
    # Ours: nothing known but the authors' library; the kinematics given; the kinematics and seven sensible terms.
    "default": fitted(gpsindy.GPSINDy(**CAR_LIBRARY)),
    "default-kinematic": fitted(gpsindy.GPSINDy(**CAR_LIBRARY, **KINEMATICS)),
    "default-physics": fitted(gpsindy.GPSINDy(degree=0, terms=PHYSICS, **KINEMATICS)),
}
