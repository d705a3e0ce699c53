"""Regressions of PySINDy, beside the package: SINDy, stepwise sparse regression, ensembles, weak form."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
import pysindy

from library import Array, evaluate

THRESHOLDS = [0.02, 0.05, 0.1, 0.2, 0.4]
"""Of STLSQ; 0.1 is PySINDy's default."""
HELD_OUT = 0.25
"""Last part of what is learnt from, on whose differences the threshold is chosen."""


def sindy(theta: Array, dx: Array) -> Array:
    """STLSQ. Coefficients (n x p)."""

    def fit(part: slice, threshold: float) -> Array:
        return pysindy.STLSQ(threshold=threshold).fit(theta[part], dx[part]).coef_

    return _tuned(fit, theta, dx)


def stepwise(theta: Array, dx: Array, criteria: str) -> Array:
    """SSR, one term less a step down to one term, by `coefficient_value` or `model_residual`. Coefficients (n x p)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer = pysindy.SSR(criteria=criteria, max_iter=theta.shape[1] - 1)
        return optimizer.fit(theta, dx).coef_


def ensemble_sindy(theta: Array, dx: Array, seed: int) -> Array:
    """E-SINDy: median of STLSQ over 50 bags of samples. Coefficients (n x p)."""

    def fit(part: slice, threshold: float) -> Array:
        np.random.seed(seed)  # Its bags come from the global generator.
        optimizer = pysindy.EnsembleOptimizer(pysindy.STLSQ(threshold=threshold), bagging=True, n_models=50)
        optimizer.fit(theta[part], dx[part])
        return np.median(np.array(optimizer.coef_list), axis=0)

    return _tuned(fit, theta, dx)


def weak_sindy(z: Array, t: Array, names: list[str], terms: list[str], dx: Array, seed: int) -> Array:
    """Weak SINDy: STLSQ on integrals over 200 random windows; controls are further columns of `z`. Coefficients (n x p).

    `dx` (r x n) serves the choice of the threshold alone.
    """
    kept = [term for term in terms if term != "1"]

    def fit(part: slice, threshold: float) -> Array:
        np.random.seed(seed)
        library = pysindy.WeakPDELibrary(
            pysindy.CustomLibrary([_of_all(names, term) for term in kept], [partial(_label, term) for term in kept]),
            spatiotemporal_grid=t[part],
            K=200,
            include_bias=True,
        )
        model = pysindy.SINDy(optimizer=pysindy.STLSQ(threshold=threshold), feature_library=library)
        model.fit(z[part], t=t[part], feature_names=names)
        found = dict(zip(model.get_feature_names(), np.asarray(model.coefficients()).T))
        missing = np.zeros(z.shape[1])
        return np.array([found.get(term, missing) for term in terms]).T[: dx.shape[1]]

    values = dict(zip(names, z.T))
    return _tuned(fit, np.column_stack([evaluate(term, values) for term in terms]), dx)


def _tuned(fit: Callable[[slice, float], Array], theta: Array, dx: Array) -> Array:
    """The fit on all rows with the largest threshold that is within a tenth of the best for rows that it has not seen."""
    cut = round((1.0 - HELD_OUT) * len(dx))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        errors = [np.sum((theta[cut:] @ fit(slice(0, cut), h).T - dx[cut:]) ** 2) for h in THRESHOLDS]
        good = [h for h, error in zip(THRESHOLDS, errors) if error <= 1.1 * min(errors)]
        return fit(slice(None), max(good))


def _of_all(names: list[str], term: str):  # noqa: ANN202 - the number of arguments is that of the names
    def function(*columns: Array) -> Array:
        shape = np.shape(columns[0])
        flat = {name: np.ravel(column) for name, column in zip(names, columns)}
        return evaluate(term, flat).reshape(shape)

    # PySINDy asks the code object for the number of arguments.
    arguments = ", ".join(names)
    return eval(f"lambda {arguments}: function({arguments})", {"function": function})


def _label(term: str, *_: str) -> str:
    return term


REGRESSIONS: dict[str, Callable[[Array, Array], Array]] = {
    "sindy-stlsq": sindy,
    "ssr-coefficient": partial(stepwise, criteria="coefficient_value"),
    "ssr-residual": partial(stepwise, criteria="model_residual"),
    "e-sindy": partial(ensemble_sindy, seed=0),
}
"""By the name of the row: candidates (r x p) and derivatives (r x n) to coefficients (n x p)."""
