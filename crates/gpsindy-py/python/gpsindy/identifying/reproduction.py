"""The pipeline behind the tables of the GPSINDy paper as its authors ran it, slips included: to reproduce, not to learn with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gpsindy import _gpsindy
from gpsindy.data._layout import lay_out
from gpsindy.data._tables import Array, names_of
from gpsindy.model import Model, Progress


@dataclass(frozen=True, eq=False)
class AuthorFit:
    """What the authors' pipeline reports.

    Attributes
    ----------
    model : Model
        The equations; the authors integrate them with ``method="euler"``.
    coef : ndarray of shape (n_states, n_terms)
    terms : tuple of str
    lam : float
        Weight of the 1-norm, one for all states.
    train_error, test_error : float
        Frobenius norm of the open-loop error against the noisy log, on the first part and on the rest, units mixed.
    """

    model: Model
    coef: Array
    terms: tuple[str, ...]
    lam: float
    train_error: float
    test_error: float


def author(
    x: Any,
    t: Any = None,
    x_dot: Any = None,
    u: Any = None,
    feature_names: Sequence[str] | None = None,
    *,
    gp: bool = True,
    inputs: Mapping[str, str | Sequence[str]] | None = None,
    degree: int = 1,
    trig: bool = False,
    products: bool = True,
    terms: Sequence[str] = (),
    kernels: Sequence[str] | None = None,
    lam: float | None = None,
    train_fraction: float = 0.7,
    progress: Progress | None = None,
) -> AuthorFit:
    """Runs the authors' SINDy or GPSINDy on one run.

    Symmetric differences of the raw samples, ADMM with loose tolerances, one weight for all states by the open-loop error
    on the training part, forward Euler. :class:`gpsindy.GPSINDy` is what to learn with.

    Parameters
    ----------
    x, t, x_dot, u, feature_names
        As in :meth:`gpsindy.GPSINDy.fit`, but one run without missing values. Derivatives of some states may be named; the
        others are differenced.
    gp : bool
        Their GPSINDy; False: their SINDy.
    inputs : mapping of str to str or sequence of str, optional
        Inputs of the second Gaussian process by state; the others take all smoothed states. For the paper's car
        ``{"v": "throttle", "heading": "steering"}``.
    degree, trig, products, terms
        Candidate terms as in :class:`gpsindy.GPSINDy`; the defaults are those of the car.
    kernels : sequence of str, optional
        Kernels that compete. Default: the authors' twelve; ``["se"]`` for their simulated systems.
    lam : float, optional
        Weight of the 1-norm. Default: chosen; 0.1 for their simulated systems.
    train_fraction : float
        Train on this first fraction of the run.
    progress : callable, optional
        Called with (stage, done, total).

    Examples
    --------
    >>> import numpy as np
    >>> import gpsindy
    >>> t = np.linspace(0, 8, 81)
    >>> found = gpsindy.author(2 * np.exp(-0.5 * t)[:, None], t, degree=1, products=False, gp=False)
    >>> found.terms
    ('1', 'x0')
    """
    data, layout = lay_out(x, t, x_dot, u, feature_names)
    second: list[list[str]] | None = None
    if gp:
        chosen = {state: names_of(names) for state, names in dict(inputs or {}).items()}
        for state in chosen:
            if state not in layout.states:
                raise ValueError(f"inputs: no state {state!r}; found {', '.join(layout.states)}")
        second = [chosen.get(state, []) for state in layout.states]
    elif inputs:
        raise ValueError("inputs: only with gp=True")
    settings = {
        "states": layout.states,
        "controls": layout.controls,
        "derivatives": layout.derivatives,
        "degree": degree,
        "trig": trig,
        "products": products,
        "terms": names_of(terms),
        "train_fraction": float(train_fraction),
        "inputs": second,
        "kernels": None if kernels is None else names_of(kernels),
        "lambda_": None if lam is None else float(lam),
    }
    inner, weight, train_error, test_error = _gpsindy.author(data, settings, progress)
    model = Model._of(inner)
    record = model.identification
    assert record is not None
    return AuthorFit(model, record.coefficients, record.terms, weight, train_error, test_error)
