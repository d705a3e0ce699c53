"""What a gap costs a controller, against the truth with one effect taken out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import gpsindy
from carts import by_hand, cart, stepper

DRAG, LATE = 0.6, 0.06
T = np.arange(0, 8, 0.02)


def tracking(t, y):
    """A stiff servo after a slow sine."""
    return [20.0 * (np.sin(1.5 * t) - y[0]) - 3.0 * y[1]]


def cost(loop):
    return float(np.mean((loop["x"] - np.sin(1.5 * loop.t)) ** 2))


def truth(drag, late):
    """The loop step by step in code of its own: the command reaches the cart `late` seconds later."""
    x, rows, said = np.zeros(2), [], []
    for t in T:
        rows.append(x)
        said.append(tracking(t, x)[0])
        for part in range(4):
            at = t + 0.005 * part - late
            command = said[max(0, int(np.floor((at + 1e-9) / 0.02)))]
            x = np.array(cart(x, [command], [-drag * x[1] * abs(x[1])], (1.2, 4.0), 0.005))
        rows[-1] = np.array(rows[-1])
    place = np.array(rows)[:, 0]
    return float(np.mean((place - np.sin(1.5 * T)) ** 2))


@pytest.fixture(scope="module")
def diagnosis():
    def log(seed):
        rng = np.random.default_rng(seed)
        t = np.arange(240) / 50
        u = np.repeat(rng.uniform(-4, 4, 12), 20)
        x = by_hand(t, u, 0.005, late=LATE, force=lambda x: -DRAG * x[1] * abs(x[1]))
        noise = rng.standard_normal(x.shape) * [2e-3, 5e-3]
        return {"t": t, "x": x[:, 0] + noise[:, 0], "v": x[:, 1] + noise[:, 1], "u": u}

    effects = ["quadratic_drag", "input_delay", "viscous_friction", "input_gain"]
    return gpsindy.diagnose(stepper(), [log(seed) for seed in range(4)], effects=effects, hold="zero")


def test_the_loss_of_each_cause_is_that_of_the_truth_without_it(diagnosis):
    assert {cause.effect for cause in diagnosis.included} == {"quadratic_drag", "input_delay"}
    found = gpsindy.consequence(diagnosis, tracking, cost, t=T)
    assert abs(found.nominal / truth(0.0, 0.0) - 1) < 1e-6
    whole = truth(DRAG, LATE)
    assert abs(found.corrected / whole - 1) < 0.1
    real = {"quadratic_drag": whole - truth(0.0, LATE), "input_delay": whole - truth(DRAG, 0.0)}
    for loss in found.losses:
        assert abs(loss.loss - real[loss.cause.effect]) < 0.1 * abs(real[loss.cause.effect]), loss
    assert "quadratic_drag" in repr(found)
    wrong = SimpleNamespace(effect="parameter_error", variables=("hinge.damping",), place=None, state="hinge_vel")
    loss = replace(found.losses[0], cause=wrong, loss=1.0)
    assert "parameter_error (hinge.damping): +1" in repr(replace(found, losses=(loss,)))


def test_mistakes_are_stated(diagnosis):
    with pytest.raises(ValueError, match="expected 1 numbers, found 2"):
        gpsindy.consequence(diagnosis, lambda t, y: [0.0, 0.0], cost, t=T[:10])
    with pytest.raises(ValueError, match="no state 'z'"):
        gpsindy.consequence(diagnosis, tracking, cost, t=T[:10], start={"z": 1.0})
    with pytest.raises(ValueError, match="cost: expected a number"):
        gpsindy.consequence(diagnosis, tracking, lambda loop: np.nan, t=T[:10])
    with pytest.raises(FileNotFoundError, match="hand in a callable or an ONNX policy"):
        gpsindy.consequence(diagnosis, "none.onnx", cost, t=T[:10])

    def broken(t, y):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        gpsindy.consequence(diagnosis, broken, cost, t=T[:10])
