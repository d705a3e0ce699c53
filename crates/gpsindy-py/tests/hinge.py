"""A hinge with one motor as a MuJoCo model, and logs of it, shared by tests; tests that take them need the package mujoco."""

from __future__ import annotations

import operator

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

HINGE = """
<mujoco model="hinge">
  <!-- measured on the bench -->
  <option timestep="0.005"/>
  <worldbody>
    <body name="link">
      <joint name="hinge" type="hinge" axis="0 1 0" damping="0.05" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.5"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="drive" joint="hinge"/>  <!-- torque, N m -->
  </actuator>
</mujoco>
"""

SERVO = HINGE.replace('<motor name="drive" joint="hinge"/>', '<position name="drive" joint="hinge" kp="5" kv="0.4"/>')


def real_log(seed, text=HINGE, *, seconds=4.0, late=0, **fields):
    """50 Hz log of the model with other fields, stepped by MuJoCo; the command acts `late` steps later."""
    model = mujoco.MjModel.from_xml_string(text)
    for name, value in fields.items():
        operator.attrgetter(name)(model)[:] = value
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 0.02)
    u = np.repeat(rng.uniform(-1.2, 1.2, len(t) // 20), 20)
    per = round(0.02 / model.opt.timestep)
    rows = []
    for i in range(len(t)):
        rows.append((data.qpos[0], data.qvel[0]))
        for step in range(i * per, (i + 1) * per):
            data.ctrl[0] = u[max(0, step - late) // per]
            mujoco.mj_step(model, data)
    x = np.array(rows) + rng.standard_normal((len(t), 2)) * [1e-3, 1e-2]
    return {"t": t, "hinge": x[:, 0], "hinge_vel": x[:, 1], "drive": u}
