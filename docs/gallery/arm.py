from pathlib import Path

robot = """
<mujoco model="arm">
  <!-- two links, as drawn -->
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.3" armature="0.02"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.6"/>
      <body name="fore" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.1" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.015" mass="0.3"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="30" kv="1"/>  <!-- data sheet -->
    <position name="elbow" joint="elbow" kp="15" kv="0.4"/>
  </actuator>
</mujoco>
"""
Path("robot.xml").write_text(robot.strip())

import mujoco
import numpy as np


def machine(seed, n=400):
    model = mujoco.MjModel.from_xml_path("robot.xml")
    model.dof_frictionloss[1] = 0.15
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    u = np.column_stack([np.repeat(random.uniform(-0.8, 0.8, n // k), k)[:n] for k in (25, 20)])
    rows = []
    for i in range(n):
        rows.append([*data.qpos, *data.qvel])
        data.ctrl[:] = u[i]
        mujoco.mj_step(model, data, 4)
    x = np.array(rows) + random.standard_normal((n, 4)) * [1e-3, 1e-3, 1e-2, 1e-2]
    names = ["shoulder", "elbow", "shoulder_vel", "elbow_vel", "shoulder_ctrl", "elbow_ctrl"]
    return {"t": 0.02 * np.arange(n)} | dict(zip(names, np.column_stack([x, u]).T))


for name, seed in {"run_0": 0, "run_1": 1, "run_2": 2, "run_3": 3, "later": 9}.items():
    log = machine(seed)
    np.savetxt(f"{name}.csv", np.column_stack(list(log.values())), delimiter=",", header=",".join(log), comments="")

import json
from pathlib import Path

import mujoco
import numpy as np

report = json.loads(Path("diagnosis/report.json").read_text())
causes = {(c["effect"], *c["variables"]): c for c in report["causes"] if c["included"]}
assert report["verdict"] == "explained" and set(causes) == {("coulomb_friction", "elbow_vel")}, causes.keys()
assert report["closure"]["closed"] > 0.95, report["closure"]
fixed = mujoco.MjModel.from_xml_path("diagnosis/augmented.xml")
assert abs(fixed.dof_frictionloss[1] - 0.15) < 0.01

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt

log = np.genfromtxt("later.csv", delimiter=",", names=True)
figure, axes = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
for path, label in (("robot.xml", "robot.xml"), ("diagnosis/augmented.xml", "augmented.xml")):
    model = mujoco.MjModel.from_xml_path(path)
    data, rows = mujoco.MjData(model), []
    for i in range(len(log["t"])):
        rows.append([*data.qpos])
        data.ctrl[:] = log["shoulder_ctrl"][i], log["elbow_ctrl"][i]
        mujoco.mj_step(model, data, 4)
    for axis, name, q in zip(axes, ("shoulder", "elbow"), np.array(rows).T):
        axis.plot(log["t"], 1e3 * (q - log[name]), label=label)
for axis, name in zip(axes, ("shoulder", "elbow")):
    axis.set_ylabel(f"{name} error, mrad")
axes[0].legend()
axes[1].set_xlabel("time, s")
figure.savefig("arm.png")
