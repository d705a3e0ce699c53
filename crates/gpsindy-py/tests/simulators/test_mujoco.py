"""MuJoCo models as the nominal simulator: effects planted in MuJoCo itself, and the corrected file."""

from __future__ import annotations

import numpy as np
import pytest

import gpsindy
from hinge import HINGE, SERVO, real_log

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")
Corrections = pytest.importorskip("gpsindy.mujoco.corrections").Corrections


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


def test_an_actuator_may_be_called_like_the_torque_of_a_joint():
    named = HINGE.replace('name="drive"', 'name="hinge_torque"')
    assert named != HINGE
    found = gm.Simulator(named).model
    assert [c.name for c in found.controls] == ["hinge_torque"]
    assert [p.name for p in found.ports] == ["hinge_joint_torque"]


@pytest.mark.parametrize(
    ("text", "fields", "effect", "place", "variable"),
    [
        (HINGE, {"dof_frictionloss": 0.15}, "coulomb_friction", "hinge_torque", "hinge_vel"),
        (SERVO, {"actuator_gainprm": [[4.0] + [0.0] * 9], "actuator_biasprm": [[0.0, -4.0, -0.4] + [0.0] * 7]},
         "parameter_error", None, "drive.kp"),
        # A motor that gives less than its servo asks for: no small change of its limit shows.
        (SERVO.replace("<position ", '<position forcerange="-8 8" '), {"actuator_forcerange": [[-2.0, 2.0]]},
         "parameter_error", None, "drive.forcerange"),
        # A base that leans by 3 degrees.
        (HINGE, {"opt.gravity": [0.51, 0.0, -9.79]}, "parameter_error", None, "gravity.x"),
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


def test_the_engine_logs_nothing_of_what_a_search_tries(tmp_path, monkeypatch, capfd):
    # The constraint solver of some trial parameters warns at every step, and no counter of the engine holds that back.
    monkeypatch.chdir(tmp_path)
    gpsindy.simulate(gm.Simulator(HINGE).model, real_log(4))
    log = mujoco.MjLogConfig.get()
    assert not log.logto_console and not log.logto_file
    assert capfd.readouterr() == ("", "") and not list(tmp_path.iterdir())


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
    ],
)  # fmt: skip
def test_what_has_no_number_in_a_log_is_refused(old, new, words):
    text = HINGE.replace(old, new)
    text = text[: text.index("<actuator>")] + "</mujoco>"
    with pytest.raises(ValueError, match=words):
        gm.Simulator(text)


def stepped(text, log, change=lambda model: None, *, late=0, command=None):
    """Positions at the log's samples, by MuJoCo's own steps from rest; the command acts `late` steps later."""
    model = mujoco.MjModel.from_xml_string(text)
    change(model)
    data = mujoco.MjData(model)
    per = round((log["t"][1] - log["t"][0]) / model.opt.timestep)
    found = []
    for i in range(len(log["t"])):
        found.append(np.array(data.qpos))
        for step in range(i * per, (i + 1) * per):
            u = log["drive"][max(0, step - late) // per]
            data.ctrl[0] = u if command is None else command(u, data)
            mujoco.mj_step(model, data)
    return np.array(found)


def rolled(simulator, log, model=None):
    states = (model or simulator.model).states
    return gpsindy.simulate(model or simulator.model, log, initial={state.name: 0.0 for state in states})[0].x


LATE = HINGE.replace("<motor", '<motor delay="0.03" nsample="8"')


@pytest.mark.parametrize(("attributes", "steps"), [('delay="0.03" nsample="8"', 6), ('delay="0.028" nsample="8"', 6), ('delay="0.03" nsample="4"', 4)])
def test_a_late_command_acts_in_whole_steps_and_a_rollout_repeats(attributes, steps):
    found = gm.Simulator(HINGE.replace("<motor", f"<motor {attributes}"))
    log = real_log(3)
    first, again = rolled(found, log), rolled(found, log)
    assert np.array_equal(first, again)
    assert np.abs(first[:, :1] - stepped(HINGE, log, late=steps)).max() < 1e-9
    assert {p.name: p.value for p in found.model.parameters}["drive.delay"] == pytest.approx(0.005 * steps)


def test_a_late_command_that_the_engine_interpolates_is_refused():
    with pytest.raises(ValueError, match='actuator \'drive\' interpolates its late command; write interp="zoh"'):
        gm.Simulator(LATE.replace("nsample", 'interp="linear" nsample'))


@pytest.mark.parametrize("late", [0.0199975, 0.0212, 0.0184, 0.005])
def test_a_delay_in_the_file_is_that_of_the_report_in_every_step(late):
    found = gm.Simulator(HINGE)
    said = Corrections(HINGE, None, found._mj, found.settings, found._ids)
    said.command("drive", "drive", 0, f"delay(drive, {late})")
    text = said.commented("corrected")
    assert said.missing == [] and "buffer holds 0" in text and "not in this file" not in text
    log = real_log(3, seconds=20.0)
    # MuJoCo's own buffer, but for its first commands of 0.
    log["drive"][:40] = 0.0
    steps = round(late / 0.005)
    assert np.abs(stepped(text, log) - stepped(HINGE, log, late=steps)).max() < 1e-9
    # And once more as a simulator.
    assert np.abs(rolled(gm.Simulator(text), log)[:, :1] - stepped(HINGE, log, late=steps)).max() < 1e-9


def test_a_nominal_delay_is_corrected_to_a_longer_a_shorter_and_no_one():
    found = gm.Simulator(LATE)
    log = real_log(5)
    for late, steps in [(0.05, 10), (0.01, 2), (0.0, 0)]:
        model = found.model.with_parameters(**{"drive.delay": late})
        text = found.corrected(model)
        assert np.abs(rolled(found, log, model)[:, :1] - stepped(HINGE, log, late=steps)).max() < 1e-9
        assert np.abs(rolled(gm.Simulator(text), log) - rolled(found, log, model)).max() < 1e-9


RATIO = HINGE.replace('<motor name="drive" joint="hinge"/>', '<position name="drive" joint="hinge" kp="5" dampratio="0.8"/>')
CLASS = RATIO.replace('dampratio="0.8"', "").replace("<worldbody>", '<default><position dampratio="0.8"/></default><worldbody>')
GENERAL = HINGE.replace(
    '<motor name="drive" joint="hinge"/>',
    '<general name="drive" joint="hinge" biastype="affine" gainprm="5" biasprm="0 -5 -0.4"/>',
)
GEOMS = HINGE.replace("<option", '<compiler inertiafromgeom="true"/><option')
IGNORED = GEOMS.replace(
    "<geom", '<inertial pos="0 0 -1" mass="9" diaginertia="1 1 1"/>\n      <geom'
)


@pytest.mark.parametrize("text", [HINGE, SERVO, RATIO, CLASS, GENERAL, GEOMS, IGNORED])
def test_the_corrected_file_rolls_out_as_the_corrected_simulator(text):
    found = gm.Simulator(text)
    log = real_log(5)
    for parameter in found.model.parameters:
        model = found.model.with_parameters(**{parameter.name: 0.8 * parameter.value or 0.03})
        corrected = found.corrected(model)
        assert "not in this file" not in corrected, parameter
        assert np.abs(rolled(found, log) - rolled(found, log, model)).max() > 1e-4, parameter
        assert np.abs(rolled(gm.Simulator(corrected), log) - rolled(found, log, model)).max() < 1e-6, parameter


def test_what_the_file_turns_into_another_number_is_said():
    found = gm.Simulator(HINGE.replace("<option", '<compiler boundmass="0.5"/><option'))
    text = found.corrected(found.model.with_parameters(**{"link.mass": 0.4}))
    assert "not in this file: link.mass is 0.4; from this file MuJoCo makes 0.5" in text


@pytest.mark.parametrize(
    "actuator",
    [
        '<position name="drive" joint="hinge" kp="5" kv="0.4" timeconst="0.08"/>',
        '<intvelocity name="drive" joint="hinge" kp="5" kv="0.4" actrange="-1 1"/>',
        '<general name="drive" joint="hinge" dyntype="filter" dynprm="0.05" gainprm="0.6"/>',
        '<cylinder name="drive" joint="hinge" timeconst="0.1" area="0.8"/>',
        '<muscle name="drive" joint="hinge" range="0.7 1.1" force="3" lengthrange="-1 1"/>',
        '<dcmotor name="drive" joint="hinge" motorconst="0.4" resistance="2" inductance="0.05"/>',
    ],
)
def test_an_activation_is_a_hidden_state(actuator):
    text = HINGE.replace('<motor name="drive" joint="hinge"/>', actuator)
    found = gm.Simulator(text)
    assert [state.name for state in found.model.states] == ["hinge", "hinge_vel", "drive_act"]
    log = real_log(5)
    assert np.abs(rolled(found, log)[:, :1] - stepped(text, log)).max() < 1e-9


def test_a_driver_turns_a_wanted_position_into_torque_at_every_step():
    found = gm.Simulator(HINGE, drivers={"drive": (4.0, 0.3)})
    log = real_log(5)
    wanted = stepped(HINGE, log, command=lambda u, data: 4.0 * (u - data.qpos[0]) - 0.3 * data.qvel[0])
    assert np.abs(rolled(found, log)[:, :1] - wanted).max() < 1e-9
    softer = found.model.with_parameters(**{"drive.kp": 3.0})
    assert "not in this file: drive.kp is 3.0, of the driver" in found.corrected(softer)


def test_a_target_has_the_unit_of_its_joint_and_another_command_none():
    def units(text, **given):
        return [control.unit for control in gm.Simulator(text, **given).model.controls]

    assert units(SERVO) == units(HINGE, drivers={"drive": (4.0, 0.3)}) == ["rad"]
    assert units(SERVO.replace('type="hinge"', 'type="slide"')) == ["m"]
    assert units(HINGE) == units(SERVO.replace('kp="5"', 'kp="5" gear="50"')) == [""]


@pytest.mark.parametrize("drivers", [None, {"drive": (4.0, 0.2)}])
def test_many_samples_and_steps_of_each_row_are_those_of_single_calls(drivers):
    simulator = gm.Simulator(HINGE, drivers=drivers)
    random, period = np.random.default_rng(1), 0.002
    x, u = random.standard_normal((3, 2)), random.standard_normal((3, 4, 1))
    force = 0.1 * random.standard_normal((3, 4, 1))
    parameters = np.tile([s.value for s in simulator.settings], (3, 1)) * random.uniform(0.9, 1.1, (3, 1))
    state, one_by_one = x, np.empty((3, 4, 2))
    for sample in range(4):
        for _ in range(5):
            state = simulator._copies.step(state, u[:, sample : sample + 1], force[:, sample : sample + 1], parameters, period)[:, 0]
        one_by_one[:, sample] = state
    assert np.array_equal(simulator._copies.step(x, u, force, parameters, period, 5), one_by_one)
    lengths = np.array([0.002, 0.0005, 0.001])
    rows = [slice(i, i + 1) for i in range(3)]
    each = [simulator._copies.step(x[i], u[i, :1], force[i, :1], parameters[i], float(lengths[i.start]))[0] for i in rows]
    assert np.array_equal(simulator._copies.step(x, u[:, :1], force[:, :1], parameters, lengths), each)
    assert np.array_equal(simulator._copies.step(x, u, force, parameters, period, 5), one_by_one)
    # A copy that diverges takes no other with it, and says from when on.
    force[1, 2] = 1e14
    lost = simulator._copies.step(x, u, force, parameters, period, 5)
    assert np.isfinite(lost[1, :2]).all() and not (np.abs(lost[1, 2:, 1]) < 1e9).any()
    assert np.array_equal(lost[[0, 2]], one_by_one[[0, 2]])
    # A command that is no number is none to the engine, in one call as in many.
    force[1, 2], u[1, 2] = 0.0, np.nan
    simulator._copies.step(x, u, force, parameters, period, 5)
    alone = [simulator._copies.step(x, u[:, :2], force[:, :2], parameters, period, 5)[:, 1]]
    for s in (2, 3):
        alone.append(simulator._copies.step(alone[-1], u[:, s : s + 1], force[:, s : s + 1], parameters, period, 5)[:, 0])
    assert np.array_equal(simulator._copies.step(x, u, force, parameters, period, 5)[:, 1:], np.stack(alone, axis=1), equal_nan=True)


def test_a_row_does_not_depend_on_the_others_nor_on_what_was_stepped_before():
    # More sets of parameters than simulations are kept; masses and armatures move constants of the model.
    arm = gm.Simulator(HINGE.replace("</worldbody>", '<body pos="0 0 1"><joint name="b"/><geom size="0.1" mass="1"/></body></worldbody>'))
    random = np.random.default_rng(2)
    x, u, force = (random.standard_normal(shape) for shape in [(300, 4), (300, 20, 1), (300, 20, 2)])
    parameters = np.array([s.value for s in arm.settings]) * random.uniform(0.8, 1.2, (300, len(arm.settings)))
    together = arm._copies.step(x, u, force, parameters, 0.002, 2)
    assert np.isfinite(together).all()
    order = random.permutation(300)
    shuffled = arm._copies.step(x[order], u[order], force[order], parameters[order], 0.002, 2)
    assert np.array_equal(shuffled, together[order])
    alone = [gm.Simulator(arm._text)._copies.step(x[i : i + 1], u[i : i + 1], force[i : i + 1], parameters[i : i + 1], 0.002, 2)[0] for i in (0, 299)]
    assert np.array_equal(alone, together[[0, 299]])


def test_what_the_engine_would_call_in_python_is_refused():
    mujoco.set_mjcb_control(lambda model, data: None)
    try:
        with pytest.raises(ValueError, match="mjcb_control is a Python function"):
            gm.Simulator(HINGE)
    finally:
        mujoco.set_mjcb_control(None)


def test_rows_that_do_not_belong_together_are_refused():
    step = gm.Simulator(HINGE)._copies.step
    with pytest.raises(ValueError, match="expected .* states, commands, forces"):
        step(np.zeros((2, 2)), np.zeros((2, 1, 1)), np.zeros((2, 1, 3)), np.zeros((2, 1)), 0.002)


def test_a_driver_has_a_delay_and_guesses_and_stands_for_all_motors_of_a_pattern():
    found = gm.Simulator(HINGE, drivers={"*": gm.Driver(4.0, 0.3, 0.02, find=("kp", "delay"))})
    log = real_log(5)
    wanted = stepped(HINGE, log, late=4, command=lambda u, data: 4.0 * (u - data.qpos[0]) - 0.3 * data.qvel[0])
    assert np.abs(rolled(found, log)[:, :1] - wanted).max() < 1e-9
    tolerances = {p.name: p.tolerance for p in found.model.parameters if p.name.startswith("drive.")}
    assert tolerances == {"drive.kp": 0.5, "drive.kd": None, "drive.delay": 0.5}
    later = found.model.with_parameters(**{"drive.delay": 0.03})
    text = found.corrected(later)
    assert "not in this file: the wanted position drive, of the driver" in text and "nsample" not in text
    with pytest.raises(ValueError, match="find: expected names among kp, kd and delay"):
        gm.Driver(1.0, 0.1, find=("kv",))
    with pytest.raises(ValueError, match="give the delay to the driver"):
        gm.Simulator(LATE, drivers={"drive": (4.0, 0.3)})


def test_a_guessed_gain_is_found_and_no_cause():
    """Dry friction is planted; the gain of the driver is a guess a fifth too low."""
    truth = gm.Simulator(HINGE.replace('damping="0.05"', 'damping="0.05" frictionloss="0.15"'), drivers={"drive": (5.0, 0.4)})
    logs = []
    for seed in range(3):
        log = real_log(seed)
        x = rolled(truth, log) + np.random.default_rng(seed).standard_normal((len(log["t"]), 2)) * [1e-3, 1e-2]
        logs.append({**log, "hinge": x[:, 0], "hinge_vel": x[:, 1]})
    nominal = gm.Simulator(HINGE, drivers={"drive": gm.Driver(4.0, 0.4, find=("kp",))})
    found = gpsindy.diagnose(nominal, logs, effects=["coulomb_friction", "bias"], most_effects=1, hold="zero")
    assert [cause.effect for cause in found.included] == ["coulomb_friction"], found
    kp = next(p for p in found.parameters if p["name"] == "drive.kp")
    assert kp["nominal"] == 4.0 and abs(kp["value"] - 5.0) < 0.1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"drve": (1.0, 0.1)}, "drivers: the model has no actuator 'drve'; did you mean 'drive'\\? found drive"),
        ({"drive": (1.0, -0.1)}, "kd must be finite and at least 0"),
        ({"drive": 1.0}, r"expected its gains \(kp, kd\) or \(kp, kd, delay\), found 1.0"),
    ],
)
def test_a_driver_without_its_motor_or_gains_is_refused(given, words):
    with pytest.raises(ValueError, match=words):
        gm.Simulator(HINGE, drivers=given)
    with pytest.raises(ValueError, match="a driver's loop goes around a <motor>"):
        gm.Simulator(SERVO, drivers={"drive": (1.0, 0.1)})


@pytest.mark.parametrize("unit", [1e3, 1e9])
def test_time_stamps_that_are_no_seconds_are_refused_at_once(unit):
    found = gm.Simulator(HINGE)
    log = {**real_log(3), "t": real_log(3)["t"] * unit}
    for work in (lambda: gpsindy.diagnose(found, [log, log]), lambda: gpsindy.simulate(found.model, log), lambda: found.model.score([log])):
        with pytest.raises(ValueError, match="steps of the simulator .* time stamps are seconds: divide milliseconds by 1e3"):
            work()
