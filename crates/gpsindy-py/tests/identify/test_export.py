"""Exported equations are read back by readers of those languages and give the numbers of our own integrator.

Python, C and Rust are compiled and run by `crates/gpsindy-core/tests/public/export.rs`.
"""

from __future__ import annotations

import bisect
import math

import numpy as np
import pytest
import reads_latex
import reads_modelica
import runs_julia

import gpsindy

PERIOD = 0.05
TIME = PERIOD * np.arange(41)
CONTROLS = np.column_stack([np.sin(3 * TIME), 0.5 + np.cos(TIME)])

EVERYTHING = """
schema = "gpsindy.model/1"
name = "everything"
initial = {{ x = 0.4, v = -0.2 }}

[[state]]
name = "x"
equation = "v"
measured = "1.02*x + 0.1*u"

[[state]]
name = "v"
equation = "(delay(u, tau) - lambda_1*x^3 - 0.3*v*abs(v))/m + sin(x)*cos(v) - tanh(2*v) + 0.1*atan2(x, 1 + v^2) - dead_zone(x, 0.2) + clamp(3*x, -1, 0.5) + min(x, v) - max(x, 0.1) + 0.2*sign(v - 100) + step(u - 0.5)"

[[state]]
name = "speed"
equation = "{play}exp(-speed^2) - speed + log(2 + sqrt(abs(x) + 1)) - (x - (v - speed)) - x/(v^2 + 2)/3 + 2^-x + 0.1*t + asin(x/50) + acos(x/50) + atan(x) + sinh(x/9) - cosh(x/9) + tan(x/50) + pi + delay(0.5*u*w, 0.1) + (1e-7*x)^2*1e12 - -2e-7*v + -x^2"

[[control]]
name = "u"
[[control]]
name = "w"

[[parameter]]
name = "m"
value = 1.7
[[parameter]]
name = "lambda_1"
value = 0.8
[[parameter]]
name = "tau"
value = 0.15
"""
PLAIN = '{"name": "plain", "state": [{"name": "x1", "equation": "x2"}, {"name": "x2", "equation": "-2*x1 - 1e-9*x2"}]}'


def everything(play: str = "") -> gpsindy.Model:
    return gpsindy.Model.from_toml(EVERYTHING.format(play=play))


def models() -> list[gpsindy.Model]:
    return [everything(), gpsindy.Model.from_json(PLAIN)]


def controls_of(model: gpsindy.Model) -> np.ndarray:
    return CONTROLS[:, : len(model.controls)]


def initial_of(model: gpsindy.Model) -> np.ndarray:
    return np.array([model.initial.get(state.name, 0.3) for state in model.states])


def ours(model: gpsindy.Model) -> gpsindy.Rollout:
    """One step of the classical Runge-Kutta method between samples."""
    u = controls_of(model) if model.controls else None
    return model.simulate(initial_of(model), TIME, u, method="rk4")


def theirs(model: gpsindy.Model, rates) -> np.ndarray:
    """The same steps by `rates(names, late)`; delays look from the middle of a step, as controls are held over it."""
    names = [state.name for state in model.states]
    controls = controls_of(model)
    rows = [initial_of(model)]

    def held(t):
        row = controls[max(bisect.bisect_right(list(TIME), t) - 1, 0)] if model.controls else ()
        return {control.name: value for control, value in zip(model.controls, row)}

    for i in range(len(TIME) - 1):
        start, h, x = TIME[i], TIME[i + 1] - TIME[i], rows[-1]

        def rate(x, t, middle=start + 0.5 * h):
            known = {"t": t, **{p.name: p.value for p in model.parameters}}

            def late(read, shift):
                return read({**known, **held(max(middle - shift, TIME[0]))})

            return np.array(rates({**known, **held(middle), **dict(zip(names, x))}, late))

        k1 = rate(x, start)
        k2 = rate(x + h / 2 * k1, start + h / 2)
        k3 = rate(x + h / 2 * k2, start + h / 2)
        rows.append(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3, start + h)))
    return np.array(rows)


def assert_same(found, rollout):
    # The same operations but for the order of additions, over 40 steps.
    np.testing.assert_allclose(found, rollout.x, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("model", models(), ids=lambda model: model.name)
def test_latex_reads_as_the_model(model):
    blocks = reads_latex.lines(model.export("latex"))
    rates, parameters = blocks[0], blocks[-1]
    assert [left for left, _ in rates][0] in ("\\dot{x}", "\\dot{x_{1}}")
    if model.parameters:
        assert [float(right) for _, right in parameters] == [p.value for p in model.parameters]

    def evaluate(names, late):
        # An index is written below, without the line that stands for it in a name.
        def plain(names):
            return {name.replace("_", ""): value for name, value in names.items()}

        def earlier(read, shift):
            return late(lambda then: read(plain(then)), shift)

        readers = [reads_latex.Reader(right, plain(names), earlier) for _, right in rates]
        values = [reader.sum() for reader in readers]
        assert all(reader.place == len(reader.tokens) for reader in readers)
        return values

    assert_same(theirs(model, evaluate), ours(model))


@pytest.mark.parametrize("model", models(), ids=lambda model: model.name)
def test_modelica_reads_as_the_model(model):
    reader = reads_modelica.Reader(model.export("modelica"))
    assert reader.inputs == [control.name for control in model.controls]
    assert reader.parameters == {p.name: p.value for p in model.parameters}
    assert list(reader.rates) == [state.name for state in model.states]

    def evaluate(names, late):
        names = {**names, "time": names["t"]}
        return [reader.value(rate, names, lambda read, shift: late(read, shift)) for rate in reader.rates.values()]

    assert_same(theirs(model, evaluate), ours(model))
    if model.name == "everything":
        value = reader.value(reader.others["x_measured"], {"x": 2.0, "u": 3.0}, None)
        assert value == pytest.approx(1.02 * 2.0 + 0.3)


@pytest.mark.parametrize("model", [everything("play(u, 0.3) + delay(play(u*w, 0.1), 0.1) - "), *models()[1:]], ids=lambda m: m.name)
def test_julia_runs_as_the_model(model):
    program = runs_julia.Program(model.export("julia"))
    record = {"time": TIME, "control": list(controls_of(model))}
    found = np.array(program["simulate"](record, initial_of(model), 1))
    assert_same(found, ours(model))


def test_sympy_gives_the_rates_of_the_model():
    model = gpsindy.Model.from_toml(EVERYTHING.format(play="").replace("delay(u, tau)", "u").replace("delay(0.5*u*w, 0.1)", "w"))
    names: dict = {}
    exec(model.export("sympy"), names)
    point = {"x": 0.31, "v": -0.42, "speed": 0.53, "u": 0.7, "w": 1.1, "t": 0.3}
    values = {**names["values"], **{names[name]: value for name, value in point.items()}}
    found = [float(rate.subs(values)) for rate in names["rates"]]
    expected = model.derivative([[0.31, -0.42, 0.53]], [[0.7, 1.1]], 0.3)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert math.isfinite(sum(found))
