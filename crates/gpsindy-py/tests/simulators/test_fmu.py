"""FMUs as the nominal model: a pendulum of FMI 2 and of FMI 3 that the test builds itself, where a compiler is at hand."""

from __future__ import annotations

import pathlib
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

import gpsindy

pytest.importorskip("fmpy")

#: Source and description of a driven pendulum.
FOLDER = pathlib.Path(__file__).parents[4] / "data" / "pendulum_fmu"


def built(tmp_path_factory, *variants):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    folder = tmp_path_factory.mktemp("fmu")
    subprocess.run([sys.executable, FOLDER / "build.py", *variants], cwd=folder, check=True)
    return folder / "pendulum.fmu"


@pytest.fixture(scope="module", params=["FMI2", "FMI3"])
def version(request):
    return request.param


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory, version):
    return built(tmp_path_factory, version)


@pytest.fixture(scope="module")
def walled(tmp_path_factory, version):
    return built(tmp_path_factory, version, "WALL=0.2")


@pytest.fixture(scope="module")
def coarse(tmp_path_factory, version):
    return built(tmp_path_factory, version, "INTERNAL=0.01")


EQUATIONS = """
schema = "gpsindy.model/1"
[[state]]
name = "th"
equation = "w"
[[state]]
name = "w"
equation = "(u - b*w)/m - 9.81*sin(th)"
[[control]]
name = "u"
[[parameter]]
name = "m"
value = 0.8
[[parameter]]
name = "b"
value = 0.2
"""


def command(seed: int):
    rng = np.random.default_rng(seed)
    t = np.arange(0, 4, 0.02)
    return t, sum(rng.uniform(1, 3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.3, 0.7, 1.1))


@pytest.mark.parametrize(("kind", "tolerance"), [("model exchange", 1e-6), ("co-simulation", 2e-3)])
def test_a_rollout_is_that_of_the_same_equations(pendulum, kind, tolerance):
    from gpsindy import fmu

    t, u = command(1)
    t, u = t[:60], u[:60]
    found = fmu.Simulator(pendulum, kind=kind, kinematic={"th": "w"}, forces={"f": "w"}).model.simulate([0.3, 0.0], t, u=u[:, None])
    same = gpsindy.Model.from_toml(EQUATIONS).simulate([0.3, 0.0], t, u=u[:, None])
    assert np.abs(found.x - same.x).max() < tolerance


def test_dry_friction_at_a_force_input_is_found_there(pendulum, tmp_path):
    from gpsindy import fmu

    truth = gpsindy.Model.from_toml(EQUATIONS.replace("- b*w", "- b*w - 0.5*tanh(w/0.002)"))
    rng = np.random.default_rng(3)
    logs = []
    for seed in range(2):
        t, u = command(seed)
        x = truth.simulate([0.0, 0.0], t, u=u[:, None]).x
        logs.append({"t": t, "th": x[:, 0] + 1e-3 * rng.standard_normal(len(t)), "u": u})
    simulator = fmu.Simulator(pendulum, kinematic={"th": "w"}, forces={"f": ("w", "th")}, dt=0.02)
    found = gpsindy.diagnose(
        simulator, logs, effects=["coulomb_friction", "bias"], most_effects=1, hold="zero"
    )
    assert [(c.effect, c.place) for c in found.included] == [("coulomb_friction", "f")]
    found.augmented.save(tmp_path / "augmented.ssv")
    text = (tmp_path / "augmented.ssv").read_text()
    size = found.included[0].parameters[0]["value"]
    assert 0.45 < size < 0.55 and "not in this file: f: " in text and "<ssv:Parameter " not in text


def test_changed_parameters_are_a_parameter_set(pendulum):
    from gpsindy import fmu

    simulator = fmu.Simulator(pendulum)
    text = simulator.corrected(simulator.model.with_parameters(b=0.35))
    ssv = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
    (one,) = ElementTree.fromstring(text).iter(f"{ssv}Parameter")
    assert one.get("name") == "b" and one.find(f"{ssv}Real").get("value") == "0.35"


@pytest.mark.parametrize("kind", ["model exchange", "co-simulation"])
def test_events_of_the_states_act(walled, kind):
    from gpsindy import fmu

    t = np.arange(0, 3, 0.01)
    found = fmu.Simulator(walled, kind=kind, dt=0.01).model.simulate([-0.5, 0.0], t, u=np.zeros((len(t), 2))).x
    # The same by fine steps: th' = w, w' = -b w/m - 9.81 sin(th), and half the speed back at the wall.
    th, w, fine = -0.5, 0.0, []
    for i in range(len(t)):
        fine.append(th)
        for _ in range(1000):
            w += 1e-5 * (-0.2 * w / 0.8 - 9.81 * np.sin(th))
            th += 1e-5 * w
            if th >= 0.2 and w > 0.0:
                w *= -0.5
    assert max(fine) < 0.201 and min(fine[100:]) < -0.05
    assert np.abs(found[:, 0] - fine).max() < 2e-3


def test_a_co_simulation_that_made_no_step_is_an_error(coarse):
    from gpsindy import fmu

    t, u = np.arange(0, 1, 0.02), np.ones((50, 1))
    both = np.column_stack([u, 0.0 * u])
    simulator = fmu.Simulator(coarse, kind="co-simulation", dt=0.02)
    same = gpsindy.Model.from_toml(EQUATIONS).simulate([0.3, 0.0], t, u=u)
    assert np.abs(simulator.model.simulate([0.3, 0.0], t, u=both).x - same.x).max() < 2e-3
    for wrong, period in [(0.005, 0.02), (0.02, 0.025)]:
        shorter = fmu.Simulator(coarse, kind="co-simulation", dt=wrong)
        with pytest.raises(ValueError, match="asked for a step of 0.005 s, the FMU went 0 s: its own steps are longer"):
            shorter.model.simulate([0.3, 0.0], np.arange(0, 1, period), u=both[: len(np.arange(0, 1, period))])


@pytest.mark.parametrize("kind", ["model exchange", "co-simulation"])
def test_processes_step_the_same_numbers(pendulum, kind):
    from gpsindy import fmu

    rng = np.random.default_rng(0)
    rows = (rng.normal(size=(401, 2)), rng.normal(size=(401, 3, 1)), rng.normal(size=(401, 3, 1)), rng.uniform(0.5, 1.0, (5, 2))[np.arange(401) % 5], 0.01)
    alone, together = (fmu.Simulator(pendulum, kind=kind, forces={"f": "w"}, processes=count) for count in (1, 3))
    together._cost = 1.0
    assert np.array_equal(alone._step(*rows), together._step(*rows))
    assert len(together._workers._processes) == 2


def test_what_a_copy_raises_in_another_process_is_raised_here(coarse):
    from gpsindy import fmu

    simulator = fmu.Simulator(coarse, kind="co-simulation", processes=2)
    simulator._cost = 1.0
    rows = (np.ones((40, 2)), np.ones((40, 1, 2)), np.zeros((40, 1, 0)), np.tile([0.8, 0.2], (40, 1)))
    with pytest.raises(ValueError, match="its own steps are longer"):
        simulator._step(*rows, 0.005)
    # And the processes go on.
    assert simulator._step(*rows, 0.01).shape == (40, 1, 2)
