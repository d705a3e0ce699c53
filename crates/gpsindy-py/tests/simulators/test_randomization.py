"""Ranges for training: they hold the truth, are narrower than a prior, and import without and with the packages."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
import types

import numpy as np
import pytest

import gpsindy
from gpsindy.following import randomizing
from hinge import HINGE, real_log

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")


def diagnosis(first, effects=("coulomb_friction", "viscous_friction", "input_delay"), **fields):
    logs = [real_log(first + seed, **fields) for seed in range(3)]
    return gpsindy.diagnose(gm.Simulator(HINGE), logs, effects=effects, most_effects=1, hold="zero")


@pytest.fixture(scope="module")
def friction():
    effects = ["coulomb_friction", "viscous_friction", "linear_stiffness"]
    return diagnosis(0, effects, dof_frictionloss=0.15).randomization(prior={"link.mass": (0.4, 0.7)}, share=0.2)


def test_what_the_logs_tell_is_narrow_and_what_they_do_not_keeps_its_prior(friction):
    stated = friction["hinge.frictionloss"]
    assert stated.identified and stated.low < 0.15 < stated.high and stated.high - stated.low < 0.05
    mass = friction["link.mass"]
    assert (mass.low, mass.high, mass.identified) == (0.4, 0.7, False)
    armature = friction["hinge.armature"]
    assert not armature.identified and np.isclose(armature.low, 0.008) and np.isclose(armature.high, 0.012)
    text = friction.to_python()
    assert "The logs do not identify".lower() in text.lower()


def test_true_values_lie_in_their_ranges():
    # Of 6 ranges with 95 %, five or more hold the truth but once in 30.
    inside = 0
    for draw in range(6):
        true = 0.08 + 0.03 * draw
        found = diagnosis(10 * draw + 20, dof_frictionloss=true).randomization()["hinge.frictionloss"]
        inside += found.identified and found.low <= true <= found.high
        # A third of a prior that is as wide as the value itself.
        assert found.high - found.low < true / 3
    assert inside >= 5


def test_a_delay_is_told_in_whole_physics_steps():
    found = diagnosis(50, late=7).randomization()
    (delay,) = found.delays
    low, high = found.steps(delay)
    assert low <= 7 <= high and high - low <= 3
    assert f"'drive': ({low}, {high})" in found.to_python()


def test_a_number_that_is_0_ranges_as_far_as_the_logs_allow(friction):
    spring = friction["hinge.stiffness"]
    assert spring.bounded and spring.low == 0.0 < spring.high < 0.01
    made = {}
    exec(friction.to_python(), made)
    assert made["BOUNDED"].keys() == {"hinge.stiffness"} and made["IDENTIFIED"].keys() == {"hinge.frictionloss"}
    # Where they say nothing it has no range, and a word for it.
    found = diagnosis(0, ["coulomb_friction"], dof_frictionloss=0.15).randomization()
    assert "hinge.stiffness" not in {one.name for one in found.ranges}
    assert any("hinge.stiffness is 0" in note for note in found.notes)


@pytest.mark.parametrize(
    ("value", "given", "excluded", "expected"),
    [
        (5.0, None, None, (3.5, 6.5, False)),
        (5.0, None, 0.1, (4.9, 5.1, True)),
        (5.0, None, 9.0, (3.5, 6.5, False)),
        (5.0, (4.0, 9.0), 2.0, (4.0, 7.0, True)),
        # All of a user's own range is excluded: it stays.
        (5.0, (8.0, 9.0), 2.0, (8.0, 9.0, False)),
        (0.0, None, 0.2, (0.0, 0.2, True)),
        (0.0, (0.0, 1.0), None, (0.0, 1.0, False)),
        (0.1, None, 0.01, (0.09, 0.11, True)),
    ],
)
def test_a_prior_range_ends_where_the_logs_exclude_an_error(value, given, excluded, expected):
    one = randomizing._untold("a.damping", gpsindy.Parameter("a.damping", value, "", None), given, 0.3, excluded)
    assert np.allclose((one.low, one.high), expected[:2]) and one.bounded == expected[2]


def test_what_is_a_number_of_the_simulator_is_not_told_as_something_else(friction):
    assert not any("coulomb_friction" in note for note in friction.notes)
    assert "a range of a simulator" not in friction.to_python()


GEARED = """
<mujoco>
  <worldbody>
    <body name="link">
      <joint name="elbow" type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.5"/>
      <body pos="0 0 -0.5">
        <joint name="wrist.pitch" type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="elbow" kp="5" kv="0.5" gear="2"/>
    <motor name="pull" jointinparent="wrist.pitch"/>
  </actuator>
</mujoco>
"""


def test_every_actuator_knows_the_joint_it_drives():
    found = gm.Simulator(GEARED)
    assert found._drives == {"servo": "elbow", "pull": "wrist.pitch"}
    assert found._gears == {"servo": 2.0, "pull": 1.0}


def span(low, high, name="", nominal=1.0, **kind):
    return randomizing.Range(name, low, high, "", nominal, kind.get("identified", True), kind.get("bounded", False))


@pytest.fixture
def drawn():
    """The file of a machine of which everything is stated, as its names."""
    ranges = [
        span(0.1, 0.2, "elbow.frictionloss"),
        span(0.4, 0.6, "elbow.damping"),
        span(0.01, 0.02, "elbow.armature"),
        span(1.0, 2.0, "elbow.stiffness", identified=False),
        span(4.0, 6.0, "servo.kp", 5.0),
        span(0.4, 0.6, "servo.kv", 0.5, identified=False, bounded=True),
        span(0.4, 0.7, "link.mass", 0.5),
    ]
    found = randomizing.Randomization(
        tuple(ranges), (span(0.007, 0.009, "servo"),), (span(-0.3, 0.3, "elbow"),), (), 0.002, {"servo": "elbow"}, {"servo": 2.0}
    )
    made = {}
    exec(found.to_python(), made)
    return made


class Settings:
    """A configuration that takes the fields of its package's and no other."""

    def __init__(self, *values, **named):
        for name, value in zip(self.fields, values):
            setattr(self, name, value)
        for name, value in named.items():
            assert name in self.fields, f"{type(self).__name__} has no {name}"
            setattr(self, name, value)


def stand_in(monkeypatch, name, **content):
    module = types.ModuleType(name)
    for key, value in content.items():
        setattr(module, key, value)
    monkeypatch.setitem(sys.modules, name, module)
    return module


def bound(event):
    """What the event's function gets, by its own argument names; a wrong or missing one is an error."""
    return inspect.signature(event.func).bind("env", None, **event.params).arguments


@pytest.fixture
def mjlab(monkeypatch):
    """Signatures of mjlab 1.6, where it can't be installed beside MuJoCo 4."""

    class EventTermCfg(Settings):
        fields = ("func", "params", "mode", "interval_range_s", "is_global_time", "min_step_count_between_reset")

    class SceneEntityCfg(Settings):
        fields = ("name", "joint_names", "body_names", "actuator_names")

    def number(env, env_ids, ranges, asset_cfg=None, distribution="uniform", operation="abs", axes=None, shared_random=False): ...

    def pd_gains(env, env_ids, kp_range, kd_range, asset_cfg=None, distribution="uniform", operation="scale"): ...

    def pseudo_inertia(env, env_ids, alpha_range=(0.0, 0.0), d_range=None, t_range=None, distribution="uniform", asset_cfg=None): ...

    joints = {name: number for name in ("joint_friction", "joint_damping", "joint_armature", "joint_stiffness")}
    dr = stand_in(monkeypatch, "mjlab.envs.mdp.dr", pd_gains=pd_gains, pseudo_inertia=pseudo_inertia, **joints)
    for name in ("mjlab", "mjlab.envs", "mjlab.managers"):
        stand_in(monkeypatch, name)
    stand_in(monkeypatch, "mjlab.envs.mdp", dr=dr)
    stand_in(monkeypatch, "mjlab.managers.event_manager", EventTermCfg=EventTermCfg)
    stand_in(monkeypatch, "mjlab.managers.scene_entity_config", SceneEntityCfg=SceneEntityCfg)


def test_events_of_mjlab_set_every_field_once_at_its_place(drawn, mjlab):
    events = drawn["mjlab_events"]("arm")
    assert events.keys() == {
        *(f"elbow.{name}" for name in ("frictionloss", "damping", "armature", "stiffness", "force")), "servo.gains", "link.mass"
    }  # fmt: skip
    given = {name: bound(event) for name, event in events.items()}
    for name in ("frictionloss", "damping", "armature", "stiffness"):
        one = given[f"elbow.{name}"]
        assert one["ranges"] == drawn["ranges"]()[f"elbow.{name}"] and one["operation"] == "abs"
        assert (one["asset_cfg"].name, one["asset_cfg"].joint_names) == ("arm", ("elbow",))
    # As shares of the nominal gains.
    assert np.allclose([given["servo.gains"][name] for name in ("kp_range", "kd_range")], [[0.8, 1.2], [0.8, 1.2]])
    assert given["servo.gains"]["asset_cfg"].actuator_names == ["servo"]
    # Mass goes with exp(2 alpha).
    assert np.allclose(0.5 * np.exp(2 * np.array(given["link.mass"]["alpha_range"])), [0.4, 0.7])
    force = events["elbow.force"]
    assert force.mode == "interval" and 0.0 < force.interval_range_s[0] < force.interval_range_s[1]
    assert given["elbow.force"]["span"] == (-0.3, 0.3)
    # 7 to 9 ms in steps of 2 ms.
    group = types.SimpleNamespace(target_names_expr=(".*bow",))
    (late,) = drawn["mjlab_delays"]([group])
    assert (late.delay_min_lag, late.delay_max_lag) == (3, 5)


@pytest.fixture
def isaaclab(monkeypatch):
    """Signatures of Isaac Lab 2.3, which needs a GPU to be imported."""

    class EventTermCfg(Settings):
        fields = ("func", "params", "mode", "interval_range_s", "is_global_time", "min_step_count_between_reset")

    class SceneEntityCfg(Settings):
        fields = ("name", "joint_names", "body_names")

    def randomize_joint_parameters(
        env, env_ids, asset_cfg, friction_distribution_params=None, armature_distribution_params=None, operation="abs"
    ): ...

    def randomize_actuator_gains(
        env, env_ids, asset_cfg, stiffness_distribution_params=None, damping_distribution_params=None, operation="abs"
    ): ...

    def randomize_rigid_body_mass(env, env_ids, asset_cfg, mass_distribution_params, operation, recompute_inertia=True): ...

    for name in ("isaaclab", "isaaclab.envs"):
        stand_in(monkeypatch, name)
    own = {one.__name__: one for one in (randomize_joint_parameters, randomize_actuator_gains, randomize_rigid_body_mass)}
    sys.modules["isaaclab.envs"].mdp = stand_in(monkeypatch, "isaaclab.envs.mdp", **own)
    stand_in(monkeypatch, "isaaclab.managers", EventTermCfg=EventTermCfg, SceneEntityCfg=SceneEntityCfg)


def test_events_of_isaac_lab_keep_a_joint_and_its_drive_apart(drawn, isaaclab):
    events = drawn["isaaclab_events"]("arm")
    # Its joints have no passive spring.
    assert events.keys() == {"elbow.friction", "elbow.armature", "servo.gains", "link.mass", "elbow.force"}
    given = {name: bound(event) for name, event in events.items()}
    assert (given["elbow.friction"]["dry"], given["elbow.friction"]["viscous"]) == ((0.1, 0.2), (0.4, 0.6))
    # The gain of a servo is that of its joint, over the square of its gear.
    gains = given["servo.gains"]
    assert gains["asset_cfg"].joint_names == ["elbow"] and gains["operation"] == "abs"
    assert np.allclose(gains["stiffness_distribution_params"], (16.0, 24.0))
    assert np.allclose(gains["damping_distribution_params"], (1.6, 2.4))
    assert given["link.mass"]["mass_distribution_params"] == (0.4, 0.7)
    assert given["link.mass"]["asset_cfg"].body_names == ["link"]
    late = types.SimpleNamespace(joint_names_expr=["el.*"], min_delay=0, max_delay=0)
    drawn["isaaclab_delays"]({"arm": late})
    assert (late.min_delay, late.max_delay) == (3, 5)
    with pytest.raises(ValueError, match="make it a DelayedPDActuatorCfg"):
        drawn["isaaclab_delays"]({"arm": types.SimpleNamespace(joint_names_expr=["el.*"])})


def test_the_gains_of_a_driver_are_those_of_its_drive(mjlab, isaaclab):
    ranges = (span(16.0, 24.0, "knee.kp", 20.0), span(0.4, 0.6, "knee.kd", 0.5))
    made = {}
    exec(randomizing.Randomization(ranges, (), (), (), 0.002, {"knee": "knee_joint"}, {"knee": 2.0}).to_python(), made)
    scaled = bound(made["mjlab_events"]()["knee.gains"])
    assert np.allclose([scaled["kp_range"], scaled["kd_range"]], [[0.8, 1.2], [0.8, 1.2]])
    # A driver reads the joint, so its torque alone goes through the gear.
    gains = bound(made["isaaclab_events"]()["knee.gains"])
    assert np.allclose(gains["stiffness_distribution_params"], (32.0, 48.0))
    assert np.allclose(gains["damping_distribution_params"], (0.8, 1.2))


def test_joints_of_one_group_need_one_delay(drawn):
    drawn["DRIVES"]["other"] = "wrist"
    with pytest.raises(ValueError, match="elbow, wrist are one group"):
        drawn["mjlab_delays"]([types.SimpleNamespace(target_names_expr=(".*",))])


class Numbers(np.ndarray):
    """As much of a tensor as the functions of the file use."""

    def long(self):
        return self.astype(int)

    def uniform_(self, low, high):
        self[...] = np.random.default_rng(0).uniform(low, high, self.shape)
        return self


@pytest.fixture
def torch(monkeypatch):
    stand_in(
        monkeypatch,
        "torch",
        empty=lambda shape, device: np.empty(shape).view(Numbers),
        arange=lambda count, device: np.arange(count).view(Numbers),
    )


def test_forces_reach_the_joint_alone(drawn, torch):
    applied = np.zeros((3, 5)).view(Numbers)
    robot = types.SimpleNamespace(indexing=types.SimpleNamespace(joint_v_adr=np.array([2, 4]).view(Numbers)), num_joints=2)
    env = types.SimpleNamespace(scene={"arm": robot}, num_envs=3, device="cpu", sim=types.SimpleNamespace(data=types.SimpleNamespace(qfrc_applied=applied)))
    drawn["_mjlab_force"](env, None, (-0.3, 0.3), types.SimpleNamespace(name="arm", joint_ids=[1]))
    assert (applied[:, 4] != 0.0).all() and np.abs(applied).max() <= 0.3 and not applied[:, :4].any()


def test_friction_of_isaac_lab_is_dry_and_viscous_by_its_own_numbers(drawn, torch):
    written = {}

    class Robot:
        device, num_joints = "cpu", 2

        def write_joint_friction_coefficient_to_sim(
            self, joint_friction_coeff, joint_dynamic_friction_coeff=None, joint_viscous_friction_coeff=None, joint_ids=None, env_ids=None
        ):
            assert joint_viscous_friction_coeff is None
            written["dry"] = (joint_friction_coeff, joint_dynamic_friction_coeff, joint_ids)

        def write_joint_viscous_friction_coefficient_to_sim(self, joint_viscous_friction_coeff, joint_ids=None, env_ids=None):
            written["viscous"] = (joint_viscous_friction_coeff, joint_ids)

    class Scene(dict):
        num_envs = 4

    env = types.SimpleNamespace(scene=Scene(arm=Robot()))
    place = types.SimpleNamespace(name="arm", joint_ids=[1])
    drawn["_isaaclab_friction"](env, None, place, (0.1, 0.2), (0.4, 0.6))
    dry, dynamic, joints = written["dry"]
    assert dry is dynamic and joints == [1] and dry.shape == (4, 1) and (0.1 <= dry).all() and (dry <= 0.2).all()
    viscous, _ = written["viscous"]
    assert (0.4 <= viscous).all() and (viscous <= 0.6).all()


#: Python of an environment with mjlab, which needs a MuJoCo before 4.
MJLAB = os.environ.get("GPSINDY_MJLAB_PYTHON")


@pytest.mark.skipif(not MJLAB, reason="GPSINDY_MJLAB_PYTHON names no Python that has mjlab")
def test_the_real_mjlab_takes_the_events(friction, tmp_path):
    friction.save(tmp_path / "randomization.py")
    check = """
import inspect, randomization
events = randomization.mjlab_events("arm")
assert "hinge.frictionloss" in events and "link.mass" in events
for event in events.values():
    inspect.signature(event.func).bind(None, None, **event.params)
"""
    done = subprocess.run([MJLAB, "-c", check], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
