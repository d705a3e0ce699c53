"""Simulators that step: rollouts, the four places of effects, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from carts import by_hand, cart, carts, stepper

import gpsindy


def command(seed, n=240, rate=50):
    rng = np.random.default_rng(seed)
    t = np.arange(n) / rate
    return t, np.repeat(rng.uniform(-2, 2, n // 20), 20)


@pytest.mark.parametrize(("step", "vectorized"), [(cart, False), (carts, True)])
@pytest.mark.parametrize("dt", [0.005, 0.007])
def test_a_rollout_is_the_steppers_own_steps_the_last_of_a_sample_shortened(step, vectorized, dt):
    t, u = command(0, 100)
    found = stepper(step, vectorized, dt).model.simulate([0.1, 0.0], t, u=u[:, None])
    assert np.abs(found.x - by_hand(t, u, dt, start=(0.1, 0.0))).max() < 1e-12


def log(seed, **options):
    t, u = command(seed)
    x = by_hand(t, u, 0.005, **options)
    rng = np.random.default_rng(seed + 100)
    return {"t": t, "x": x[:, 0] + 2e-3 * rng.standard_normal(len(t)), "v": x[:, 1] + 5e-3 * rng.standard_normal(len(t)), "u": u}


@pytest.mark.parametrize(
    ("options", "effect", "place", "value"),
    [
        ({"parameters": (1.6, 4.0)}, "parameter_error", None, 1.6),
        ({"force": lambda x: -0.6 * x[1] * abs(x[1])}, "quadratic_drag", "f", 0.6),
        ({"late": 0.06}, "input_delay", None, 0.06),
    ],
)
def test_effects_are_found_in_the_place_where_they_act(options, effect, place, value):
    found = gpsindy.diagnose(stepper(), [log(seed, **options) for seed in range(4)], hold="zero")
    assert [(cause.effect, cause.place) for cause in found.included] == [(effect, place)]
    assert abs(found.included[0].parameters[0]["value"] - value) < 0.03 * value


def test_a_stepper_that_is_right_has_no_gap():
    found = gpsindy.diagnose(stepper(), [log(seed) for seed in range(4)], hold="zero")
    assert found.verdict == "no_gap"


def test_mistakes_are_stated():
    with pytest.raises(ValueError, match="expected a callable"):
        gpsindy.Stepper(3, ["x"])
    with pytest.raises(ValueError, match="`dt` must be above 0"):
        gpsindy.Stepper(cart, ["x", "v"], ["u"], 0.0)
    with pytest.raises(ValueError, match="variable of port f `w` is unknown; known: x, v"):
        gpsindy.Stepper(cart, ["x", "v"], ["u"], 0.01, forces={"f": "w"})
    short = gpsindy.Stepper(lambda *_: [0.0], ["x", "v"], [], 0.01)
    with pytest.raises(ValueError, match="must return the next 2 states"):
        short.model.simulate([0.0, 0.0], [0.0, 0.1])

    def broken(x, u, force, parameters, dt):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        gpsindy.Stepper(broken, ["x"]).model.simulate([0.0], [0.0, 0.1])
