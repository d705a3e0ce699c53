"""The rows of the car's table: each learns from the first part of a run and predicts the rest in one rollout."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import gpsindy
import network as nnsindy
from jetracer import CONTROLS, STATES, TRAIN, Array, Run
from library import evaluate, terms
from models import model_of

Predict = Callable[[Run], Array]
"""States over the rows of the test, from the first of them as it was logged."""

NAMES = [*STATES, *CONTROLS]
CAR_LIBRARY = {"degree": 1, "products": True}
"""The authors' library for the car: constant, linear, sine, cosine and variable times sine and cosine, 91 terms."""
OWN_INPUTS = {"v": "throttle", "heading": "steering"}
"""What the authors' second Gaussian process takes for the two last states."""
KINEMATICS = {"fix": ["x' = v*cos(heading)", "y' = v*sin(heading)"]}
"""What everybody knows about a car: it moves where it points to."""
PHYSICS = ["v", "v^2", "throttle", "steering", "v*steering", "v*steering^2", "v*steering^3"]
"""Candidates that somebody who knows cars would write down."""


def hold(run: Run) -> Array:
    """Nothing moves."""
    return np.repeat(run.x[run.test][:1], len(run.t[run.test]), axis=0)


def mean(run: Run) -> Array:
    """The mean of what was learnt from."""
    return np.repeat(run.x[: run.n_train].mean(axis=0)[None], len(run.t[run.test]), axis=0)


def rollout(model: gpsindy.Model, run: Run, how: str = "zero", method: str = "auto") -> Array:
    """From the first logged state of the test; not a number where it diverges."""
    test = run.test
    try:
        return np.array(model.simulate(run.x[test][0], run.t[test], run.u[test], hold=how, method=method).x)
    except gpsindy.NumericalError:
        return np.full(run.x[test].shape, np.nan)


def fitted(**settings: object) -> Predict:
    """An estimator of the package, its model integrated with the controls as it took them."""

    def predict(run: Run) -> Array:
        part = slice(0, run.n_train)
        estimator = gpsindy.GPSINDy(**settings)
        found = estimator.fit(run.x[part], run.t[part], u=run.u[part], feature_names=NAMES)
        return rollout(found.model_, run, found.hold_)

    return predict


def slopes(run: Run) -> Array:
    """Differences of the two neighbours over the whole record, one-sided at its ends, as the authors'."""
    dx = np.empty_like(run.x)
    dx[1:-1] = (run.x[2:] - run.x[:-2]) / (run.t[2:] - run.t[:-2])[:, None]
    dx[[0, -1]] = (run.x[[1, -1]] - run.x[[0, -2]]) / (run.t[[1, -1]] - run.t[[0, -2]])[:, None]
    return dx


def by_author(run: Run, dx: Array | None = None, **settings: object) -> Array:
    """The authors' pipeline, by forward Euler; `dx` replaces the differences."""
    found = gpsindy.author(run.x, run.t, dx, run.u, NAMES, train_fraction=TRAIN, **CAR_LIBRARY, **settings)
    return rollout(found.model, run, method="euler")


def polynomial_in_control(run: Run) -> Array:
    """No Gaussian process: acceleration and turning rate as parabolas of throttle and steering, then the authors' SINDy."""
    dx = slopes(run)
    part = slice(0, run.n_train)
    for state, control in ((2, 0), (3, 1)):
        fit = np.polyfit(run.u[part, control], dx[part, state], 2)
        dx[:, state] = np.polyval(fit, run.u[:, control])
    return by_author(run, dx, gp=False)


def network(run: Run) -> Array:
    """NNSINDy of the paper: a network from states to derivatives in place of the Gaussian processes."""
    dx = slopes(run)
    part = slice(0, run.n_train)
    dx[part] = nnsindy.refined(run.x[part], dx[part], seed=0)
    return by_author(run, dx, gp=False)


def regression(name: str) -> Predict:
    """A regression of PySINDy on the same library and differences."""

    def predict(run: Run) -> Array:
        import peers

        part = slice(0, run.n_train)
        library = terms(NAMES, 1, True)
        values = dict(zip(NAMES, np.column_stack([run.x, run.u])[part].T))
        theta = np.column_stack([evaluate(term, values) for term in library])
        coefficients = peers.REGRESSIONS[name](theta, slopes(run)[part])
        return rollout(model_of(STATES, CONTROLS, library, coefficients), run)

    return predict


def weak(run: Run) -> Array:
    """Weak SINDy of PySINDy on the same library."""
    part = slice(0, run.n_train)
    library = terms(NAMES, 1, True)
    z = np.column_stack([run.x, run.u])[part]
    import peers

    coefficients = peers.weak_sindy(z, run.t[part], NAMES, library, slopes(run)[part], seed=0)
    return rollout(model_of(STATES, CONTROLS, library, coefficients), run)


METHODS: dict[str, Predict] = {
    "hold": hold,
    "mean": mean,
    "sindy-author": lambda run: by_author(run, gp=False),
    "gpsindy-author": lambda run: by_author(run, inputs=OWN_INPUTS),
    "polynomial-in-control": polynomial_in_control,
    "nnsindy": network,
    "sindy-stlsq": regression("sindy-stlsq"),
    "ssr-coefficient": regression("ssr-coefficient"),
    "ssr-residual": regression("ssr-residual"),
    "e-sindy": regression("e-sindy"),
    "weak-sindy": weak,
    # Algorithm 1 as the paper states it, the second Gaussian process over the smoothed states or over the controls.
    "gpsindy-x": lambda run: by_preset(run, "gp-state"),
    "gpsindy-u": lambda run: by_preset(run, "gp-control"),
    # Ours: nothing known but the authors' library; controls taken as interpolated; the kinematics given; the kinematics
    # and seven sensible terms.
    "default": fitted(**CAR_LIBRARY),
    "default-linear": fitted(**CAR_LIBRARY, hold="linear"),
    "default-kinematic": fitted(**CAR_LIBRARY, **KINEMATICS),
    "default-physics": fitted(degree=0, terms=PHYSICS, **KINEMATICS),
}


def by_preset(run: Run, method: str) -> Array:
    """The preset `paper`."""
    part = slice(0, run.n_train)
    estimator = gpsindy.GPSINDy.paper(**CAR_LIBRARY, derivative_method=method)
    found = estimator.fit(run.x[part], run.t[part], u=run.u[part], feature_names=NAMES)
    return rollout(found.model_, run, found.hold_)
