"""A cart on a spring as a simulator that steps, shared by tests."""

from __future__ import annotations

import numpy as np

import gpsindy


def cart(x, u, force, parameters, dt):
    """A cart on a spring, steps of semi-implicit Euler."""
    place, speed = x
    mass, stiffness = parameters
    speed = speed + dt * (u[0] + force[0] - stiffness * place - 0.4 * speed) / mass
    return [place + dt * speed, speed]


def carts(x, u, force, parameters, dt):
    speed = x[:, 1] + dt * (u[:, 0] + force[:, 0] - parameters[:, 1] * x[:, 0] - 0.4 * x[:, 1]) / parameters[:, 0]
    return np.column_stack([x[:, 0] + dt * speed, speed])


def stepper(step=carts, vectorized=True, dt=0.005):
    return gpsindy.Stepper(
        step,
        ["x", "v"],
        ["u"],
        dt,
        parameters={"mass": (1.2, 0.0, np.inf), "stiffness": 4.0},
        forces={"f": ("v", "x")},
        kinematic={"x": "v"},
        vectorized=vectorized,
    )


def by_hand(t, u, dt, parameters=(1.2, 4.0), force=lambda x: 0.0, late=0.0, start=(0.0, 0.0)):
    """The same rollout, step by step."""
    x = np.array(start, dtype=float)
    rows = [x]
    for i in range(len(t) - 1):
        now, left = t[i], t[i + 1] - t[i]
        while left > 1e-12:
            h = min(dt, left)
            command = u[max(0, np.searchsorted(t, now - late + 1e-9) - 1)]
            x = np.array(cart(x, [command], [force(x)], parameters, h))
            now, left = now + h, left - h
        rows.append(x)
    return np.array(rows)
