"""Diagnoses of a six-joint arm in MuJoCo whose effects are planted in MuJoCo itself.

    python experiments/mujoco_arm.py so101.xml 0 32 [--sysid] [--limit 600]

``so101.xml``: the arm of the model zoo (mujoco_menagerie, robotstudio_so101), without shapes. Seeds below 24 draw one effect (even
seeds) or two (odd ones) of: dry friction of a joint, its armature, a delay of its command, its servo's gain, its play as a second
joint, a payload; from 24 on nothing is planted. Four logs of 10 s at 100 Hz, the last held out; commands are steps between random
angles, noise is 1 mrad and 10 mrad/s. Needs gpsindy[mujoco]; ``--sysid`` also fits friction, damping and armature of all joints to the
same logs by mujoco.sysid, from ``pip install mujoco[sysid]``.
"""

from __future__ import annotations

import argparse
import pathlib
import time
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

import gpsindy
import gpsindy.mujoco

JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
KINDS = ["friction", "armature", "delay", "kp", "play", "payload"]
CASES, SECONDS, PERIOD, NOISE = 24, 10.0, 0.01, (1e-3, 1e-2)
HELD_OUT = 100
"""Samples of a rollout by which two corrected models are compared: 1 s."""

Planted = dict[tuple[str, str], float]
"""Size by kind and joint."""


def drawn(seed: int) -> Planted:
    """What is planted: nothing, one effect or two on different joints."""
    if seed >= CASES:
        return {}
    random = np.random.default_rng(seed)
    kinds = [KINDS[(seed // 2) % len(KINDS)]]
    if seed % 2:
        kinds.append(str(random.choice([kind for kind in KINDS if kind != kinds[0]])))
    joints = random.permutation(JOINTS)
    sizes = {
        "friction": random.uniform(0.1, 0.5),
        "armature": random.uniform(1.5, 3.0),
        "delay": float(random.integers(2, 9)),
        "kp": random.uniform(0.3, 0.6),
        "play": random.uniform(0.02, 0.06),
        "payload": random.uniform(0.05, 0.2),
    }
    return {(kind, "" if kind == "payload" else str(joint)): float(sizes[kind]) for kind, joint in zip(kinds, joints)}


class Machine:
    """The arm with what is planted, stepped by MuJoCo."""

    def __init__(self, text: str, planted: Planted) -> None:
        spec = mujoco.MjSpec.from_string(text)
        self._late: dict[int, int] = {}
        self._plays: dict[str, str] = {}
        for (kind, joint), size in planted.items():
            if kind == "friction":
                spec.joint(joint).frictionloss += size
            elif kind == "armature":
                spec.joint(joint).armature *= size
            elif kind == "kp":
                servo = spec.actuator(joint)
                servo.gainprm[0] *= size
                servo.biasprm[1] *= size
            elif kind == "payload":
                spec.body("gripper").mass += size
            elif kind == "play":
                old, name = spec.joint(joint), f"{joint}_play"
                half = 0.5 * size
                old.parent.add_joint(
                    name=name, type=old.type, axis=old.axis, limited=True, range=[-half, half], armature=1e-3, damping=1e-2
                )
                self._plays[joint] = name
        self.model = spec.compile()
        for (kind, joint), size in planted.items():
            if kind == "delay":
                self._late[self.model.actuator(joint).id] = int(size)
        names = [self.model.joint(j).name for j in range(self.model.njnt)]
        self.joints = [name for name in names if not name.endswith("_play")]

    def log(self, seed: int) -> dict[str, np.ndarray]:
        """A log under random steps, with noise."""
        m, d, random = self.model, mujoco.MjData(self.model), np.random.default_rng(seed)
        count, per = round(SECONDS / PERIOD), round(PERIOD / m.opt.timestep)
        low, high = 0.5 * m.actuator_ctrlrange.T
        u = np.zeros((count, m.nu))
        for a in range(m.nu):
            ends = np.cumsum(random.integers(30, 120, count))
            targets = random.uniform(low[a], high[a], count)
            u[:, a] = targets[np.searchsorted(ends, np.arange(count), side="right")]
        rows = np.zeros((count, 2, len(self.joints)))
        for i in range(count):
            for j, name in enumerate(self.joints):
                parts = [name, self._plays[name]] if name in self._plays else [name]
                rows[i, 0, j] = sum(d.qpos[m.joint(part).qposadr[0]] for part in parts)
                rows[i, 1, j] = sum(d.qvel[m.joint(part).dofadr[0]] for part in parts)
            for step in range(i * per, (i + 1) * per):
                for a in range(m.nu):
                    d.ctrl[a] = u[max(0, step - self._late.get(a, 0)) // per, a]
                mujoco.mj_step(m, d)
        rows += random.standard_normal(rows.shape) * np.array(NOISE)[None, :, None]
        log = {"t": PERIOD * np.arange(count)}
        for j, name in enumerate(self.joints):
            log |= {name: rows[:, 0, j], f"{name}_vel": rows[:, 1, j], f"{name}_ctrl": u[:, j]}
        return log


def summary(cause: Any) -> tuple[str, str]:
    """Kind and joint of a cause, in this script's words."""
    place = (cause.place or "").removesuffix("_torque")
    variable = cause.variables[0] if cause.variables else ""
    joint = variable.removesuffix("_ctrl").removesuffix("_vel")
    own, _, attribute = variable.partition(".")
    kinds = {"coulomb_friction": ("friction", place or joint), "inertia": ("armature", place), "input_delay": ("delay", joint)}
    if cause.effect == "parameter_error":
        in_hand = attribute == "mass" and own in ("gripper", "moving_jaw")
        # The arm has dry friction already, so that more of it is another value of that.
        return ("payload", "") if in_hand else ("friction" if attribute == "frictionloss" else attribute, own)
    if cause.effect in ("backlash", "gear_play"):
        return "play", joint or place
    return kinds.get(cause.effect, (cause.effect, place or joint))


def error(model: Any, log: dict[str, np.ndarray], joints: Iterable[str]) -> float:
    """Root mean square error of rollouts of 1 s from measured states, in units of the noise."""
    squares, columns = [], [name for joint in joints for name in (joint, f"{joint}_vel")]
    states = [state.name for state in model.states]
    for first in range(0, len(log["t"]) - HELD_OUT, HELD_OUT):
        piece = {name: values[first : first + HELD_OUT] for name, values in log.items()}
        rollout = gpsindy.simulate(model, piece, initial={name: piece[name][0] for name in columns})[0]
        for name in columns:
            noise = NOISE[1] if name.endswith("_vel") else NOISE[0]
            difference = rollout.x[:, states.index(name)] - piece[name][: len(rollout.x)]
            squares.append(np.mean((difference / noise) ** 2))
    return float(np.sqrt(np.mean(squares)))


def fitted_by_sysid(text: str, logs: list[dict[str, np.ndarray]], joints: list[str]) -> Any:
    """Friction, damping and armature of all joints by mujoco.sysid; the model."""
    from mujoco import sysid

    spec = mujoco.MjSpec.from_string(text)
    for name in joints:
        for kind, suffix in ((mujoco.mjtSensor.mjSENS_JOINTPOS, "pos"), (mujoco.mjtSensor.mjSENS_JOINTVEL, "vel")):
            spec.add_sensor(name=f"{name}_{suffix}", type=kind, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=name)
    model = spec.compile()
    parameters = sysid.ParameterDict()
    for name in joints:
        for attribute, dof in (("frictionloss", model.dof_frictionloss), ("damping", model.dof_damping), ("armature", model.dof_armature)):
            value = float(np.ravel(dof[model.joint(name).dofadr[0]])[0])

            def change(spec: Any, parameter: Any, name: str = name, attribute: str = attribute) -> None:
                joint = spec.joint(name)
                if attribute == "damping" and np.ndim(joint.damping):
                    joint.damping[0] = parameter.value[0]
                else:
                    setattr(joint, attribute, float(parameter.value[0]))

            parameters.add(
                sysid.Parameter(f"{name}_{attribute}", nominal=value, min_value=0.0 if attribute != "armature" else 1e-3, max_value=10 * value, modifier=change)
            )
    starts, commands, readings = [], [], []
    for log in logs:
        q = np.array([log[name][0] for name in joints])
        v = np.array([log[f"{name}_vel"][0] for name in joints])
        starts.append(sysid.create_initial_state(model, q, v, np.zeros(0)))
        commands.append(sysid.TimeSeries(log["t"], np.column_stack([log[f"{name}_ctrl"] for name in joints])))
        columns = [log[column] for name in joints for column in (name, f"{name}_vel")]
        readings.append(sysid.TimeSeries.from_names(log["t"], np.column_stack(columns), model))
    sequences = sysid.ModelSequences("arm", spec, [f"log {i}" for i in range(len(logs))], starts, commands, readings)
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    found, _ = sysid.optimize(initial_params=parameters, residual_fn=residual, optimizer="mujoco", verbose=False)
    return sysid.apply_param_modifiers(found, mujoco.MjSpec.from_string(text))


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("arm", type=pathlib.Path)
    arguments.add_argument("first", type=int)
    arguments.add_argument("last", type=int)
    arguments.add_argument("--sysid", action="store_true")
    arguments.add_argument("--limit", type=float, default=600.0, help="seconds a diagnosis")
    given = arguments.parse_args()
    text = given.arm.read_text(encoding="utf-8")
    right, quiet, no_larger, closures, times = 0, 0, 0, [], []
    for seed in range(given.first, given.last):
        planted = drawn(seed)
        machine = Machine(text, planted)
        logs = [machine.log(100 * seed + run) for run in range(4)]
        begun = time.perf_counter()
        simulator = gpsindy.mujoco.Simulator(text)
        found = gpsindy.diagnose(simulator, logs[:-1], holdout=logs[-1:], hold="zero", time_limit=given.limit)
        times.append(time.perf_counter() - begun)
        named = {summary(cause): cause for cause in found.included}
        closed = found.closure["closed"]
        is_right = set(named) == set(planted) and (bool(planted) or found.verdict == "no_gap")
        right, quiet = right + (is_right and bool(planted)), quiet + (is_right and not planted)
        if planted and closed is not None:
            closures.append(closed)
        words = [f"{kind} {joint} at {cause.probability:.2f}" for (kind, joint), cause in named.items()]
        truth = [f"{kind} {joint} of {size:.3g}" for (kind, joint), size in planted.items()] or ["nothing"]
        share = "-" if closed is None else f"{closed:.3f}"
        print(f"{seed} {'+' if is_right else '-'} {', '.join(truth)} | {found.verdict}: {', '.join(words) or 'nothing'}; "
              f"closed {share}; {times[-1]:.0f} s", flush=True)  # fmt: skip
        if given.sysid and planted:
            begun = time.perf_counter()
            peer = gpsindy.mujoco.Simulator(fitted_by_sysid(text, logs[:-1], machine.joints)).model
            spent = time.perf_counter() - begun
            ours, theirs = (error(model, logs[-1], machine.joints) for model in (found.augmented, peer))
            no_larger += ours <= theirs
            print(f"   held-out error {ours:.2f} times the noise, mujoco.sysid {theirs:.2f} in {spent:.0f} s", flush=True)
    print(f"right {right}, quiet without a gap {quiet}, of {given.last - given.first}; "
          f"closed at least {min(closures, default=float('nan')):.3f}; slowest {max(times):.0f} s")  # fmt: skip
    if given.sysid:
        print(f"error no larger than that of mujoco.sysid in {no_larger}")


if __name__ == "__main__":
    main()
