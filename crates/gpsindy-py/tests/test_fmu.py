"""FMUs as the nominal model: one of FMI 2 that the test builds itself, where a compiler is at hand."""

from __future__ import annotations

import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest

import gpsindy

pytest.importorskip("fmpy")

#: Source and description of a driven pendulum.
FOLDER = pathlib.Path(__file__).parents[3] / "data" / "pendulum_fmu"


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    folder = tmp_path_factory.mktemp("fmu")
    subprocess.run([sys.executable, FOLDER / "build.py"], cwd=folder, check=True)
    return folder / "pendulum.fmu"


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
    assert "f" in (tmp_path / "augmented.ssv").read_text()
