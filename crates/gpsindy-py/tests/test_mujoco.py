"""A simulator of others as the nominal model: MuJoCo, where it is installed."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy

mujoco = pytest.importorskip("mujoco")

HINGE = """
<mujoco>
  <option timestep="0.001" integrator="RK4"/>
  <worldbody>
    <body>
      <joint name="hinge" type="hinge" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><motor joint="hinge"/></actuator>
</mujoco>
"""


def simulator():
    """Rates of (angle, velocity) by MuJoCo's forward dynamics, without dry friction."""
    model = mujoco.MjModel.from_xml_string(HINGE)
    data = mujoco.MjData(model)

    def rates(t, x, u):
        data.qpos[0], data.qvel[0], data.ctrl[0] = x[0], x[1], u[0]
        mujoco.mj_forward(model, data)
        return np.array([x[1], data.qacc[0]])

    return rates


def real_log(seed: int, friction: float = 0.1):
    """25 Hz log of the same hinge with dry friction in it, stepped by MuJoCo, noise 0.002."""
    model = mujoco.MjModel.from_xml_string(HINGE.replace("damping", f'frictionloss="{friction}" damping'))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    torque = np.repeat(rng.uniform(-1.0, 1.0, 10), 10)
    rows = []
    for u in torque:
        rows.append((data.time, data.qpos[0], data.qvel[0], u))
        data.ctrl[0] = u
        mujoco.mj_step(model, data, 40)
    t, phi, omega, u = np.array(rows).T
    noise = 0.002 * rng.standard_normal((2, len(t)))
    return {"t": t, "phi": phi + noise[0], "omega": omega + noise[1], "u": u}


def test_dry_friction_that_is_turned_off_in_the_simulator_is_found():
    found = gpsindy.diagnose(
        simulator(),
        [real_log(seed) for seed in range(2)],
        states=["phi", "omega"],
        controls=["u"],
        kinematic={"phi": "omega"},
        effects=["coulomb_friction", "viscous_friction"],
        most_effects=1,
        hold="zero",
    )
    assert ("coulomb_friction", "omega") in {(cause.effect, cause.state) for cause in found.included}
    assert found.closure["after"] < 0.5 * found.closure["before"]
