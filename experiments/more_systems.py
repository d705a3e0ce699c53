"""Systems beyond the paper, as its authors wished: equations, usual runs, and the library that holds their terms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import gpsindy
from library import Array


@dataclass(frozen=True)
class Truth:
    """A system by its equations; `terms` holds the true coefficients by state, none where no library is exact."""

    equations: dict[str, str]
    initial: list[float]
    period: float
    span: float
    library: dict[str, object]
    terms: dict[tuple[str, str], float]
    controls: dict[str, Callable[[Array], Array]] = field(default_factory=dict)

    def model(self) -> gpsindy.Model:
        """The equations as a model."""
        text = 'schema = "gpsindy.model/1"\nname = "truth"\n'
        text += "".join(f'[[state]]\nname = "{name}"\nequation = "{right}"\n' for name, right in self.equations.items())
        return gpsindy.Model.from_toml(text + "".join(f'[[control]]\nname = "{name}"\n' for name in self.controls))

    def inputs(self, t: Array) -> Array | None:
        """Controls at the samples, held between them."""
        return np.column_stack([control(t) for control in self.controls.values()]) if self.controls else None


SWING = "(9.81*sin(th) - cos(th)*(f + 0.05*om^2*sin(th))/1.1)/(0.5*(4/3 - 0.1*cos(th)^2/1.1))"
FLOW = 5e-5 * (2 * 9.81) ** 0.5 / 0.0154
"""Outflow of a tank over the root of its level, m^0.5/s."""

SYSTEMS = {
    "lorenz": Truth(
        {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8/3*z"},
        [-8.0, 8.0, 27.0],
        0.01,
        10.0,
        {"degree": 2},
        {
            ("x", "x"): -10.0,
            ("x", "y"): 10.0,
            ("y", "x"): 28.0,
            ("y", "x*z"): -1.0,
            ("y", "y"): -1.0,
            ("z", "x*y"): 1.0,
            ("z", "z"): -8.0 / 3.0,
        },
    ),
    "duffing": Truth(
        {"x": "v", "v": "u - 0.3*v + x - x^3"},
        [0.5, 0.0],
        0.05,
        40.0,
        {"degree": 3},
        {("x", "v"): 1.0, ("v", "u"): 1.0, ("v", "v"): -0.3, ("v", "x"): 1.0, ("v", "x^3"): -1.0},
        {"u": lambda t: 0.5 * np.cos(1.2 * t)},
    ),
    "van_der_pol": Truth(
        {"x": "v", "v": "2*(1 - x^2)*v - x"},
        [0.5, 0.0],
        0.05,
        20.0,
        {"degree": 3},
        {("x", "v"): 1.0, ("v", "v"): 2.0, ("v", "x^2*v"): -2.0, ("v", "x"): -1.0},
    ),
    "pendulum": Truth(
        {"phi": "om", "om": "12.5*u - 24.525*sin(phi) - 0.125*om - 0.25*tanh(om/0.02)"},
        [1.2, 0.0],
        0.02,
        20.0,
        {"degree": 1, "trig": True, "terms": ["tanh(om/0.02)", "om*abs(om)"]},
        {
            ("phi", "om"): 1.0,
            ("om", "u"): 12.5,
            ("om", "sin(phi)"): -24.525,
            ("om", "om"): -0.125,
            ("om", "tanh(om/0.02)"): -0.25,
        },
        {"u": lambda t: 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)},
    ),
    "cart_pole": Truth(
        {"x": "v", "th": "om", "v": f"(f + 0.05*(om^2*sin(th) - cos(th)*{SWING}))/1.1", "om": SWING},
        [0.0, 2.6, 0.0, 0.0],
        0.02,
        10.0,
        {"degree": 1, "products": True, "terms": ["om^2*sin(th)", "om^2*sin(th)*cos(th)", "sin(th)*cos(th)"]},
        {},
        {"f": lambda t: np.sin(1.7 * t) + 0.6 * np.cos(4.1 * t)},
    ),
    "double_tank": Truth(
        {"h1": f"q/0.0154 - {FLOW!r}*sqrt(max(h1, 0))", "h2": f"{FLOW!r}*(sqrt(max(h1, 0)) - sqrt(max(h2, 0)))"},
        [0.05, 0.1],
        1.0,
        600.0,
        {"degree": 1, "terms": ["sqrt(max(h1, 0))", "sqrt(max(h2, 0))"]},
        {
            ("h1", "q"): 1 / 0.0154,
            ("h1", "sqrt(max(h1, 0))"): -FLOW,
            ("h2", "sqrt(max(h1, 0))"): FLOW,
            ("h2", "sqrt(max(h2, 0))"): -FLOW,
        },
        {"q": lambda t: 1e-4 + 4e-5 * np.sign(np.sin(0.02 * t)) + 2e-5 * np.sin(0.07 * t)},
    ),
    "planar_quadrotor": Truth(
        {"x": "vx", "z": "vz", "th": "om", "vx": "-2*u1*sin(th)", "vz": "2*u1*cos(th) - 9.81", "om": "200*u2"},
        [0.0, 1.0, 0.05, 0.0, 0.0, 0.0],
        0.02,
        6.0,
        {"degree": 1, "terms": ["u1*sin(th)", "u1*cos(th)", "sin(th)", "cos(th)"]},
        {
            ("x", "vx"): 1.0,
            ("z", "vz"): 1.0,
            ("th", "om"): 1.0,
            ("vx", "u1*sin(th)"): -2.0,
            ("vz", "u1*cos(th)"): 2.0,
            ("vz", "1"): -9.81,
            ("om", "u2"): 200.0,
        },
        {"u1": lambda t: 0.5 * 9.81 + 0.3 * np.sin(2.0 * t), "u2": lambda t: 0.01 * np.cos(3.0 * t)},
    ),
    "epidemic": Truth(
        {"s": "-0.4*s*i", "i": "0.4*s*i - 0.1*i", "r": "0.1*i"},
        [0.99, 0.01, 0.0],
        1.0,
        100.0,
        {"degree": 2},
        {("s", "s*i"): -0.4, ("i", "s*i"): 0.4, ("i", "i"): -0.1, ("r", "i"): 0.1},
    ),
}
