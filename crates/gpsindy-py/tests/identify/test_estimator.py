"""The estimator finds known equations and keeps the promises of scikit-learn."""

from __future__ import annotations

import copy
import pathlib
import pickle

import numpy as np
import pytest

import gpsindy

DATA = pathlib.Path(__file__).parents[4] / "data"


def test_the_equations_come_back(fitted):
    assert fitted.equations(2)[0] == "v"
    terms = fitted.get_feature_names()
    row = dict(zip(terms, fitted.coef_[1]))
    error = dict(zip(terms, fitted.standard_errors_[1]))
    assert {name for name, value in row.items() if value != 0} == {"x", "u"}
    # Four standard errors are right in all but 6 of 100,000 cases.
    assert abs(row["x"] + 4.0) < 4 * error["x"]
    assert abs(row["u"] - 1.0) < 4 * error["u"]


def test_lotka_volterra_with_given_derivatives_has_the_true_terms_and_no_others():
    data = gpsindy.read_csv(DATA / "lotka_volterra.csv")
    found = gpsindy.GPSINDy(degree=3).fit(data, x_dot={"x1": "dx1", "x2": "dx2"})
    terms = found.get_feature_names()
    support = [{terms[j] for j in np.flatnonzero(row)} for row in found.coef_]
    assert support == [{"x1", "x1*x2"}, {"x2", "x1*x2"}]
    truth = {("x1", 0): 1.1, ("x1*x2", 0): -0.4, ("x2", 1): -1.0, ("x1*x2", 1): 0.4}
    for (term, state), value in truth.items():
        assert found.coef_[state, terms.index(term)] == pytest.approx(value, rel=0.02)


def test_the_paper_s_way_finds_the_equations_too(runs):
    t, x, u = runs[0]
    found = gpsindy.GPSINDy.paper(degree=1, kernel="se").fit(x, t, u=u)
    assert (found.regressor, found.refine) == ("lasso", False)
    # A derivative from 120 samples is known within a few percent.
    assert found.coef_[0, found.get_feature_names().index("x1")] == pytest.approx(1.0, rel=0.1)


def test_a_delay_is_estimated(runs):
    t, x, u = runs[0]
    late = np.concatenate([u[4:], np.full(4, u[-1])])
    # The control is logged 4 samples, 0.2 s, before it acts.
    settings = {"degree": 1, "kernel": "se", "fix": ["x0' = x1"], "hold": "zero"}
    found = gpsindy.GPSINDy(**settings, delays={"u0": "auto"}).fit(x, t, u=late)
    delay, error = found.delays_["u0"]
    assert delay == pytest.approx(0.2, abs=0.02)
    assert "delay(u0, " in found.equations()[1]


def test_the_unicycle_with_given_derivatives_has_the_true_terms_and_no_others():
    data = gpsindy.read_csv(DATA / "unicycle.csv")
    rates = {f"x{i}": f"dx{i}" for i in range(1, 5)}
    settings = {"degree": 1, "products": True, "hold": "linear"}
    found = gpsindy.GPSINDy(**settings).fit(data, x_dot=rates, u=["u1", "u2"])
    terms = found.get_feature_names()
    support = [[terms[j] for j in np.flatnonzero(row)] for row in found.coef_]
    assert support == [["x3*cos(x4)"], ["x3*sin(x4)"], ["u1"], ["u2"]]
    assert found.coef_.sum(axis=1) == pytest.approx(np.ones(4), abs=0.02)


def test_fitted_attributes_follow_the_conventions(fitted):
    assert fitted.coef_.shape == (2, len(fitted.get_feature_names()))
    assert (fitted.n_features_in_, fitted.n_control_features_) == (2, 1)
    assert list(fitted.feature_names_in_) == ["x", "v"]
    assert not fitted.coef_.flags.writeable
    assert fitted.coefficients() is fitted.coef_
    assert fitted.complexity == 2
    assert [entry["state"] for entry in fitted.report_] == ["x", "v"]


def test_predictions_simulations_and_scores_agree_with_the_model(fitted, runs):
    t, x, u = runs[0]
    np.testing.assert_allclose(fitted.predict(x, u)[:, 0], x[:, 1])
    assert isinstance(fitted.predict([x, x], [u, u]), list)
    rollout = fitted.simulate(x[0], t, u)
    assert np.abs(rollout - x).max() < 0.1
    assert fitted.score(x, t, u) > 0.99
    assert fitted.score([x], t, [u], kind="rollout") > 0.99
    assert fitted.model_.simulate(x[0], t, u).x == pytest.approx(rollout)


def test_frames_keep_their_names_and_columns_can_be_controls(runs):
    import pandas

    frames = [pandas.DataFrame({"t": t, "pos [m]": x[:, 0], "vel": x[:, 1], "force": u}) for t, x, u in runs]
    found = gpsindy.GPSINDy(degree=1, kernel="se", refine=False).fit(frames, u="force")
    assert list(found.feature_names_in_) == ["pos", "vel"]
    assert list(found.control_names_in_) == ["force"]
    assert found.model_.states[0].unit == "m"
    assert found.score(frames) > 0.9
    assert found.predict(frames[0]).shape == (120, 2)


def test_printing_shows_every_equation(fitted, capsys):
    fitted.print(precision=1)
    assert capsys.readouterr().out.startswith("(x)' = v\n(v)' = ")
    fitted.print(["dx/dt", "dv/dt"])
    assert "dv/dt = " in capsys.readouterr().out


def test_the_same_seed_gives_the_same_bits(runs):
    t, x, u = runs[0]
    settings = {"degree": 1, "kernel": "se", "ensemble": 20, "refine": False, "random_state": 7}
    one, other = (gpsindy.GPSINDy(**settings).fit(x, t, u=u) for _ in range(2))
    np.testing.assert_array_equal(one.coef_, other.coef_)
    np.testing.assert_array_equal(one.inclusion_probabilities_, other.inclusion_probabilities_)
    assert list(one.feature_names_in_) == ["x0", "x1"]
    assert list(one.control_names_in_) == ["u0"]


def test_a_fitted_estimator_pickles_and_copies(fitted, runs):
    t, x, u = runs[0]
    for twin in (pickle.loads(pickle.dumps(fitted)), copy.deepcopy(fitted)):
        np.testing.assert_array_equal(twin.predict(x, u), fitted.predict(x, u))
        assert twin.equations() == fitted.equations()


def test_scikit_learn_clones_it():
    sklearn = pytest.importorskip("sklearn.base")
    original = gpsindy.GPSINDy(degree=2, terms=["x0*abs(x0)"], delays={"u0": "auto"})
    twin = sklearn.clone(original)
    assert twin is not original
    assert twin.get_params() == original.get_params()
    assert repr(twin) == "GPSINDy(degree=2, terms=['x0*abs(x0)'], delays={'u0': 'auto'})"


def test_scikit_learn_knows_whether_it_is_fitted(fitted):
    validation = pytest.importorskip("sklearn.utils.validation")
    validation.check_is_fitted(fitted)
    with pytest.raises(ValueError, match="not fitted"):
        validation.check_is_fitted(gpsindy.GPSINDy())


def test_files_can_be_named_at_once():
    found = gpsindy.GPSINDy(degree=2, refine=False, kernel="se").fit(
        DATA / "lotka_volterra.csv", x_dot={"x1": "dx1", "x2": "dx2"}, feature_names=["prey", "hunter"]
    )
    assert list(found.feature_names_in_) == ["prey", "hunter"]
    assert "prey*hunter" in found.get_feature_names()


def test_settings_are_stored_as_they_are_and_changed_by_name():
    estimator = gpsindy.GPSINDy()
    assert repr(estimator) == "GPSINDy()"
    assert estimator.set_params(degree=5) is estimator
    assert estimator.get_params()["degree"] == 5
    with pytest.raises(ValueError, match="invalid parameter 'order'"):
        estimator.set_params(order=2)


def test_nothing_works_before_fit():
    estimator = gpsindy.GPSINDy()
    for name in ("coefficients", "equations", "get_feature_names", "print"):
        with pytest.raises(gpsindy.NotFittedError, match="call fit first"):
            getattr(estimator, name)()
    with pytest.raises(gpsindy.NotFittedError):
        estimator.predict([[1.0]])
    assert issubclass(gpsindy.NotFittedError, ValueError)
    assert issubclass(gpsindy.NotFittedError, AttributeError)


X = np.random.default_rng(0).standard_normal((30, 2))


@pytest.mark.parametrize(
    ("settings", "arguments", "message"),
    [
        ({}, {"x": X}, "t: hand in the sample times"),
        ({}, {"x": X, "t": 0.1, "u": np.ones(29)}, "u: expected 30 samples as in x, found 29"),
        ({}, {"x": [X, X], "t": 0.1, "u": np.ones(30)}, "u: expected 2 runs as in x, found 1"),
        ({}, {"x": X, "t": 0.1, "x_dot": X[:, :1]}, "x_dot: expected 2 columns as in x, found 1"),
        ({}, {"x": X, "t": 0.1, "feature_names": ["a"]}, "feature_names: expected 2 names of states, found 1"),
        ({}, {"x": X, "t": 0.1, "feature_names": ["a b", "c"]}, "`a b` is not a name"),
        ({}, {"x": X, "t": 0.1, "u": "force"}, "u: columns can be named where x has names"),
        ({}, {"x": {"t": np.arange(30.0), "a": X[:, 0]}, "u": "b"}, "u: no column 'b' in x; found a"),
        ({"degree": -1}, {"x": X, "t": 0.1}, "degree: expected an integer of at least 0"),
        ({"degree": 12}, {"x": X, "t": 0.1}, "`degree` must be from 0 to 9"),
        ({"regressor": "ridge"}, {"x": X, "t": 0.1}, "regressor `ridge` is unknown; known: subset"),
        ({"derivative_method": "spline"}, {"x": X, "t": 0.1}, "derivative_method `spline` is unknown"),
        ({"select": "aic"}, {"x": X, "t": 0.1}, "select `aic` is unknown"),
        ({"kernel": "spline"}, {"x": X, "t": 0.1}, "kernel `spline` is unknown"),
        ({"lam": "some"}, {"x": X, "t": 0.1}, "lam: expected a number or 'auto'"),
        ({"fix": ["x0 = 1"]}, {"x": X, "t": 0.1}, "expected an equation such as"),
        ({"forbid": ["x0"]}, {"x": X, "t": 0.1}, "expected STATE:TERM"),
        ({"terms": ["x0 +"]}, {"x": X, "t": 0.1}, "at character"),
        ({"random_state": -1}, {"x": X, "t": 0.1}, "random_state: expected None or an integer"),
        ({"delays": {"w": 0.1}}, {"x": X, "t": 0.1}, "control `w` is unknown"),
        ({"free": {"h": "a"}}, {"x": X, "t": 0.1}, "free\\['h'\\]: expected numbers, found 'a'"),
        ({"free": {"h": (2, 1)}}, {"x": X, "t": 0.1}, "`h=2.0:1.0`: expected NAME"),
        ({"free": ["x0"]}, {"x": X, "t": 0.1}, "free number `x0`"),
        ({"ranges": {"x0": 1}}, {"x": X, "t": 0.1}, "ranges\\['x0'\\]: expected a lowest and a highest value"),
        ({"ranges": {"w": (None, 1)}}, {"x": X, "t": 0.1}, "state `w` is unknown"),
        ({"fix": ["x0' = -k*x0"]}, {"x": X, "t": 0.1}, "the name `k` is unknown"),
        ({"fix": ["x0' = h*q"], "hidden": ["h", "q"]}, {"x": X, "t": 0.1}, "one equation says nothing of both"),
    ],
)
def test_wrong_input_is_one_line_that_names_the_argument(settings, arguments, message):
    with pytest.raises(ValueError, match=message) as caught:
        gpsindy.GPSINDy(**settings).fit(**arguments)
    assert "\n" not in str(caught.value)


def test_a_velocity_that_is_not_logged_is_taken_from_its_position(runs):
    t, x, u = runs[0]
    estimator = gpsindy.GPSINDy(degree=1, kernel="se", fix=["x' = v"])
    estimator.fit(x[:, :1], t, u=u, feature_names=["x", "u"])
    assert [state.name for state in estimator.model_.states] == ["x", "v"]
    # v' = -4 x + u, the columns being 1, x, v, u; the slope of noisy positions is worse than a logged velocity.
    np.testing.assert_allclose(estimator.coef_[1], [0, -4, 0, 1], atol=0.1)
    assert "`v` is not in the logs" in estimator.notes_[0]
    assert estimator.score(x[:, :1], t, u=u, kind="rollout") > 0.99
    assert estimator.predict(x, u=u).shape == x.shape


def test_the_library_grows_where_polynomials_are_too_few_unless_it_is_given():
    t = np.linspace(0, 8, 200)
    x = np.exp(1 - (1 - np.log(0.1)) * np.exp(-t))
    log = {"x": x[:, None], "t": t, "feature_names": ["x"]}
    found = gpsindy.GPSINDy().fit(**log)
    row = dict(zip(found.get_feature_names(), found.coef_[0]))
    assert {name for name, value in row.items() if value != 0} == {"x", "x*log(x)"}
    assert any("larger library" in note for note in found.notes_)
    for given in (gpsindy.GPSINDy(library="given"), gpsindy.GPSINDy(terms=["sqrt(x)"])):
        assert not any("log" in name for name in given.fit(**log).get_feature_names())
    with pytest.raises(ValueError, match="library"):
        gpsindy.GPSINDy(library="all").fit(**log)


def test_a_free_number_of_a_term_is_estimated():
    t, steps = np.arange(300) * 0.2, 20
    u = 0.6 + 0.5 * np.sin(0.7 * np.arange(300 * steps) * 0.2 / steps)
    x = [0.3]
    for rate in u:
        x.append(x[-1] + 0.2 / steps * (rate - 1.5 * x[-1] / (0.8 + x[-1])))
    x = np.array(x[:-1:steps]) + 0.01 * np.random.default_rng(3).standard_normal(300)
    log = {"x": x[:, None], "t": t, "u": u[::steps], "feature_names": ["x", "u"]}
    found = gpsindy.GPSINDy(degree=1, terms=["x/(h + x)"], free=["h"], hold="linear").fit(**log)
    value, error = found.numbers_["h"]
    assert abs(value - 0.8) < 4 * error and error < 0.1
    assert found.report_[0]["terms"] == ["u", "x/(h + x)"]


def test_a_hidden_level_and_the_end_of_a_sensor():
    t, steps = np.arange(400) * 0.5, 50
    every = np.arange(400 * steps) * 0.5 / steps
    u = 1 + 0.6 * np.sin(0.13 * every) + 0.3 * np.cos(0.41 * every)
    h, y, logged = 0.8, 1.0, []
    for i, pump in enumerate(u):
        if i % steps == 0:
            logged.append(y)
        through = 0.5 * np.sqrt(h)
        h += 0.5 / steps * (0.4 * pump - through)
        y += 0.5 / steps * (through - 0.35 * np.sqrt(y))
    y = np.minimum(np.array(logged) + 0.01 * np.random.default_rng(11).standard_normal(400), 1.5)
    assert np.sum(y == 1.5) > 20
    fix = ["y' = sqrt(max(h, 0)) - b*sqrt(max(y, 0))", "h' = k*u - q*sqrt(max(h, 0))"]
    settings = {"degree": 1, "fix": fix, "hold": "linear", "ranges": {"y": (None, 1.5)}}
    found = gpsindy.GPSINDy(**settings, free={"b": (0.01, 10), "k": 0.2, "q": None})
    found.fit(y[:, None], t, u=u[::steps], feature_names=["y", "u"])
    assert [state.name for state in found.model_.states] == ["y", "h"]
    assert found.model_.states[0].measured == "min(y, 1.5)"
    # With the hidden level in units in which its outflow is its root.
    for name, truth in {"b": 0.35, "k": 0.1, "q": 0.25}.items():
        value, error = found.numbers_[name]
        assert abs(value - truth) < 4 * error and error < 0.1 * truth, (name, value, error)
    assert found.score(y[:, None], t, u=u[::steps], kind="rollout") > 0.9
