"""Ports: friction in one joint of an arm enters every row of its equations, and is found in that joint."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy

ARM = """
schema = "gpsindy.model/1"
name = "arm"
[[state]]
name = "th1"
unit = "rad"
equation = "w1"
[[state]]
name = "th2"
unit = "rad"
equation = "w2"
[[state]]
name = "w1"
unit = "rad/s"
equation = "(i2*(T1) - (i2 + c*cos(th2))*(T2))/((i1 + i2 + 2*c*cos(th2))*i2 - (i2 + c*cos(th2))^2)"
[[state]]
name = "w2"
unit = "rad/s"
equation = "((i1 + i2 + 2*c*cos(th2))*(T2) - (i2 + c*cos(th2))*(T1))/((i1 + i2 + 2*c*cos(th2))*i2 - (i2 + c*cos(th2))^2)"
[[control]]
name = "u1"
unit = "N m"
[[control]]
name = "u2"
unit = "N m"
[[port]]
name = "tau_1"
variable = "w1"
position = "th1"
unit = "N m"
[[port]]
name = "tau_2"
variable = "w2"
position = "th2"
unit = "N m"
"""

FIRST = "u1 + tau_1 + c*sin(th2)*(2*w1*w2 + w2^2) - g1*sin(th1) - g2*sin(th1 + th2) - b1*w1"
SECOND = "u2 + tau_2 - c*sin(th2)*w1^2 - g2*sin(th1 + th2) - b2*w2"


def draw(rng):
    """Two rods: inertias about the joints, their coupling, weights, dampings."""
    (m1, m2), (l1, l2) = rng.uniform(0.5, 2.0, 2), rng.uniform(0.25, 0.6, 2)
    i1, i2 = m1 * l1**2 / 3 + m2 * l1**2, m2 * l2**2 / 3
    return {
        "i1": i1,
        "i2": i2,
        "c": m2 * l1 * l2 / 2,
        "g1": 9.81 * l1 * (m1 / 2 + m2),
        "g2": 9.81 * m2 * l2 / 2,
        "b1": rng.uniform(0.15, 0.9) * i1,
        "b2": rng.uniform(0.15, 0.9) * i2,
    }


def model(p):
    text = ARM.replace("T1", FIRST).replace("T2", SECOND)
    parameters = [f'[[parameter]]\nname = "{name}"\nvalue = {float(value)!r}\n' for name, value in p.items()]
    return gpsindy.Model.from_toml(text + "".join(parameters))


def accelerations(p, th, w, u):
    """Without friction, and the inverse of the mass matrix."""
    coupling, swing = p["c"] * np.cos(th[1]), p["c"] * np.sin(th[1])
    m11, m12, m22 = p["i1"] + p["i2"] + 2 * coupling, p["i2"] + coupling, p["i2"]
    inverse = np.array([[m22, -m12], [-m12, m11]]) / (m11 * m22 - m12 * m12)
    weight = p["g2"] * np.sin(th[0] + th[1])
    first = u[0] + swing * (2 * w[0] * w[1] + w[1] ** 2) - p["g1"] * np.sin(th[0]) - weight - p["b1"] * w[0]
    second = u[1] - swing * w[0] ** 2 - weight - p["b2"] * w[1]
    return inverse @ np.array([first, second]), inverse


def run(p, friction, rng, seconds=8.0, rate=100):
    """Midpoint steps; friction stops a joint where its impulse suffices, so it really sticks."""
    dt, n = 5e-4, int(seconds * rate)
    size = np.array([p["g1"] * 0.6, p["g2"] * 0.8])
    frequency, phase = rng.uniform(0.15, 1.6, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))
    th, w = rng.uniform(-0.4, 0.4, 2), np.zeros(2)
    rows = []
    for i in range(n):
        u = size * np.sin(2 * np.pi * frequency * i / rate + phase).sum(1) / 2
        rows.append([i / rate, *th, *w, *u])
        for _ in range(round(1 / rate / dt)):
            start, _ = accelerations(p, th, w, u)
            middle, inverse = accelerations(p, th + 0.5 * dt * w, w + 0.5 * dt * start, u)
            after = w + dt * middle
            for joint in np.flatnonzero(friction):
                most = friction[joint] * dt
                after = after + inverse[:, joint] * np.clip(-after[joint] / inverse[joint, joint], -most, most)
            th, w = th + 0.5 * dt * (w + after), after
    rows = np.array(rows)
    rows[:, 1:3] += 1e-3 * rng.standard_normal((n, 2))
    rows[:, 3:5] += 5e-3 * rng.standard_normal((n, 2))
    return dict(zip(["t", "th1", "th2", "w1", "w2", "u1", "u2"], rows.T))


FRICTIONS = ["coulomb_friction", "viscous_friction", "stribeck_friction", "quadratic_drag", "bias", "coupling"]


@pytest.mark.parametrize("joint", [0, 1])
def test_dry_friction_that_sticks_is_found_in_its_joint_and_nothing_else(joint):
    rng = np.random.default_rng(40 + joint)
    p = draw(rng)
    level = np.zeros(2)
    level[joint] = 0.08 * [p["g1"], p["g2"]][joint]
    found = gpsindy.diagnose(model(p), [run(p, level, rng, 5.0) for _ in range(3)], effects=FRICTIONS, hold="zero")
    assert [(c.effect, c.place) for c in found.included] == [("coulomb_friction", f"tau_{joint + 1}")]
    assert abs(found.included[0].parameters[0]["value"] / level[joint] - 1) < 0.05


def test_an_arm_that_is_right_has_no_gap():
    rng = np.random.default_rng(44)
    p = draw(rng)
    found = gpsindy.diagnose(model(p), [run(p, np.zeros(2), rng, 5.0) for _ in range(3)], effects=FRICTIONS, hold="zero")
    assert found.verdict == "no_gap"


def test_a_model_keeps_its_ports_in_files_and_leaves_them_out_of_exports():
    arm = model(draw(np.random.default_rng(0)))
    assert [(port.name, port.variable, port.position) for port in arm.ports] == [("tau_1", "w1", "th1"), ("tau_2", "w2", "th2")]
    assert gpsindy.Model.from_json(arm.to_json()).ports == arm.ports
    assert "tau_1" not in arm.export("python")
    with pytest.raises(ValueError, match="variable of port tau_1 `v` is unknown"):
        gpsindy.Model.from_toml(arm.to_toml().replace('variable = "w1"', 'variable = "v"'))
