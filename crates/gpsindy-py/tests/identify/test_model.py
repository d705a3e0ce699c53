"""Models from files and around Python code simulate, score and travel."""

from __future__ import annotations

import pickle
import signal
import threading
import time

import numpy as np
import pytest

import gpsindy


def test_a_model_reads_back_what_it_writes(cart, tmp_path):
    for name in ("cart.toml", "cart.json"):
        cart.save(tmp_path / name)
        assert gpsindy.Model.load(tmp_path / name) == cart
    assert pickle.loads(pickle.dumps(cart)) == cart
    assert [state.equation for state in cart.states] == ["v", "-k*x + u"]
    assert cart.with_parameters(k=9.0).parameters[0].value == 9.0


def test_a_rollout_is_the_solution(cart):
    t = np.linspace(0, 3, 31)
    rollout = cart.simulate({"x": 1.0, "v": 0.0}, t, np.zeros(31))
    # The step tolerance is 1e-8 of a state of size 2.
    np.testing.assert_allclose(rollout["x"], np.cos(2 * t), atol=1e-6)
    np.testing.assert_allclose(rollout.x[:, 1], -2 * np.sin(2 * t), atol=1e-6)
    assert not rollout.x.flags.writeable


def test_a_callable_and_its_equations_give_the_same_rollout(cart):
    def simulator(t, x, u):
        return np.array([x[1], -4.0 * x[0] + u[0]])

    t = np.linspace(0, 2, 21)
    u = np.sin(5 * t)
    twin = gpsindy.Model.from_callable(simulator, ["x", "v"], ["u"])
    np.testing.assert_array_equal(twin.simulate([0.3, 0.0], t, u).x, cart.simulate([0.3, 0.0], t, u).x)
    rows = np.array([[0.3, 0.1], [1.0, -1.0]])
    np.testing.assert_allclose(twin.derivative(rows, [1.0, 2.0]), [[0.1, -0.2], [-1.0, -2.0]])


def test_logs_give_controls_and_first_states(cart, runs, tmp_path):
    t, x, u = runs[0]
    log = {"t": t, "x": x[:, 0], "v": x[:, 1], "u": u}
    (rollout,) = gpsindy.simulate(cart, log)
    # The first sample is off by the noise, 0.005.
    assert np.abs(rollout["x"] - x[:, 0]).max() < 0.05
    late = gpsindy.simulate(cart, log, start=1.0, stop=2.0, initial={"v": 0.0})[0]
    assert late.t[0] == pytest.approx(1.0)
    assert late["v"][0] == 0.0
    cart.save(tmp_path / "cart.toml")
    assert gpsindy.score(tmp_path / "cart.toml", log) == cart.score(log)
    found = cart.score(log)
    assert found.rollout.pooled < 0.05
    assert found.one_step.by_state[0].unit == "m"
    assert set(found.windowed.rmse()) == {"x", "v"}


def test_a_velocity_that_is_not_logged_is_reconstructed(cart, runs):
    t, x, u = runs[0]
    twin = gpsindy.Model.from_callable(
        lambda t, x, u: [0.0, -4 * x[0] + u[0]], ["x", "v"], ["u"], kinematic={"x": "v"}
    )
    for model in (cart, twin):
        (rollout,) = gpsindy.simulate(model, {"t": t, "x": x[:, 0], "u": u})
        assert np.abs(rollout["x"] - x[:, 0]).max() < 0.3


class Broken(Exception):
    pass


def test_an_error_of_the_simulator_passes_unchanged():
    def simulator(t, x, u):
        raise Broken("no licence")

    model = gpsindy.Model.from_callable(simulator, ["x"])
    for use in (
        lambda: model.simulate([1.0], [0.0, 1.0]),
        lambda: model.derivative([[1.0]]),
        lambda: model.score({"t": [0.0, 1.0, 2.0], "x": [0.0, 1.0, 2.0]}),
    ):
        with pytest.raises(Broken, match="no licence"):
            use()


@pytest.mark.parametrize("answer", [[1.0, 2.0], [], "fast", None, [[1.0]], 1.0])
def test_rates_of_a_wrong_shape_are_one_clear_error(answer):
    model = gpsindy.Model.from_callable(lambda t, x, u: answer, ["x"])
    with pytest.raises(ValueError, match=r"simulator: f\(t, x, u\) must return the 1 rates"):
        model.simulate([1.0], [0.0, 1.0])


def test_a_diverging_model_is_a_numerical_error():
    model = gpsindy.Model.from_toml("schema='gpsindy.model/1'\n[[state]]\nname='x'\nequation='x^2'\n")
    with pytest.raises(gpsindy.NumericalError, match="diverged at t = "):
        model.simulate([1.0], [0.0, 2.0])
    assert issubclass(gpsindy.NumericalError, RuntimeError)


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda m: m.simulate([1.0], [0.0, 1.0], [0, 0]), r"x0: expected 2 values \(x, v\)"),
        (lambda m: m.simulate({"x": 1.0}, [0.0, 1.0], [0, 0]), "x0: no value for v"),
        (lambda m: m.simulate({"y": 1.0}, [0.0, 1.0], [0, 0]), "x0: no state 'y'"),
        (lambda m: m.simulate([1.0, 0.0], [0.0, 1.0]), "u: the model has the controls u"),
        (lambda m: m.simulate([1.0, 0.0], [0.0, 1.0], [0.0]), "u: expected 2 samples, found 1"),
        (lambda m: m.simulate([1.0, 0.0], [1.0, 0.0], [0, 0]), "t: times must be finite and increase"),
        (lambda m: m.simulate([1.0, 0.0], [0.0, 1.0], [0, 0], hold="cubic"), "`hold` must be"),
        (lambda m: m.simulate([1.0, 0.0], [0.0, 1.0], [0, 0], method="magic"), "`method` must be"),
        (lambda m: m.simulate([1.0, 0.0], [0.0, 1.0], [0, 0], tolerance=1.0), "`tolerance` must be"),
        (lambda m: m.with_parameters(q=1.0), "parameter `q` is unknown; known: k"),
        (lambda m: m.score(np.ones((3, 2))), "logs: expected a Dataset"),
        (lambda m: m.score({"t": [0.0, 1.0], "x": [0.0, 1.0]}), "control `u` is unknown"),
        (lambda m: gpsindy.Model.from_toml("nonsense"), r"model\.toml"),
        (lambda m: gpsindy.Model.from_callable(3, ["x"]), "simulator: expected a callable"),
        (lambda m: gpsindy.Model.from_callable(len, ["x", "x"]), "`x` appears twice"),
        (lambda m: gpsindy.Model.from_callable(len, ["x"], kinematic={"x": "w"}), "state `w` is unknown"),
        (lambda m: pickle.dumps(gpsindy.Model.from_callable(len, ["x"])), "has no file"),
    ],
)
def test_wrong_use_is_one_line_that_names_the_argument(cart, use, message):
    with pytest.raises(ValueError, match=message) as caught:
        use(cart)
    assert "\n" not in str(caught.value)


@pytest.fixture
def heard():
    """Ctrl-C as Python hears it, also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
def test_control_c_ends_a_long_simulation():
    import _thread

    def slow(t, x, u):
        time.sleep(0.001)
        return [-x[0] + np.sin(300 * t)]

    model = gpsindy.Model.from_callable(slow, ["x"])
    timer = threading.Timer(0.3, _thread.interrupt_main)
    begin = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        model.simulate([1.0], np.linspace(0, 1000, 1001))
    assert time.monotonic() - begin < 10


@pytest.mark.usefixtures("heard")
def test_control_c_does_not_wait_for_a_long_step():
    import _thread

    t = np.linspace(0, 30, 1500)
    columns = {"t": t, "x": np.sin(t) + np.sin(17 * t) + np.random.default_rng(0).standard_normal(1500)}
    timer = threading.Timer(0.2, _thread.interrupt_main)
    begin = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        # One column is one step of progress, many seconds long.
        gpsindy.smooth(columns, kernel="rq*se+periodic")
    assert time.monotonic() - begin < 5


def test_other_threads_run_during_a_computation():
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    # Long enough for hundreds of ticks on any machine.
    t = np.linspace(0, 30, 1500)
    x = np.sin(t) + np.sin(7 * t) + 0.1 * np.random.default_rng(0).standard_normal(1500)
    begin = time.monotonic()
    gpsindy.smooth({"t": t, "x": x}, kernel="rq")
    end = time.monotonic()
    done.set()
    thread.join()
    inside = [t for t in ticks if begin < t < end]
    # A held interpreter would leave none or one.
    assert len(inside) > 3
