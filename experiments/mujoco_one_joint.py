"""How long the whole catalogue takes on a one-joint MuJoCo model, and where the time goes.

Four logs of 10 s at 100 Hz, planted dry friction in MuJoCo itself. Needs gpsindy[mujoco]:

    python experiments/mujoco_one_joint.py [--frictionloss 0.15] [--late 0]
"""

from __future__ import annotations

import argparse
import collections
import time

import mujoco
import numpy as np

import gpsindy
import gpsindy.mujoco

HINGE = """
<mujoco model="hinge">
  <option timestep="0.005"/>
  <worldbody>
    <body name="link">
      <joint name="hinge" type="hinge" axis="0 1 0" damping="0.05" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="hinge"/></actuator>
</mujoco>
"""


def record(seed: int, frictionloss: float, late: int) -> dict[str, np.ndarray]:
    """A log of the machine, stepped by MuJoCo; the command acts ``late`` steps later."""
    model = mujoco.MjModel.from_xml_string(HINGE)
    model.dof_frictionloss[:] = frictionloss
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    t = np.arange(0, 10, 0.01)
    u = np.repeat(rng.uniform(-1.2, 1.2, len(t) // 40), 40)
    rows = []
    for i in range(len(t)):
        rows.append((data.qpos[0], data.qvel[0]))
        for step in (2 * i, 2 * i + 1):
            data.ctrl[0] = u[max(0, step - late) // 2]
            mujoco.mj_step(model, data)
    x = np.array(rows) + rng.standard_normal((len(t), 2)) * [1e-3, 1e-2]
    return {"t": t, "hinge": x[:, 0], "hinge_vel": x[:, 1], "drive": u}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--frictionloss", type=float, default=0.15)
    arguments.add_argument("--late", type=int, default=0, help="physics steps")
    given = arguments.parse_args()
    logs = [record(seed, given.frictionloss, given.late) for seed in range(4)]
    spent: dict[str, float] = collections.defaultdict(float)
    last = ["start", time.perf_counter(), time.process_time()]

    def listen(stage: str, done: int, total: int) -> None:
        now = time.perf_counter()
        spent[last[0]] += now - last[1]
        last[0], last[1] = stage, now

    begun, worked = time.perf_counter(), time.process_time()
    found = gpsindy.diagnose(gpsindy.mujoco.Simulator(HINGE), logs, hold="zero", time_limit=None, progress=listen)
    listen("end", 1, 1)
    wall, work = time.perf_counter() - begun, time.process_time() - worked
    print(found.summary())
    print(f"\n{wall:.1f} s of wall time, {work:.1f} s of processors")
    for stage, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"{seconds:7.1f} s  {stage}")


if __name__ == "__main__":
    main()
