"""Joints and actuators by name: asking about some of them, twins between them, and the summary by joint."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import gpsindy
from program import command, write_log

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")

ARM = """
<mujoco model="arm">
  <option timestep="0.005"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.5" armature="0.02"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1.2"/>
      <body name="fore" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" damping="0.2" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.02" mass="0.6"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="40" kv="3"/>
    <position name="elbow" joint="elbow" kp="20" kv="2"/>
  </actuator>
</mujoco>
"""
COLUMNS = ["shoulder", "elbow", "shoulder_vel", "elbow_vel", "shoulder_ctrl", "elbow_ctrl"]


def arm_log(seed, change=lambda model: None, *, text=ARM, seconds=4.0):
    """50 Hz log of the arm under steps of both commands, stepped by MuJoCo; noise of 1 mrad and 10 mrad/s."""
    model = mujoco.MjModel.from_xml_string(text)
    change(model)
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    n = int(50 * seconds)
    u = np.column_stack([np.repeat(random.uniform(-0.8, 0.8, n // k + 1), k)[:n] for k in (25, 20)])
    rows = []
    for i in range(n):
        rows.append([*data.qpos, *data.qvel])
        data.ctrl[:] = u[i]
        mujoco.mj_step(model, data, 4)
    x = np.array(rows) + random.standard_normal((n, 4)) * [1e-3, 1e-3, 1e-2, 1e-2]
    return {"t": 0.02 * np.arange(n), **dict(zip(COLUMNS, np.column_stack([x, u]).T))}


def rubbing(size):
    def change(model):
        model.dof_frictionloss[0] = size

    return change


def damped(model):
    model.dof_damping[1] = 0.5


def servoed(model):
    model.actuator_biasprm[1, 2] = -2.3


def is_friction(says, truth):
    """Whether what is said of a joint is this friction, N m: to half a percent, and within the interval."""
    size, low, high = map(float, re.fullmatch(r"friction \+(\S+) N m \((\S+) to (\S+)\)", says).groups())
    return size == pytest.approx(truth, rel=0.005) and low < truth < high


def test_parts_hold_what_is_theirs():
    parts = {(kind, name): tuple(map(set, rest)) for kind, name, *rest in gm.Simulator(ARM)._parts()}
    states, controls, ports, parameters = parts["joint", "elbow"]
    assert (states, controls, ports) == ({"elbow", "elbow_vel"}, {"elbow_ctrl"}, {"elbow_torque"})
    assert parameters == {f"elbow.{name}" for name in ("frictionloss", "damping", "armature", "stiffness", "kp", "kv")} | {"fore.mass"}
    assert parts["actuator", "elbow"] == (set(), {"elbow_ctrl"}, set(), {"elbow.kp", "elbow.kv"})


@pytest.mark.parametrize("kind", ["joints", "actuators"])
def test_a_part_that_is_not_there_is_named_with_one_that_is_near(kind):
    logs = [arm_log(seed) for seed in range(2)]
    with pytest.raises(ValueError, match=rf"{kind}: the model has no {kind[:-1]} `elbw`; did you mean `elbow`"):
        gpsindy.diagnose(gm.Simulator(ARM), logs, **{kind: ["elbw"]})


def test_a_simulator_without_joints_refuses_them(cart):
    with pytest.raises(ValueError, match="does not name its joints"):
        gpsindy.diagnose(cart, {"t": [0.0, 1.0], "x": [0.0, 1.0], "v": [0.0, 1.0], "u": [0.0, 1.0]}, joints="hip")


def test_only_what_is_asked_is_suspected_and_the_report_sums_up_by_joint():
    logs = [arm_log(seed, rubbing(0.25)) for seed in range(3)]
    settings = {"effects": ["coulomb_friction", "bias", "input_delay", "parameter_error"], "hold": "zero", "most_effects": 1}
    found = gpsindy.diagnose(gm.Simulator(ARM), logs, **settings)
    shoulder = found.by_joint["shoulder"]
    assert is_friction(shoulder, 0.25), found.by_joint
    assert found.by_joint["elbow"].startswith("nothing above 0.0"), found.by_joint
    assert "By joint" in found.summary() and f"shoulder: {shoulder}" in found.html().replace("</th><td>", ": ")
    asked = gpsindy.diagnose(gm.Simulator(ARM), logs, joints=["elbow"], **settings)
    assert asked.by_joint["shoulder"] == "not asked"
    # What is left without a name is no suspect, and may depend on the other joint.
    named = [cause for cause in asked.causes if cause.effect != "function"]
    assert all("shoulder" not in (cause.place or "") + "".join(cause.variables) for cause in named)
    assert asked.prediction_set is None and "suspects" in asked.no_prediction_set
    assert asked.verdict == "unexplained" and any("only effects in elbow" in note for note in asked.notes)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize("change", [damped, servoed])
def test_numbers_of_the_engine_that_no_log_can_part_are_twins_in_both_directions(change, integrator):
    text = ARM.replace('timestep="0.005"', f'timestep="0.005" integrator="{integrator}"')
    logs = [arm_log(seed, change, text=text) for seed in range(3)]
    found = gpsindy.diagnose(gm.Simulator(text), logs, effects=["parameter_error"], hold="zero", most_effects=1)
    cause = found.included[0]
    names = {cause.variables[0], *(twin["variables"][0] for twin in cause.twins)}
    assert {"elbow.kv", "elbow.damping"} <= names, (cause, integrator)
    assert cause.equivalent == ("parameter_error",)
    sizes = {twin["variables"][0]: twin["parameters"][0]["value"] for twin in cause.twins}
    sizes[cause.variables[0]] = cause.parameters[0]["value"]
    assert sizes["elbow.kv"] - 2.0 == pytest.approx(0.3, abs=0.02)
    assert sizes["elbow.damping"] - 0.2 == pytest.approx(0.3, abs=0.02)
    assert "cannot distinguish it from wrong parameter elbow." in found.summary(200)
    assert cause.next_experiment is not None and "the servo off" in cause.next_experiment
    drawn = found.randomization()
    (twin,) = {"elbow.kv", "elbow.damping"} - {cause.variables[0]}
    assert drawn[cause.variables[0]].identified and twin not in {one.name for one in drawn.ranges}
    assert any(note.startswith(f"No range: {twin} does on these logs what {cause.variables[0]} does") for note in drawn.notes)


def test_a_size_that_differs_between_recordings_is_told_by_run_and_pooled():
    sizes = [0.15, 0.25, 0.35]
    logs = [arm_log(seed, rubbing(size)) for seed, size in enumerate(sizes)]
    found = gpsindy.diagnose(
        gm.Simulator(ARM), logs, arm_log(9, rubbing(0.25)), effects=["coulomb_friction", "bias"], hold="zero", most_effects=1
    )
    (between,) = (row for row in found.included[0].between_runs if row["parameter"] == "c")
    assert [run["value"] for run in between["runs"]] == pytest.approx(sizes, abs=0.03)
    assert between["pooled"] == pytest.approx(0.25, abs=0.03) and between["spread"] == pytest.approx(0.1, abs=0.03)
    assert between["low"] < 0.25 < between["high"] and between["share"] > 0.95 and between["p_value"] < 1e-6
    assert "from run to run" in found.summary(200)
    # What differs from run to run is what to randomise.
    (rubbed,) = (one for one in found.randomization().ranges if one.name.endswith(".frictionloss") and one.identified)
    assert rubbed.low < 0.15 and rubbed.high > 0.35, rubbed
    same = gpsindy.diagnose(
        gm.Simulator(ARM), [arm_log(seed, rubbing(0.25)) for seed in range(3)], arm_log(9, rubbing(0.25)),
        effects=["coulomb_friction", "bias"], hold="zero", most_effects=1,
    )  # fmt: skip
    (between,) = (row for row in same.included[0].between_runs if row["parameter"] == "c")
    assert between["spread"] < 0.01 and abs(between["pooled"] - 0.25) < 0.01
    (rubbed,) = (one for one in same.randomization().ranges if one.name.endswith(".frictionloss") and one.identified)
    assert rubbed.high - rubbed.low < 0.05, rubbed


def test_rollouts_of_a_right_model_are_as_long_as_its_logs():
    found = gpsindy.diagnose(gm.Simulator(ARM), [arm_log(seed) for seed in range(3)], effects=["bias"], hold="zero")
    assert found.verdict == "no_gap" and not any("rollouts of" in note for note in found.notes), found.notes
    assert found.by_joint["elbow"].startswith("nothing above")


def test_what_the_logs_pin_has_no_prior_range():
    """Gains and dampings of a right model: an error of theirs is excluded, so their ranges are cut where it would have shown."""
    found = gpsindy.diagnose(gm.Simulator(ARM), [arm_log(seed) for seed in range(3)], effects=["parameter_error"], hold="zero")
    pinned = {row["variables"][0]: row["above"] for row in found.to_dict()["excluded"]}
    assert pinned["shoulder.kp"] < 0.4 and pinned["elbow.kv"] < 0.1 and pinned["shoulder.damping"] < 0.1, pinned
    kp = found.randomization()["shoulder.kp"]
    assert 39.5 < kp.low < 40.0 < kp.high < 40.5


def test_the_command_takes_joints_and_drivers_and_refuses_them_elsewhere(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM)
    for seed in range(3):
        write_log(tmp_path / f"run_{seed}.csv", arm_log(seed, rubbing(0.25)))
    logs = [f"run_{seed}.csv" for seed in range(3)]
    line = ["diagnose", "arm.xml", *logs, "--hold", "zero", "--effects", "coulomb_friction,bias"]
    done = command(*line, "--joint", "shoulder", "--json", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    stated = {row["part"]: row for row in json.loads(done.stdout)["by_part"]}
    assert stated["elbow"]["says"] == "not asked" and is_friction(stated["shoulder"]["says"], 0.25)
    for option, words in [
        (["--joint", "sholder"], "--joint: the model has no joint `sholder`; did you mean `shoulder`?"),
        (["--driver", "shoulder=1,0.1"], "is no motor on a joint"),
        (["--driver", "shoulder"], "expected ACTUATOR=KP,KD"),
        (["--base", "fixed"], "the model has no free joint"),
    ]:
        wrong = command(*line, *option, folder=tmp_path)
        assert wrong.returncode == 2 and words in wrong.stderr, wrong.stderr
    (tmp_path / "model.toml").write_text('[[state]]\nname = "x"\nequation = "-x"\n')
    wrong = command("diagnose", "model.toml", "run_0.csv", "--joint", "x", folder=tmp_path)
    assert wrong.returncode == 2 and "does not name its joints" in wrong.stderr
