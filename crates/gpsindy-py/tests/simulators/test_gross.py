"""Numbers of an engine that are wrong by a factor."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")

SERVO = """
<mujoco model="servo">
  <option timestep="0.005"/>
  <worldbody>
    <body>
      <joint name="pan" axis="0 0 1" armature="0.028" damping="0.6"/>
      <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.4"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="pan" kp="{kp}" forcerange="-3 3"/>
  </actuator>
</mujoco>
"""


def log(seed, kp, friction):
    """Ramps between random angles, 50 Hz, with noise of 1 mrad; the speed is not logged."""
    random, model = np.random.default_rng(seed), mujoco.MjModel.from_xml_string(SERVO.format(kp=kp))
    model.dof_frictionloss[0] = friction
    data, rows, command, aim = mujoco.MjData(model), [], 0.0, 0.0
    for i in range(400):
        aim = random.uniform(-0.8, 0.8) if i % 60 == 0 else aim
        command += np.clip(aim - command, -0.03, 0.03)
        rows.append([0.02 * i, data.qpos[0] + 1e-3 * random.standard_normal(), command])
        data.ctrl[0] = command
        mujoco.mj_step(model, data, 4)
    return dict(zip(["t", "pan", "servo"], np.array(rows).T))


@pytest.mark.parametrize(("kp", "nominal"), [(84.0, 998.0), (600.0, 40.0)])
def test_a_gain_that_is_ten_times_too_large_is_found_although_the_servo_saturates(kp, nominal):
    found = gpsindy.diagnose(
        gm.Simulator(SERVO.format(kp=nominal)), [log(seed, kp, 0.0) for seed in range(3)],
        effects=["parameter_error", "input_delay", "sensor_filter", "input_lag", "bias"], hold="zero",
    )  # fmt: skip
    assert [(cause.effect, cause.variables) for cause in found.included] == [("parameter_error", ("servo.kp",))], found
    assert found.included[0].parameters[0]["value"] == pytest.approx(kp, rel=0.05)
    assert found.verdict == "explained"
