"""FMUs as the nominal model: a pendulum of FMI 2 and of FMI 3 that the test builds itself, where a compiler is at hand."""

from __future__ import annotations

import math
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
    together._copies.cost = 1.0
    assert np.array_equal(alone._step(*rows), together._step(*rows))
    assert len(together._workers._processes) == 2


def test_what_a_copy_raises_in_another_process_is_raised_here(coarse):
    from gpsindy import fmu

    simulator = fmu.Simulator(coarse, kind="co-simulation", processes=2)
    simulator._copies.cost = 1.0
    rows = (np.ones((40, 2)), np.ones((40, 1, 2)), np.zeros((40, 1, 0)), np.tile([0.8, 0.2], (40, 1)))
    with pytest.raises(ValueError, match="its own steps are longer"):
        simulator._step(*rows, 0.005)
    # And the processes go on.
    assert simulator._step(*rows, 0.01).shape == (40, 1, 2)


def rows(count: int, samples: int):
    """States, commands, forces and parameters of copies of the pendulum, five of them different."""
    rng = np.random.default_rng(count)
    parameters = rng.uniform(0.5, 1.0, (5, 2))[np.arange(count) % 5]
    return rng.normal(size=(count, 2)), rng.normal(size=(count, samples, 1)), rng.normal(size=(count, samples, 1)), parameters


def test_steps_of_model_exchange_are_those_of_runge_kutta(pendulum):
    from gpsindy import fmu

    x, u, force, parameters = rows(40, 3)
    lengths = np.linspace(0.01, 0.05, 40)

    def rate(th, w, push, m, b):
        return np.array([w, (push - b * w) / m - 9.81 * math.sin(th)])

    expected = np.empty((40, 3, 2))
    for i, dt in enumerate(lengths):
        state = x[i]
        for sample in range(3):
            push = u[i, sample, 0] + force[i, sample, 0]
            for _ in range(4):
                k1 = rate(*state, push, *parameters[i])
                k2 = rate(*(state + dt / 2 * k1), push, *parameters[i])
                k3 = rate(*(state + dt / 2 * k2), push, *parameters[i])
                k4 = rate(*(state + dt * k3), push, *parameters[i])
                state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            expected[i, sample] = state
    found = fmu.Simulator(pendulum, kind="model exchange", forces={"f": "w"})._step(x, u, force, parameters, lengths, 4)
    # The same numbers but for the rounding of one sine and of its sums.
    assert np.abs(found - expected).max() < 1e-13


def test_steps_of_co_simulation_are_those_of_the_fmu_itself(pendulum):
    from gpsindy import fmu

    x, u, force, parameters = rows(10, 2)
    expected = np.empty((10, 2, 2))
    for i, (m, b) in enumerate(parameters):
        th, w = x[i]
        for sample in range(2):
            # As pendulum.c says: steps of Euler of 0.1 ms, the angle by the new rate.
            for _ in range(200):
                w += 1e-4 * ((u[i, sample, 0] + force[i, sample, 0] - b * w) / m - 9.81 * math.sin(th))
                th += 1e-4 * w
            expected[i, sample] = th, w
    found = fmu.Simulator(pendulum, kind="co-simulation", forces={"f": "w"})._step(x, u, force, parameters, 0.01, 2)
    assert np.abs(found - expected).max() < 1e-12


def test_bounces_come_when_they_must(tmp_path_factory, version):
    from gpsindy import fmu

    ball = built(tmp_path_factory, version, "WALL=0.2", "GRAVITY=0")
    simulator = fmu.Simulator(ball, kind="model exchange", dt=0.01)
    pushed = np.tile([0.8, 0.0], (1, 300, 1))
    found = simulator._step(np.array([[-0.5, 0.0]]), pushed, np.zeros((1, 300, 0)), np.array([[0.8, 0.0]]), 0.01)[0, :, 0]
    # 1 rad/s^2 towards the wall, half the speed back at each bounce: arcs between two bounces, each as long as its first speed says.
    t = 0.01 * np.arange(1, 301)
    hit, speed = math.sqrt(1.4), math.sqrt(1.4)
    expected = np.where(t < hit, -0.5 + t**2 / 2, 0.0)
    for _ in range(5):
        speed /= 2
        expected = np.where(t >= hit, 0.2 - speed * (t - hit) + (t - hit) ** 2 / 2, expected)
        hit += 2 * speed
    assert hit > 3.0
    # Events are located to a billionth of a step.
    assert np.abs(found - expected).max() < 1e-9


@pytest.mark.parametrize("kind", ["model exchange", "co-simulation"])
@pytest.mark.parametrize(("status", "label"), [(2, "discard"), (3, "error")])
def test_a_function_that_fails_is_an_error_with_its_name(tmp_path_factory, version, kind, status, label):
    from gpsindy import fmu

    simulator = fmu.Simulator(built(tmp_path_factory, version, f"STATUS={status}"), kind=kind)
    derivatives = {"FMI2": "GetDerivatives", "FMI3": "GetContinuousStateDerivatives"}[version]
    function = f"fmi{version[-1]}{derivatives if kind == 'model exchange' else 'DoStep'}"
    with pytest.raises(ValueError, match=rf"^pendulum: {function} failed with status {status} \({label}\)$"):
        simulator.model.simulate([0.3, 0.0], np.arange(0, 1, 0.02), u=np.zeros((50, 2)))
    # A step of the copies themselves says the same, and says it again.
    for _ in range(2):
        with pytest.raises(ValueError, match=function):
            simulator._step(np.zeros((1, 2)), np.zeros((1, 1, 2)), np.zeros((1, 1, 0)), np.ones((1, 2)), 0.01)


def test_a_warning_is_no_error(tmp_path_factory, version):
    from gpsindy import fmu

    x, u, _, parameters = rows(3, 1)
    warned, plain = (fmu.Simulator(built(tmp_path_factory, version, f"STATUS={status}")) for status in (1, 0))
    both = np.concatenate([u, u], axis=2)
    steps = [simulator._step(x, both, np.zeros((3, 1, 0)), parameters, 0.01) for simulator in (warned, plain)]
    assert np.array_equal(*steps)


@pytest.mark.parametrize("status", [0, 3])
def test_more_parameters_than_copies_are_kept_give_the_same_numbers(tmp_path_factory, version, status):
    from gpsindy import fmu

    # Where resets fail, a copy with new parameters is a new instance.
    simulator = fmu.Simulator(built(tmp_path_factory, version, f"RESET={status}"), kind="model exchange", forces={"f": "w"})
    x, u, force, _ = rows(150, 1)
    parameters = np.random.default_rng(0).uniform(0.5, 1.0, (150, 2))
    together = simulator._step(x, u, force, parameters, 0.01)
    for i in (0, 70, 149):
        one = slice(i, i + 1)
        assert np.array_equal(simulator._step(x[one], u[one], force[one], parameters[one], 0.01), together[one])
    assert len(np.unique(together[:, 0, 1])) == 150


def test_rows_that_do_not_belong_together_are_an_error(pendulum):
    from gpsindy import fmu

    x, u, force, parameters = rows(3, 2)
    with pytest.raises(ValueError, match="pendulum: expected .* states, commands, forces, parameters and next states, found"):
        fmu.Simulator(pendulum, forces={"f": "w"})._step(x, u, force, parameters[:2], 0.01)


@pytest.mark.parametrize("processes", [1, 2])
def test_threads_of_python_get_their_own_numbers(pendulum, processes):
    from concurrent.futures import ThreadPoolExecutor

    from gpsindy import fmu

    simulator = fmu.Simulator(pendulum, forces={"f": "w"}, processes=processes)
    all_rows = [rows(200 + i, 5) for i in range(8)]
    alone = [simulator._step(*one, 0.01, 20) for one in all_rows]

    def step(one):
        # Every call as if it were worth the processes.
        simulator._copies.cost = 1.0
        return simulator._step(*one, 0.01, 20)

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(step, all_rows))
    assert all(np.array_equal(*both) for both in zip(alone, together))
