"""MuJoCo models as the nominal simulator: effects planted in MuJoCo itself, and the corrected file."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")

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
        getattr(model, name)[:] = value
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


def test_a_rollout_is_mujocos_own():
    found = gm.Simulator(HINGE).model
    assert [p.name for p in found.ports] == ["hinge_torque"]
    assert {"hinge.frictionloss", "hinge.armature", "link.mass"} <= {p.name for p in found.parameters}
    log = real_log(3)
    rollout = gpsindy.simulate(found, log, initial={"hinge": 0.0, "hinge_vel": 0.0})[0]
    model = mujoco.MjModel.from_xml_string(HINGE)
    data = mujoco.MjData(model)
    for i in range(len(rollout)):
        assert abs(data.qpos[0] - rollout.x[i, 0]) < 1e-9
        data.ctrl[0] = log["drive"][i]
        mujoco.mj_step(model, data, 4)


@pytest.mark.parametrize(
    ("text", "fields", "effect", "place", "variable"),
    [
        (HINGE, {"dof_frictionloss": 0.15}, "coulomb_friction", "hinge_torque", "hinge_vel"),
        (SERVO, {"actuator_gainprm": [[4.0] + [0.0] * 9], "actuator_biasprm": [[0.0, -4.0, -0.4] + [0.0] * 7]},
         "parameter_error", None, "drive.kp"),
    ],
)  # fmt: skip
def test_what_mujoco_has_otherwise_is_found_in_its_place(text, fields, effect, place, variable, tmp_path):
    found = gpsindy.diagnose(
        gm.Simulator(text),
        [real_log(seed, text, **fields) for seed in range(3)],
        effects=["coulomb_friction", "viscous_friction", "parameter_error", "input_gain", "bias"],
        most_effects=1,
        hold="zero",
    )
    cause = found.included[0]
    assert (cause.effect, cause.place, cause.variables) == (effect, place, (variable,))
    # The fix goes back into the user's own file, and that file does what the report says.
    found.augmented.save(tmp_path / "augmented.xml")
    corrected = (tmp_path / "augmented.xml").read_text()
    assert "<!-- measured on the bench -->" in corrected and "<!-- torque, N m -->" in corrected
    log = real_log(7)
    same = [gpsindy.simulate(m, log)[0].x for m in (found.augmented, gm.Simulator(tmp_path / "augmented.xml").model)]
    assert np.abs(same[0] - same[1]).max() < 1e-6


def test_a_rollout_that_diverges_prints_nothing_and_leaves_no_file(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(gpsindy.NumericalError, match="diverged at t = 0.02 s"):
        gpsindy.simulate(gm.Simulator(HINGE).model, real_log(4), initial={"hinge": 0.0, "hinge_vel": 1e12})
    assert tuple(capfd.readouterr()) == ("", "")
    assert not list(tmp_path.iterdir())


def test_velocities_may_be_missing():
    logs = [real_log(seed, dof_frictionloss=0.15) for seed in range(3)]
    for log in logs:
        del log["hinge_vel"]
    found = gpsindy.diagnose(
        gm.Simulator(HINGE), logs, effects=["coulomb_friction", "bias"], most_effects=1, hold="zero"
    )
    assert [(cause.effect, cause.place) for cause in found.included] == [("coulomb_friction", "hinge_torque")]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('<joint name="hinge" type="hinge" axis="0 1 0" damping="0.05" armature="0.01"/>', '<joint name="hinge" type="ball"/>',
         "joint 'hinge' is a ball joint"),
        ('<motor name="drive" joint="hinge"/>', '<general name="drive" joint="hinge" dyntype="filter" dynprm="0.1"/>',
         "actuator 'drive' has an activation"),
    ],
)  # fmt: skip
def test_what_has_no_number_in_a_log_is_refused(old, new, words):
    text = HINGE.replace(old, new)
    if "ball" in new:
        text = text[: text.index("<actuator>")] + "</mujoco>"
    with pytest.raises(ValueError, match=words):
        gm.Simulator(text)
