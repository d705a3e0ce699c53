"""Ranges for training: they hold the truth, are narrower than a prior, and import without and with the packages."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest

import gpsindy
from test_mujoco import HINGE, real_log

mujoco = pytest.importorskip("mujoco")
gm = pytest.importorskip("gpsindy.mujoco")


def diagnosis(first, **fields):
    logs = [real_log(first + seed, **fields) for seed in range(3)]
    effects = ["coulomb_friction", "viscous_friction", "input_delay"]
    return gpsindy.diagnose(gm.Simulator(HINGE), logs, effects=effects, most_effects=1, hold="zero")


@pytest.fixture(scope="module")
def friction():
    return diagnosis(0, dof_frictionloss=0.15).randomization(prior={"link.mass": (0.4, 0.7)}, share=0.2)


def test_what_the_logs_tell_is_narrow_and_what_they_do_not_keeps_its_prior(friction):
    told = friction["hinge.frictionloss"]
    assert told.identified and told.low < 0.15 < told.high and told.high - told.low < 0.05
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


def test_the_file_imports_by_itself_and_makes_events_of_both_packages(friction, monkeypatch):
    made = {}
    exec(friction.to_python(), made)
    assert made["IDENTIFIED"].keys() == {"hinge.frictionloss"} and "link.mass" in made["ranges"]()

    class Recorded:
        def __init__(self, *positional, **named):
            self.positional, self.named = positional, named

    def stand_in(name, **content):
        module = types.ModuleType(name)
        for key, value in content.items():
            setattr(module, key, value)
        monkeypatch.setitem(sys.modules, name, module)
        return module

    # The two packages need a GPU's worth of other ones; what is called of them is recorded.
    functions = {name: name for name in ("joint_friction", "joint_damping", "joint_armature", "joint_stiffness", "pseudo_inertia", "pd_gains")}
    dr = stand_in("mjlab.envs.mdp.dr", **functions)
    for name in ("mjlab", "mjlab.envs", "mjlab.managers"):
        stand_in(name)
    stand_in("mjlab.envs.mdp", dr=dr)
    stand_in("mjlab.managers.event_manager", EventTermCfg=Recorded)
    stand_in("mjlab.managers.scene_entity_config", SceneEntityCfg=Recorded)
    events = made["mjlab_events"]("arm")
    event = events["hinge.frictionloss"].named
    assert event["func"] == "joint_friction" and event["params"]["ranges"] == made["IDENTIFIED"]["hinge.frictionloss"]
    assert event["params"]["asset_cfg"].positional == ("arm",)
    low, high = events["link.mass"].named["params"]["alpha_range"]
    # Mass goes with exp(2 alpha).
    assert np.allclose(0.5 * np.exp(2 * np.array([low, high])), [0.4, 0.7])

    for name in ("isaaclab", "isaaclab.envs"):
        stand_in(name)
    names = ("randomize_joint_parameters", "randomize_actuator_gains", "randomize_rigid_body_mass")
    mdp = stand_in("isaaclab.envs.mdp", **{name: name for name in names})
    sys.modules["isaaclab.envs"].mdp = mdp
    stand_in("isaaclab.managers", EventTermCfg=Recorded, SceneEntityCfg=Recorded)
    event = made["isaaclab_events"]()["hinge.frictionloss"].named
    assert event["func"] == "randomize_joint_parameters"
    assert event["params"]["friction_distribution_params"] == made["IDENTIFIED"]["hinge.frictionloss"]


def test_the_events_are_those_of_the_real_mjlab(friction):
    pytest.importorskip("mjlab")
    made = {}
    exec(friction.to_python(), made)
    events = made["mjlab_events"]()
    assert "hinge.frictionloss" in events
