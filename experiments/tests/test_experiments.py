"""Every experiment at its smallest size, and what they share."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import coefficients  # noqa: E402
import gpsindy  # noqa: E402

PYSINDY = ["sindy-stlsq", "ssr-coefficient", "ssr-residual", "e-sindy", "weak-sindy"]
import jetracer  # noqa: E402
import jobs  # noqa: E402
import library  # noqa: E402
import more_systems  # noqa: E402
import run  # noqa: E402
import tables  # noqa: E402


@pytest.fixture
def logs(tmp_path):
    """A car that follows its own simple equations, 12 s at 50 Hz, standing still for none of them."""
    t = 0.02 * np.arange(600)
    steering, throttle = 0.2 * np.sin(1.1 * t), 0.35 + 0.05 * np.sin(2.3 * t)
    table = np.zeros((600, 7))
    table[:, 0], table[:, 5], table[:, 6] = t, throttle, steering
    x, y, v, heading = 0.0, 0.0, 2.5, 0.0
    for i in range(600):
        table[i, 1:5] = x, y, v, (heading + np.pi) % (2 * np.pi) - np.pi
        # The car obeys six samples late.
        late = max(i - 6, 0)
        x, y = x + 0.02 * v * np.cos(heading), y + 0.02 * v * np.sin(heading)
        v, heading = v + 0.02 * (8 * throttle[late] - v), heading + 0.02 * 4 * v * steering[late]
    folder = tmp_path / "car"
    folder.mkdir()
    head = "t,x [m],y [m],v [m/s],heading [rad],throttle,steering"
    np.savetxt(folder / "rollout_21.csv", table, delimiter=",", header=head, comments="")
    return folder


def experiment(name, out, *arguments, capsys):
    assert run.main([name, "--out", str(out), "--workers", "1", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_the_library_is_that_of_the_package():
    rows = np.random.default_rng(0).standard_normal((40, 3))
    for degree, products in ((1, True), (2, True), (3, False)):
        settings = {"degree": degree, "products": products, "smoother": None, "refine": False}
        found = gpsindy.GPSINDy(derivative_method="difference", regressor="least-squares", lam=0, **settings)
        found.fit(rows[:, :2], 0.1, u=rows[:, 2:], feature_names=["a", "b", "u"])
        assert library.terms(["a", "b", "u"], degree, products) == found.get_feature_names()
    values = {"a": np.array([2.0, 3.0]), "b": np.array([0.0, np.pi / 2])}
    assert library.evaluate("a^2*sin(b)", values) == pytest.approx([0, 9])
    assert library.evaluate("1", values) == pytest.approx([1, 1])


def test_an_interrupted_experiment_goes_on_where_it_was(tmp_path):
    store = tmp_path / "store.jsonl"
    calls = []

    def work(job):
        calls.append(job["k"])
        if job["k"] == 2:
            raise ValueError("odd")
        return {"square": job["k"] ** 2}

    assert [e["square"] for e in jobs.run([{"k": 0}, {"k": 1}], work, store, workers=1)] == [0, 1]
    store.write_text(store.read_text() + '{"job": {"k": 5}, "squ')
    found = jobs.run([{"k": k} for k in range(4)], work, store, workers=1)
    assert calls == [0, 1, 2, 3]
    assert found[3]["square"] == 9 and found[2]["error"] == "ValueError: odd"
    # The line that was cut short spoils no other.
    assert len(jobs.load(store)) == 4


def test_quartiles_count_what_diverged():
    assert tables.quartiles([1, 2, 3, 4, 5]) == (2, 3, 4)
    assert tables.quartiles([1, 2, 3, np.inf, None]) == (2, 3, np.inf)
    assert tables.quartiles([1, np.inf]) == (np.inf, np.inf, np.inf)


def test_table_1_has_the_true_terms(tmp_path, capsys):
    text = experiment("table1", tmp_path, "--methods", "sindy-author", "default", capsys=capsys)
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| x2': x2 ")]
    # 240 samples with noise 0.1 leave about 0.002.
    assert abs(float(rows[0][6]) + 1) < 0.05 and abs(float(rows[0][-2]) + 1) < 0.01


def test_the_coefficient_figure_is_drawn_and_the_default_is_near_the_limit(tmp_path, capsys):
    methods = ["--methods", "sindy-author", "differences", "default"]
    few = ["--seeds", 1, "--sigmas", 0.05, "--systems", "lotka-volterra", "--regimes", "given10"]
    text = experiment("coefficients", tmp_path, *methods, *few, capsys=capsys)
    assert "lotka-volterra, given10" in text and (tmp_path / "coefficients.svg").stat().st_size > 5000
    found = {job["job"]["method"]: job for job in jobs.load(tmp_path / "coefficients.jsonl").values()}
    # The Cramer-Rao bound of these four coefficients is 3e-8.
    assert found["default"]["exact"] and found["default"]["mse"] < 3e-7
    assert "1.00" in coefficients.cell([found["default"]])


def test_the_car_is_prepared_as_by_the_authors(logs):
    prepared = jetracer.prepare(logs, "rollout_21", 5, 0.0, 0)
    raw = np.genfromtxt(logs / "rollout_21.csv", delimiter=",", skip_header=1)
    assert prepared.t[0] > 1 and np.diff(prepared.t) == pytest.approx(0.2)
    row = int(np.flatnonzero(raw[:, 0] == prepared.t[3])[0])
    assert prepared.u[3] == pytest.approx(raw[row - 6, 5:7]) and prepared.x[3, :3] == pytest.approx(raw[row, 1:4])
    noisy = jetracer.prepare(logs, "rollout_21", 5, 0.1, 0)
    assert np.std(noisy.x - prepared.x) == pytest.approx(0.1, rel=0.15)
    test = prepared.clean[prepared.test].copy()
    right = jetracer.errors(prepared, test)
    assert right["author"] == 0 and right["position"] == 0 and not right["diverged"]
    turned = jetracer.errors(prepared, test + [0, 3, 0, 2 * np.pi])
    assert turned["position"] == pytest.approx(3) and turned["rmse"][3] == pytest.approx(0, abs=1e-12)
    assert jetracer.errors(prepared, test * np.nan) == {**right, "author": np.inf, "diverged": True} | {
        key: pytest.approx(np.nan, nan_ok=True) for key in ("position",)
    } | {"rmse": pytest.approx([np.nan] * 4, nan_ok=True)}


def test_table_2_and_the_trajectory_have_their_pictures(logs, tmp_path, capsys):
    methods = ["--methods", "hold", "mean", "sindy-author", "polynomial-in-control", "default-physics"]
    few = ["--jetracer", logs, "--rates", 5, "--sigmas", 0.01]
    text = experiment("table2", tmp_path, *methods, *few, capsys=capsys)
    assert "15.6 / 24.3 / 29.4" in text and (tmp_path / "table2.svg").stat().st_size > 5000
    found = {job["job"]["method"]: job for job in jobs.load(tmp_path / "table2.jsonl").values()}
    assert not any("error" in job for job in found.values()), found
    # The generated car obeys the physical terms.
    assert found["default-physics"]["position"] < 0.2 * found["hold"]["position"]
    text = experiment("trajectory", tmp_path, "--methods", "hold", "mean", *few, capsys=capsys)
    assert "hold" in text and (tmp_path / "trajectory.svg").stat().st_size > 3000


def test_without_the_logs_of_the_car_there_is_a_clear_message(tmp_path, capsys):
    for name in ("table2", "trajectory"):
        text = experiment(name, tmp_path, "--jetracer", tmp_path / "none", capsys=capsys)
        assert text.startswith(f"{name}: skipped, no rollout_*.csv") and "--jetracer" in text


def test_a_further_system_is_found(tmp_path, capsys):
    text = experiment("systems", tmp_path, "--seeds", 1, "--systems", "van_der_pol", "--methods", "default", capsys=capsys)
    assert "| van_der_pol | default | 1.00 " in text


def test_the_terms_of_the_further_systems_are_their_equations():
    for name, truth in more_systems.SYSTEMS.items():
        t = np.arange(0.0, 20 * truth.period, truth.period)
        u, model = truth.inputs(t), truth.model()
        x = np.array(model.simulate(truth.initial, t, u).x)
        values = dict(zip([*truth.equations, *truth.controls], np.column_stack([x] if u is None else [x, u]).T))
        values |= {"max": np.maximum, "abs": np.abs, "sqrt": np.sqrt, "tanh": np.tanh}
        found = np.zeros_like(x)
        for (state, term), value in truth.terms.items():
            found[:, list(truth.equations).index(state)] += value * library.evaluate(term, values)
        if truth.terms:
            assert found == pytest.approx(model.derivative(x, u), rel=1e-9, abs=1e-9), name


@pytest.mark.skipif(importlib.util.find_spec("pysindy") is None, reason="pysindy is not installed")
def test_the_rows_of_pysindy_run(tmp_path, capsys):
    few = ["--seeds", 1, "--sigmas", 0.05, "--systems", "lotka-volterra", "--regimes", "given10"]
    experiment("coefficients", tmp_path, "--methods", *PYSINDY, *few, capsys=capsys)
    found = jobs.load(tmp_path / "coefficients.jsonl").values()
    assert len(found) == 5 and not any("error" in job for job in found), found
