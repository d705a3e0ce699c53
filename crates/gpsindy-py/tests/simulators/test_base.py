"""Robots with a free base: on a stand, or moved as the logs say."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")

LEG = """
<mujoco model="leg">
  <option timestep="0.002"/>
  <worldbody>
    <body name="trunk" pos="0 0 0.5">
      <freejoint name="root"/>
      <geom type="box" size="0.2 0.1 0.05" mass="6" contype="0" conaffinity="0"/>
      <body name="thigh" pos="0.2 0 0">
        <joint name="hip" axis="0 1 0" armature="0.01" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.8"/>
        <body name="calf" pos="0 0 -0.2">
          <joint name="knee" axis="0 1 0" armature="0.01" damping="0.1"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.015" mass="0.3"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="hip_motor" joint="hip" ctrlrange="-30 30"/>
    <motor name="knee_motor" joint="knee" ctrlrange="-30 30"/>
  </actuator>
</mujoco>
"""
DRIVERS = {"*_motor": (40.0, 1.0)}
COLUMNS = ["hip", "knee", "hip_vel", "knee_vel", "hip_motor", "knee_motor"]
REST = dict.fromkeys(COLUMNS[:4], 0.0)


def chirps(seconds, rate=500.0):
    """Wanted angles: chirps of 0.5 to 6 Hz, other ones for each joint."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    phase = 2.0 * np.pi * (0.5 * t + 0.5 * 5.5 / seconds * t**2)
    return t, np.column_stack([0.4 * np.sin(phase), 0.5 * np.sin(0.7 * phase + 0.4)])


def stepped(joint, tilt=None, *, seconds=2.0, change=lambda model: None):
    """Columns of a log of the leg at 500 Hz with `joint` in place of the free one, the trunk tilted by a firm servo to `tilt(t)`."""
    text = LEG.replace('<freejoint name="root"/>', joint)
    if tilt is not None:
        text = text.replace("<actuator>", '<actuator><position name="tilt" joint="tilt" kp="2e5" kv="4e4"/>')
    model = mujoco.MjModel.from_xml_string(text)
    change(model)
    data = mujoco.MjData(model)
    t, u = chirps(seconds)
    first = 0 if tilt is None else 1
    rows, base = [], []
    for i in range(len(t)):
        q, v = data.qpos[first:].copy(), data.qvel[first:].copy()
        rows.append([*q, *v])
        data.ctrl[first:] = 40.0 * (u[i] - q) - v
        if tilt is not None:
            angle, rate = float(data.qpos[0]), float(data.qvel[0])
            data.ctrl[0] = tilt(t[i])
        mujoco.mj_step(model, data)
        if tilt is not None:
            faster = (float(data.qvel[0]) - rate) / model.opt.timestep
            base.append([np.cos(angle / 2), 0, np.sin(angle / 2), 0, 0, rate, 0, 0, faster, 0])
    log = {"t": t, **dict(zip(COLUMNS, np.column_stack([np.array(rows), u]).T))}
    if base:
        names = [*(f"base_q{axis}" for axis in "wxyz"), *(f"base_w{axis}" for axis in "xyz"), *(f"base_dw{axis}" for axis in "xyz")]
        log |= dict(zip(names, np.array(base).T))
    return log


def error(log, base):
    found = gm.Simulator(LEG, drivers=DRIVERS, base=base)
    rollout = gpsindy.simulate(found.model, log, initial=REST)[0].x
    return np.abs(rollout - np.column_stack([log[name] for name in COLUMNS[:4]])).max()


def test_on_a_stand_it_moves_as_with_the_joint_taken_out():
    assert error(stepped(""), "fixed") < 1e-5


def test_a_base_that_moves_as_logged_takes_its_legs_along():
    log = stepped('<joint name="tilt" axis="0 1 0" armature="2000"/>', lambda t: 0.4 * np.sin(2.0 * np.pi * t))
    assert np.abs(log["base_qy"]).max() > 0.1
    assert error(log, "imu") < 1e-4 < 1e-2 < error(log, "fixed")


@pytest.mark.parametrize(
    ("text", "base", "words"),
    [
        (LEG, None, "joint 'root' is a free joint: say how the base moves"),
        (LEG, "floating", "base: expected 'fixed', 'imu' or 'pose', found 'floating'"),
        (LEG.replace('<freejoint name="root"/>', ""), "imu", "the model has no free joint"),
        (LEG.replace("<worldbody>", '<worldbody><geom type="plane" size="1 1 1"/>'), "imu", "do not say how far away it is"),
        (LEG.replace("</worldbody>", '<body><freejoint/><geom size="0.1"/></body></worldbody>'), "fixed", "2 free joints"),
    ],
)
def test_what_the_logs_can_not_tell_of_a_base_is_refused(text, base, words):
    with pytest.raises(ValueError, match=words):
        gm.Simulator(text, base=base)


def test_a_leg_on_a_stand_goes_from_mjcf_to_ranges(tmp_path):
    def rubbing(model):
        model.dof_frictionloss[1] = 0.4

    random = np.random.default_rng(1)
    logs = []
    for seconds in (2.0, 2.5, 3.0):
        log = stepped("", seconds=seconds, change=rubbing)
        for name, noise in zip(COLUMNS[:4], [5e-4, 5e-4, 1e-2, 1e-2]):
            log[name] = log[name] + noise * random.standard_normal(len(log["t"]))
        logs.append(log)
    (tmp_path / "leg.xml").write_text(LEG)
    leg = gm.Simulator(tmp_path / "leg.xml", drivers=DRIVERS, base="fixed")
    found = gpsindy.diagnose(leg, logs, joints=["knee"], effects=["coulomb_friction", "bias", "input_delay"], hold="zero", most_effects=1)
    assert [(cause.effect, cause.place) for cause in found.included] == [("coulomb_friction", "knee_torque")], found
    assert found.by_joint["knee"].startswith("friction +0.4 N m"), found.by_joint
    found.save(tmp_path)
    corrected = mujoco.MjModel.from_xml_path(str(tmp_path / "augmented.xml"))
    assert corrected.dof_frictionloss[-1] == pytest.approx(0.4, abs=0.02)
    ranges: dict[str, dict[str, tuple[float, float]]] = {}
    exec((tmp_path / "randomization.py").read_text(), ranges)
    low, high = ranges["IDENTIFIED"]["knee.frictionloss"]
    assert low < 0.4 < high
