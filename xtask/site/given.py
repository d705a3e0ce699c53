"""The files that the pages name as given, `run_1.csv` or `simulator.toml`: `python given.py FOLDER`."""

import pathlib
import subprocess
import sys

import numpy as np

SIMULATOR = """schema = "gpsindy.model/1"
name = "cart"

[[state]]
name = "x"
unit = "m"
equation = "v"

[[state]]
name = "v"
unit = "m/s"
equation = "(u - k*x - b*v)/m"

[[control]]
name = "u"
unit = "N"

[[parameter]]
name = "m"
value = 1.2
unit = "kg"

[[parameter]]
name = "k"
value = 4.0
unit = "N/m"

[[parameter]]
name = "b"
value = 0.3
unit = "N*s/m"
"""

ROBOT = """<mujoco model="robot">
  <option timestep="0.01" integrator="implicitfast"/>
  <worldbody>
    <body name="fore">
      <joint name="elbow" axis="0 1 0" damping="0.1" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.015" mass="0.3"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="motor" joint="elbow"/>
  </actuator>
</mujoco>
"""

LEG = """<mujoco model="leg">
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="shank">
      <joint name="knee" axis="0 1 0" damping="0.1" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.015" mass="0.3"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="knee_drive" joint="knee" ctrlrange="-30 30"/>
  </actuator>
</mujoco>
"""

FLEET = """model = "simulator.toml"

[[unit]]
unit = "cart 1"
logs = "run_*.csv"

[[unit]]
unit = "cart 2"
logs = ["check_1.csv", "check_2.csv"]
"""

PERIOD, SAMPLES, STEPS = 0.02, 400, 20


def commands(random, size):
    """A control that jumps twice a second and is held."""
    return np.repeat(random.uniform(-size, size, SAMPLES // 25), 25)


def cart(seed, drag):
    """Log of the cart of the simulator; the machine has a drag that grows with the square of its speed."""
    random = np.random.default_rng(seed)
    u, x, v, rows = commands(random, 4.0), 0.0, 0.0, []
    h = PERIOD / STEPS
    for command in u:
        rows.append((x, v))
        for _ in range(STEPS):
            v += h * ((command - 4.0 * x - 0.3 * v) / 1.2 - drag * v * abs(v))
            x += h * v
    x, v = (np.array(rows) + random.standard_normal((SAMPLES, 2)) * [0.002, 0.005]).T
    return {"t": PERIOD * np.arange(SAMPLES), "x": x, "v": v, "u": u}


def arm(seed):
    """Log of the robot; the machine has dry friction in its elbow."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(ROBOT)
    model.dof_frictionloss[0] = 0.05
    random, data = np.random.default_rng(seed), mujoco.MjData(model)
    u, q = commands(random, 0.5), []
    for command in u:
        q.append(data.qpos[0])
        data.ctrl[0] = command
        mujoco.mj_step(model, data, 2)
    return {"t": PERIOD * np.arange(SAMPLES), "q": np.array(q) + 1e-3 * random.standard_normal(SAMPLES), "u": u}


def leg(seed):
    """Log of a knee under the loop of its driver, kp 40 and kd 1; the machine has dry friction."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(LEG)
    model.dof_frictionloss[0] = 0.2
    random, data = np.random.default_rng(seed), mujoco.MjData(model)
    wanted, q = commands(random, 0.5), []
    for command in wanted:
        q.append(data.qpos[0])
        for _ in range(10):
            data.ctrl[0] = 40.0 * (command - data.qpos[0]) - 1.0 * data.qvel[0]
            mujoco.mj_step(model, data)
    return {"t": PERIOD * np.arange(SAMPLES), "knee": np.array(q) + 1e-4 * random.standard_normal(SAMPLES), "knee_drive": wanted}


def swing(seed):
    """Log of the pendulum of the FMU; the machine has a damping of 0.35 N m s."""
    random, t = np.random.default_rng(seed), PERIOD * np.arange(SAMPLES)
    u = sum(random.uniform(1, 3) * np.sin(2 * np.pi * f * t + random.uniform(0, 6)) for f in (0.3, 0.7, 1.1))
    th, w, rows, h = 0.0, 0.0, [], PERIOD / STEPS
    for torque in u:
        rows.append(th)
        for _ in range(STEPS):
            w += h * ((torque - 0.35 * w) / 0.8 - 9.81 * np.sin(th))
            th += h * w
    return {"t": t, "th": np.array(rows) + 1e-3 * random.standard_normal(SAMPLES), "u": u}


def main():
    folder = pathlib.Path(sys.argv[1])
    texts = {"simulator.toml": SIMULATOR, "robot.xml": ROBOT, "leg.xml": LEG, "fleet.toml": FLEET}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    logs = {f"run_{k}": cart(k, 0.3) for k in (1, 2, 3)} | {f"check_{k}": cart(10 + k, 0.3) for k in (1, 2)}
    logs |= {f"sim_{k}": cart(20 + k, 0.0) for k in (1, 2)} | {f"arm_{k}": arm(k) for k in (1, 2, 3)}
    logs |= {f"swing_{k}": swing(k) for k in (1, 2, 3)} | {f"leg_{k}": leg(k) for k in (1, 2, 3)}
    for name, log in logs.items():
        np.savetxt(folder / f"{name}.csv", np.column_stack(list(log.values())), "%.6f", ",", header=",".join(log), comments="")
    build = pathlib.Path("data/pendulum_fmu/build.py").resolve()
    subprocess.run([sys.executable, str(build)], cwd=folder, check=True)


main()
