"""The diagnosis names a known cause, whoever simulates."""

from __future__ import annotations

import json
import pathlib
import pickle

import numpy as np
import pytest

import gpsindy

DATA = pathlib.Path(__file__).parents[4] / "data"
SUSPECTS = ["bias", "viscous_friction", "coulomb_friction", "quadratic_drag", "input_gain"]


def logs(friction: float, seeds=(1, 2, 3), drag: float = 0.0):
    """A cart: v' = u - 0.5 v - friction tanh(v/0.01) - drag v |v|, noise 0.005."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        t = 0.02 * np.arange(400)
        u = np.repeat(rng.uniform(-2, 2, 20), 20)
        v, x = 0.0, 0.0
        rows = []
        for i in range(400):
            rows.append((x, v))
            for _ in range(40):
                x += 0.0005 * v
                v += 0.0005 * (u[i] - 0.5 * v - friction * np.tanh(v / 0.01) - drag * v * abs(v))
        values = np.array(rows) + 0.005 * rng.standard_normal((400, 2))
        found.append({"t": t, "x": values[:, 0], "v": values[:, 1], "u": u})
    return found


@pytest.fixture(scope="module")
def nominal():
    text = """
schema = "gpsindy.model/1"
name = "cart"
[[state]]
name = "x"
equation = "v"
[[state]]
name = "v"
equation = "u - b*v"
[[control]]
name = "u"
[[parameter]]
name = "b"
value = 0.5
"""
    return gpsindy.Model.from_toml(text)


@pytest.fixture(scope="module")
def found(nominal):
    return gpsindy.diagnose(nominal, logs(0.6), effects=SUSPECTS)


def test_the_friction_is_found_and_closes_the_gap(found):
    assert found.verdict in ("explained", "partly_explained")
    assert found.p_value < 0.05
    assert ("coulomb_friction", "v") in {(cause.effect, cause.state) for cause in found.included}
    assert found.closure["after"] < 0.5 * found.closure["before"]
    assert {"closure", "lack_of_fit", "typicality"} <= {check["id"] for check in found.checks}
    assert all(isinstance(check["passed"], bool) and check["says"] for check in found.checks)


def test_the_augmented_model_simulates_and_scores_better(found, nominal):
    fresh = logs(0.6, seeds=(9,))
    assert found.augmented.score(fresh).rollout.pooled < 0.5 * nominal.score(fresh).rollout.pooled


def test_a_perfect_simulator_has_no_gap(nominal):
    found = gpsindy.diagnose(nominal, logs(0.0), effects=SUSPECTS)
    assert found.verdict == "no_gap"
    assert found.included == ()


def test_the_report_is_written_and_travels(found, tmp_path):
    found.save(tmp_path / "out")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["schema"] == "gpsindy.diagnosis/1"
    assert report == found.to_dict() == json.loads(found.to_json())
    assert "<html" in (tmp_path / "out" / "report.html").read_text()
    assert gpsindy.Model.load(tmp_path / "out" / "augmented.toml") == found.augmented
    twin = pickle.loads(pickle.dumps(found))
    assert twin.causes == found.causes
    assert twin.prediction_set == found.prediction_set
    assert "EXPLAINED" in repr(found)
    assert "figures" not in report
    assert found._repr_html_().startswith("<iframe srcdoc=")
    assert {row["name"] for row in found.parameters} >= {"b"}


def test_a_report_replaces_an_older_one_whole_or_not_at_all(found, tmp_path):
    found.save(tmp_path)
    stale, older = tmp_path / "simulator.toml", {file.name: file.read_text() for file in tmp_path.iterdir()}
    stale.write_text("# Written by gpsindy diagnose: the simulator, identified from its logs.\n")
    (tmp_path / "augmented.toml").unlink()
    (tmp_path / "augmented.toml").mkdir()
    (tmp_path / "report.json").write_text(older["report.json"] + "\n")
    with pytest.raises(OSError, match="augmented.toml"):
        found.save(tmp_path)
    assert (tmp_path / "report.json").read_text() == older["report.json"] + "\n" and stale.exists()
    (tmp_path / "augmented.toml").rmdir()
    found.save(tmp_path)
    # What the older one had and this one lacks is gone.
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == older


def test_a_callable_is_diagnosed_like_its_equations():
    def simulator(t, x, u):
        return [x[1], u[0] - 0.5 * x[1]]

    runs = [{name: values[:150] for name, values in run.items()} for run in logs(0.6)]
    found = gpsindy.diagnose(
        simulator, runs, states=["x", "v"], controls=["u"], effects=["coulomb_friction", "bias"], most_effects=1
    )
    assert found.included[0].effect == "coulomb_friction"
    assert gpsindy.simulate(found.augmented, runs[0])[0].x.shape == (150, 2)


def test_an_error_of_the_simulator_ends_the_diagnosis_unchanged():
    calls = []

    def simulator(t, x, u):
        calls.append(t)
        if len(calls) > 2000:
            raise ZeroDivisionError("the engine stalled")
        return [x[1], u[0]]

    with pytest.raises(ZeroDivisionError, match="the engine stalled"):
        gpsindy.diagnose(simulator, logs(0.6), states=["x", "v"], controls=["u"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"effects": ["magic"]}, "effect `magic` is unknown; known: parameter_error"),
        ({"confidence": 2.0}, "`confidence` must be between 0.5 and 0.999"),
        ({"most_effects": 0}, "`most_effects` must be between 1 and 6"),
        ({"time_limit": -1.0}, "`time_limit` must be above 0 s"),
        ({"hold": "cubic"}, "`hold` must be"),
    ],
)
def test_wrong_settings_are_named(nominal, options, message):
    with pytest.raises(ValueError, match=message):
        gpsindy.diagnose(nominal, logs(0.0, seeds=(1,)), **options)


def test_logs_without_the_control_are_refused(nominal):
    run = logs(0.0, seeds=(1,))[0]
    del run["u"]
    with pytest.raises(ValueError, match="`u`"):
        gpsindy.diagnose(nominal, run)
    with pytest.raises(ValueError, match="states: a callable needs"):
        gpsindy.diagnose(lambda t, x, u: x, run)
    with pytest.raises(ValueError, match="model: expected a Model, a model file"):
        gpsindy.diagnose(None, run)


def test_a_time_limit_ends_the_search_and_progress_is_told_from_the_first_fit_on():
    stages = []

    def simulator(t, x, u):
        return [x[1], u[0]]

    found = gpsindy.diagnose(
        simulator,
        logs(0.6),
        states=["x", "v"],
        controls=["u"],
        effects=["coulomb_friction", "viscous_friction"],
        time_limit=1e-6,
        progress=lambda stage, done, total: stages.append((stage, done, total)),
    )
    assert found.verdict in ("unexplained", "partly_explained")
    assert any(note.startswith("the time limit of") for note in found.notes)
    assert all(0 <= done <= total for _, done, total in stages)


def test_effects_of_the_user_are_suspects_too(nominal):
    own = gpsindy.CustomEffect("drag", "v", "-c*v*abs(v)", {"c": (-5.0, 5.0)})
    found = gpsindy.diagnose(nominal, logs(0.0, drag=0.8), effects=["drag", "bias"], custom=[own])
    assert found.included[0].effect == "drag"
    assert found.included[0].parameters[0]["value"] == pytest.approx(0.8, rel=0.1)


def test_effects_are_read_from_a_file(tmp_path, nominal):
    file = tmp_path / "effects.toml"
    file.write_text(
        "[[effect]]\nid = 'drag'\nstate = 'v'\nform = '-c*v*abs(v)'\n"
        "parameters = [{name = 'c', low = -5.0, high = 5.0, unit = '1/m'}]\n"
    )
    (own,) = gpsindy.read_effects(file)
    assert own == gpsindy.CustomEffect("drag", "v", "-c*v*abs(v)", {"c": (-5.0, 5.0)}, {"c": "1/m"})
    file.write_text("[[effect]]\nid = 'drag'\n")
    with pytest.raises(ValueError, match=r"effects\.toml"):
        gpsindy.read_effects(file)


def test_logs_of_the_simulator_stand_in_for_it():
    simulated = [{name: run[name] for name in ("t", "v", "u")} for run in logs(0.0, seeds=(4, 5))]
    real = [{name: run[name] for name in ("t", "v", "u")} for run in logs(0.0, drag=0.8)]
    twin = gpsindy.GPSINDy(degree=1, kernel="se").fit(simulated, u="u")
    found = gpsindy.diagnose(twin, real, effects=["quadratic_drag", "bias"])
    assert found.included[0].effect == "quadratic_drag"


def test_the_catalogue_has_the_effects_of_the_contract():
    catalogue = {effect.id: effect for effect in gpsindy.effects()}
    assert len(catalogue) >= 25
    assert catalogue["input_delay"].form == "u becomes delay(u, tau)"


def pendulum(t, x, u):
    """Rates of many pendulums at once, as rows."""
    assert t.shape == (len(x),) and x.shape[1:] == (2,) and u.shape == (len(x), 1)
    return np.column_stack([x[:, 1], -6.0 * np.sin(x[:, 0]) - 0.2 * x[:, 1] + u[:, 0]])


def pendulum_log(seed: int, friction: float = 0.4):
    """25 Hz log of that pendulum with dry friction, 40 fine steps between samples, noise 0.003."""
    rng = np.random.default_rng(seed)
    torque = np.repeat(rng.uniform(-3.0, 3.0, 8), 15)
    x, rows = np.array([0.3, 0.0]), []
    for i, u in enumerate(torque):
        rows.append((0.04 * i, *x, u))
        for _ in range(40):
            rate = pendulum(np.zeros(1), x[None], np.array([[u]]))[0]
            x = x + 0.001 * (rate - np.array([0.0, friction * np.tanh(x[1] / 0.01)]))
    t, phi, omega, u = np.array(rows).T
    noise = 0.003 * rng.standard_normal((2, len(t)))
    return {"t": t, "phi": phi + noise[0], "omega": omega + noise[1], "u": u}


CALLABLE = {"states": ["phi", "omega"], "controls": ["u"], "kinematic": {"phi": "omega"}, "most_effects": 1, "hold": "zero"}
FEW = ["coulomb_friction", "viscous_friction", "bias"]


def test_a_callable_that_takes_rows_gives_the_same_diagnosis_with_fewer_calls():
    logs = [pendulum_log(seed) for seed in range(2)]
    few = ["coulomb_friction", "bias"]
    calls = {"rows": 0, "one": 0}

    def rows(t, x, u):
        calls["rows"] += 1
        return pendulum(t, x, u)

    def one(t, x, u):
        calls["one"] += 1
        return pendulum(np.array([t]), x[None], u[None])[0]

    many = gpsindy.diagnose(rows, logs, vectorized=True, effects=few, **CALLABLE)
    single = gpsindy.diagnose(one, logs, effects=few, **CALLABLE)
    assert many.to_json() == single.to_json()
    assert many.included[0].effect == "coulomb_friction"
    assert calls["rows"] < 0.5 * calls["one"]


@pytest.mark.parametrize(
    ("answer", "found"),
    [
        (lambda t, x, u: np.zeros((len(x), 3)), r"found shape \(\d+, 3\) of float64"),
        (lambda t, x, u: np.zeros(2), r"found shape \(2,\) of float64"),
        (lambda t, x, u: np.zeros((len(x), 2), dtype=np.float32), r"found shape \(\d+, 2\) of float32"),
        (lambda t, x, u: None, "found <class 'NoneType'>"),
    ],
)
def test_rows_of_the_wrong_shape_are_one_error(answer, found):
    with pytest.raises(ValueError, match=r"vectorized=True f\(t, x, u\) must return rates of shape \(n, 2\).*" + found):
        gpsindy.diagnose(answer, [pendulum_log(0)], vectorized=True, effects=FEW, **CALLABLE)


def test_complex_rates_and_a_negative_seed_are_refused():
    logs = [pendulum_log(0)]
    with pytest.raises(ValueError, match=r"found shape \(2,\) of complex128"):
        gpsindy.diagnose(lambda t, x, u: np.array([1j, 0.0]), logs, effects=FEW, **CALLABLE)
    with pytest.raises(ValueError, match="seed: expected an integer of at least 0, found -1"):
        gpsindy.diagnose("model.toml", logs, power=True, seed=-1)


def test_what_a_callable_of_rows_raises_comes_through():
    class Own(Exception):
        pass

    error = Own("the simulator's licence has run out")

    def fails(t, x, u):
        raise error

    with pytest.raises(Own) as caught:
        gpsindy.diagnose(fails, [pendulum_log(0)], vectorized=True, effects=FEW, **CALLABLE)
    assert caught.value is error


def test_a_power_study_says_what_the_logs_could_reveal():
    model = gpsindy.Model.from_toml(
        'schema = "gpsindy.model/1"\nname = "pendulum"\n'
        '[[state]]\nname = "phi"\nequation = "omega"\n'
        '[[state]]\nname = "omega"\nequation = "-6*sin(phi) - 0.2*omega + u"\n'
        '[[control]]\nname = "u"\n'
    )
    logs = [pendulum_log(seed, friction=0.0) for seed in range(3)]
    found = gpsindy.diagnose(model, logs, effects=["coulomb_friction", "bias"], power=True, seed=3)
    assert found.power is not None and found.power["seed"] == 3
    friction = next(e for e in found.power["effects"] if e["effect"] == "coulomb_friction")
    assert friction["named_from"] > 0
    assert "Would be named" in found.summary()
    assert gpsindy.diagnose(model, logs, effects=["bias"]).power is None


def test_a_simulator_of_which_there_are_only_logs():
    simulated = [pendulum_log(seed, friction=0.0) for seed in range(6)]
    real = [pendulum_log(seed) for seed in range(4)]
    names = {"states": ["phi", "omega"], "controls": ["u"]}
    settings = gpsindy.GPSINDy(degree=1, trig=True, fix=["phi' = omega"])
    found = gpsindy.diagnose(settings, real, simulated=simulated, effects=FEW, hold="zero", **names)
    assert found.included[0].effect == "coulomb_friction"
    assert "identified from its logs" in found.notes[0]
    with pytest.raises(ValueError, match="hand in None or a GPSINDy"):
        gpsindy.diagnose("model.toml", real, simulated=simulated, **names)
    with pytest.raises(ValueError, match="states: simulated logs need the names"):
        gpsindy.diagnose(None, real, simulated=simulated)
    with pytest.raises(ValueError, match="model: expected a Model"):
        gpsindy.diagnose(None, real)
