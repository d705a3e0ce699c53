"""The rows of the coefficient tables: each gives coefficients (n x p) over the system's library."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import gpsindy
import network as nnsindy
from library import Array, evaluate
from simulated import Sample, System

Method = Callable[[System, Sample], Array]
LAMBDA = 0.1
"""Of the authors for their simulated systems."""


def aligned(found: Array, names: list[str] | tuple[str, ...], system: System) -> Array:
    """Coefficients in the order of the system's library."""
    where = {name: k for k, name in enumerate(names)}
    columns = [found[:, where[term]] if term in where else np.zeros(len(found)) for term in system.terms]
    return np.column_stack(columns)


def fitted(**settings: object) -> Method:
    """An estimator of the package."""

    def method(system: System, data: Sample) -> Array:
        estimator = gpsindy.GPSINDy(degree=system.degree, products=True, **settings)
        return of(estimator, system, data)

    return method


def of(estimator: gpsindy.GPSINDy, system: System, data: Sample) -> Array:
    """What an estimator finds; the controls of these systems are smooth, not held."""
    if system.controls:
        estimator.set_params(hold="linear")
    u = data.u if system.controls else None
    found = estimator.fit(data.x, data.t, data.dx, u, [*system.states, *system.controls])
    return aligned(found.coef_, found.get_feature_names(), system)


def rates(data: Sample) -> Array:
    """The given derivatives, else differences."""
    return np.gradient(data.x, data.t, axis=0) if data.dx is None else data.dx


def by_author(system: System, data: Sample, refine: Callable[[Array, Array], Array] | None, **settings: object) -> Array:
    """The authors' pipeline at their fixed weight, on their standardised states where they took them; `refine` denoises."""
    names = [*system.states, *system.controls]
    u = data.u if system.controls else None
    x, dx = data.x, data.dx
    if dx is not None and not system.controls:
        x, dx = data.standardised(system)
    if refine is not None:
        dx = refine(x, np.gradient(x, data.t, axis=0) if dx is None else dx)
    library = {"degree": system.author_degree, "products": True, "lam": LAMBDA, "train_fraction": 1.0 - 1.0 / len(data.t)}
    found = gpsindy.author(x, data.t, dx, u, names, **library, **settings)
    return aligned(found.coef, found.terms, system)


def network(system: System, data: Sample) -> Array:
    """The paper's NNSINDy."""
    return by_author(system, data, partial(nnsindy.refined, seed=0), gp=False)


def regression(name: str) -> Method:
    """A regression of PySINDy."""

    def method(system: System, data: Sample) -> Array:
        import peers

        values = dict(zip([*system.states, *system.controls], np.column_stack([data.x, data.u]).T))
        theta = np.column_stack([evaluate(term, values) for term in system.terms])
        return peers.REGRESSIONS[name](theta, rates(data))

    return method


def weak(system: System, data: Sample) -> Array:
    """Weak SINDy of PySINDy; it takes no derivatives and wants uniform times."""
    if not np.allclose(np.diff(data.t), data.t[1] - data.t[0]):
        raise ValueError("weak SINDy wants uniform times")
    names = [*system.states, *system.controls]
    z = np.column_stack([data.x, data.u])
    import peers

    return peers.weak_sindy(z, data.t, names, system.terms, np.gradient(data.x, data.t, axis=0), seed=0)


def oracle(system: System, data: Sample) -> Array:
    """Knows the true terms: least squares through the integrator on all that was logged."""
    places = [(system.states.index(state), system.terms.index(term)) for state, term in system.truth]
    lists = [(system.states.index(state), term) for state, term in system.truth]
    n = len(system.states)

    def rate_of(parameters: Array, t: Array, x: Array) -> Array:
        values = dict(zip([*system.states, *system.controls], [*x, *system.control(np.atleast_1d(t)).T]))
        dx = np.zeros_like(x)
        for value, (state, term) in zip(parameters, lists):
            dx[state] += value * evaluate(term, values)
        return dx

    def residuals(parameters: Array) -> Array:
        coefficients, start = parameters[:-n], parameters[-n:]

        def right(t: float, x: Array) -> Array:
            return rate_of(coefficients, np.array([t]), x[:, None])[:, 0]

        span = (data.t[0], data.t[-1])
        found = solve_ivp(right, span, start, "DOP853", data.t, rtol=1e-8, atol=1e-8).y
        if found.shape[1] < len(data.t):
            return np.full(data.x.size * (1 if data.dx is None else 2), 1e6)
        off = [(found.T - data.x).ravel()]
        if data.dx is not None:
            off.append((rate_of(coefficients, data.t, found).T - data.dx).ravel())
        return np.concatenate(off)

    guess = np.array([*system.truth.values(), *data.x[0]])
    solution = least_squares(residuals, guess, x_scale="jac", method="lm").x
    found = np.zeros((n, len(system.terms)))
    for value, place in zip(solution, places):
        found[place] = value
    return found


METHODS: dict[str, Method] = {
    "sindy-author": lambda system, data: by_author(system, data, None, gp=False),
    "gpsindy-author": lambda system, data: by_author(system, data, None, kernels=["se"]),
    "nnsindy": network,
    "sindy-stlsq": regression("sindy-stlsq"),
    "ssr-coefficient": regression("ssr-coefficient"),
    "ssr-residual": regression("ssr-residual"),
    "e-sindy": regression("e-sindy"),
    "weak-sindy": weak,
    "gpsindy-paper": lambda system, data: of(paper(system), system, data),
    "default": fitted(),
    "oracle": oracle,
    # Steps of the default for the ablation, all but the last with its regression: raw differences at raw states, at smoothed
    # states, the derivative of the Gaussian process with its covariance, integrals; LASSO on the integrals.
    "differences": fitted(smoother=None, derivative_method="difference", refine=False),
    "smoothed-states": fitted(derivative_method="difference", refine=False),
    "gp-time": fitted(derivative_method="gp-time", refine=False),
    "weak": fitted(refine=False),
    "weak-lasso": fitted(refine=False, regressor="lasso"),
}
ROWS = list(METHODS)[:11]
"""Those of the coefficient figure."""


def paper(system: System) -> gpsindy.GPSINDy:
    """Algorithm 1 as the paper states it."""
    return gpsindy.GPSINDy.paper(degree=system.degree, products=True)
