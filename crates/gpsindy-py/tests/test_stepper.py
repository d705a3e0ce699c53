"""Simulators that step: rollouts, the four places of effects, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy


def cart(x, u, force, parameters, dt):
    """A cart on a spring, steps of semi-implicit Euler."""
    place, speed = x
    mass, stiffness = parameters
    speed = speed + dt * (u[0] + force[0] - stiffness * place - 0.4 * speed) / mass
    return [place + dt * speed, speed]


def carts(x, u, force, parameters, dt):
    speed = x[:, 1] + dt * (u[:, 0] + force[:, 0] - parameters[:, 1] * x[:, 0] - 0.4 * x[:, 1]) / parameters[:, 0]
    return np.column_stack([x[:, 0] + dt * speed, speed])


def stepper(step=carts, vectorized=True, dt=0.005):
    return gpsindy.Stepper(
        step,
        ["x", "v"],
        ["u"],
        dt,
        parameters={"mass": (1.2, 0.0, np.inf), "stiffness": 4.0},
        forces={"f": ("v", "x")},
        kinematic={"x": "v"},
        vectorized=vectorized,
    )


def by_hand(t, u, dt, parameters=(1.2, 4.0), force=lambda x: 0.0, late=0.0, start=(0.0, 0.0)):
    """The same rollout, step by step."""
    x = np.array(start, dtype=float)
    rows = [x]
    for i in range(len(t) - 1):
        now, left = t[i], t[i + 1] - t[i]
        while left > 1e-12:
            h = min(dt, left)
            command = u[max(0, np.searchsorted(t, now - late + 1e-9) - 1)]
            x = np.array(cart(x, [command], [force(x)], parameters, h))
            now, left = now + h, left - h
        rows.append(x)
    return np.array(rows)


def command(seed, n=400, rate=50):
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


def test_mistakes_are_told():
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
