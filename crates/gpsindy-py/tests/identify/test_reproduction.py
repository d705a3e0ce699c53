"""The authors' pipeline from Python."""

import numpy as np
import pytest

import gpsindy


def log():
    """x' = -x + u with a steady zigzag of u, by forward Euler itself."""
    t = 0.1 * np.arange(80)
    u = np.sin(0.35 * np.arange(80))
    x = np.empty(80)
    x[0] = 1.0
    for i in range(79):
        x[i + 1] = x[i] + 0.1 * (u[i] - x[i])
    return t, x[:, None], u[:, None]


def test_sindy_and_gpsindy_of_the_authors_follow_a_simple_system():
    t, x, u = log()
    names = ["x", "u"]
    # The log spreads by 0.5 over 57 training samples: an error of 1 is a fifth of that norm.
    plain = gpsindy.author(x, t, u=u, feature_names=names, gp=False)
    assert plain.train_error < 1 and plain.test_error < 1
    both = gpsindy.author(x, t, u=u, feature_names=names, inputs={"x": ["x", "u"]}, kernels=["se"])
    assert both.train_error < 1.5
    assert both.coef.shape == (1, len(both.terms)) and both.terms[:3] == ("1", "x", "u")


def test_given_derivatives_and_weights_are_taken():
    t, x, u = log()
    found = gpsindy.author(x, t, u - x, u, ["x", "u"], gp=False, products=False, lam=1e-4)
    assert found.lam == 1e-4
    # The two loose digits of their ADMM.
    assert found.coef == pytest.approx(np.array([[0, -1, 1]]), abs=0.05)
    # Their test error is that of the model by forward Euler from the last training sample.
    run = found.model.simulate(x[55], t[55:], u[55:], method="euler")
    assert found.test_error == pytest.approx(np.linalg.norm(run.x - x[55:]), rel=1e-9)


def test_what_makes_no_sense_is_refused():
    t, x, u = log()
    with pytest.raises(ValueError, match="gp=True"):
        gpsindy.author(x, t, gp=False, inputs={"x0": "x0"})
    with pytest.raises(ValueError, match="no state 'y'"):
        gpsindy.author(x, t, inputs={"y": "x0"})
    with pytest.raises(ValueError, match="lambda"):
        gpsindy.author(x, t, gp=False, lam=-1.0)
    with pytest.raises(ValueError, match="one run"):
        gpsindy.author([x, x], [t, t], gp=False)
