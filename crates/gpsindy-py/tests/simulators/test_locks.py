"""Joints that are locked while another one is tested."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gpsindy

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")

HIP = '<joint name="hip" axis="0 1 0" armature="0.01" damping="0.1" range="0 1"/>'
ARM = f"""
<mujoco model="arm">
  <option timestep="0.002"/>
  <compiler angle="radian"/>
  <worldbody>
    <body name="thigh" pos="0 0 1">
      {HIP}
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.8"/>
      <body name="calf" pos="0 0 -0.2">
        <joint name="knee" axis="0 1 0" armature="0.01" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.05 0 -0.2" size="0.015" mass="0.3"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="hip_servo" joint="hip" kp="40"/>
    <motor name="knee_motor" joint="knee"/>
  </actuator>
</mujoco>
"""


def welded(angle, friction=0.0):
    """The arm whose hip is no joint but a fixed angle."""
    turn = f'quat="{math.cos(angle / 2)} 0 {math.sin(angle / 2)} 0"'
    text = ARM.replace(HIP, "").replace('<body name="thigh" pos="0 0 1">', f'<body name="thigh" pos="0 0 1" {turn}>')
    text = text.replace('<position name="hip_servo" joint="hip" kp="40"/>', "")
    model = mujoco.MjModel.from_xml_string(text)
    model.dof_frictionloss[0] = friction
    return model


def moved(model, seconds=3.0, seed=0):
    """A log of the knee under random steps of its torque, 100 Hz."""
    random, data = np.random.default_rng(seed), mujoco.MjData(model)
    rows, torque = [], 0.0
    for i in range(int(100 * seconds)):
        torque = random.uniform(-0.6, 0.6) if i % 40 == 0 else torque
        rows.append([0.01 * i, *data.qpos, *data.qvel, torque])
        data.ctrl[:] = torque
        mujoco.mj_step(model, data, 5)
    return dict(zip(["t", "knee", "knee_vel", "knee_motor"], np.array(rows).T))


@pytest.mark.parametrize(("locked", "angle"), [("hip", 0.0), (["h?p"], 0.0), ({"hip": 0.3}, 0.3), ({"hip": -0.5, "h*": 2.0}, -0.5)])
def test_a_locked_joint_is_as_a_weld(locked, angle):
    arm = gm.Simulator(ARM, locked=locked)
    log = moved(welded(angle))
    rollout = gpsindy.simulate(arm.model, log, initial={"knee": 0.0, "knee_vel": 0.0})[0].x
    assert np.abs(log["knee"]).max() > 0.3
    assert np.abs(rollout - np.column_stack([log["knee"], log["knee_vel"]])).max() < 1e-4


def test_nothing_of_a_locked_joint_is_asked_for_or_suspected():
    arm = gm.Simulator(ARM, locked="hip")
    assert [state.name for state in arm.model.states] == ["knee", "knee_vel"]
    assert [control.name for control in arm.model.controls] == ["knee_motor"]
    assert {setting.name for setting in arm.settings} == {*(f"knee.{n}" for n in ("frictionloss", "damping", "armature", "stiffness")), "calf.mass", "gravity.x"}
    free = {setting.name for setting in gm.Simulator(ARM).settings}
    assert {"hip.damping", "hip_servo.kp", "thigh.mass"} < free


def test_a_driver_goes_around_the_motors_that_are_left():
    arm = gm.Simulator(ARM.replace("position", "motor").replace(' kp="40"', ""), drivers={"*": (3.0, 0.1)}, locked={"hip": 0.3})
    assert {s.name for s in arm.settings if s.driver} == {"knee_motor.kp", "knee_motor.kd"}
    log = {"t": np.arange(0.0, 4.0, 0.01), "knee_motor": np.full(400, 0.5)}
    rollout = gpsindy.simulate(arm.model, log, initial={"knee": 0.0, "knee_vel": 0.0})[0].x
    hanging = welded(0.3)
    data = mujoco.MjData(hanging)
    for _ in range(2000):
        data.ctrl[0] = 3.0 * (0.5 - data.qpos[0]) - 0.1 * data.qvel[0]
        mujoco.mj_step(hanging, data)
    assert rollout[-1, 0] == pytest.approx(float(data.qpos[0]), abs=1e-3)


@pytest.mark.parametrize(
    ("locked", "words"),
    [
        ("elbow", "locked: the model has no joint"),
        ("*", "every joint is locked, so nothing moves"),
        ({"hip": float("nan")}, "joint 'hip': the position must be finite"),
    ],
)
def test_what_can_not_be_locked_is_refused(locked, words):
    with pytest.raises(ValueError, match=words):
        gm.Simulator(ARM, locked=locked)


def test_a_correction_goes_into_the_whole_robot(tmp_path):
    random = np.random.default_rng(1)
    logs = [moved(welded(0.3, friction=0.15), seconds=4.0, seed=seed) for seed in range(3)]
    for log in logs:
        log["knee"] = log["knee"] + 1e-3 * random.standard_normal(len(log["t"]))
        log["knee_vel"] = log["knee_vel"] + 1e-2 * random.standard_normal(len(log["t"]))
    (tmp_path / "arm.xml").write_text(ARM)
    arm = gm.Simulator(tmp_path / "arm.xml", locked={"hip": 0.3})
    found = gpsindy.diagnose(arm, logs, effects=["coulomb_friction", "bias"], hold="zero", most_effects=1)
    assert [(cause.effect, cause.place) for cause in found.included] == [("coulomb_friction", "knee_torque")], found
    found.save(tmp_path)
    corrected = mujoco.MjModel.from_xml_path(str(tmp_path / "augmented.xml"))
    assert [float(v) for v in corrected.dof_frictionloss] == pytest.approx([0.0, 0.15], abs=0.01)
    assert corrected.nu == 2 and corrected.dof_armature[0] == pytest.approx(0.01)
