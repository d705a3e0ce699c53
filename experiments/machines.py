"""The machines of `plants.py`, and what is done to them."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from plant import Plant, Rates, mix, one, sign, steps


def motor(push=lambda w: 0.0, u=lambda V: V, R=1.2, K=0.06) -> Rates:
    L, J, b = 0.01, 2e-4, 1e-4
    return lambda t, x, V: [(u(V[0]) - R * x[0] - K * x[1]) / L, (K * x[0] - b * x[1] + push(x[1])) / J]


def slider(push=lambda x, v, t: 0.0, m=1.5) -> Rates:
    return lambda t, x, F: [x[1], (F[0] - 8 * x[0] - 0.8 * x[1] + push(x[0], x[1], t)) / m]


def copter(push=lambda z, v, T: 0.0, u=lambda T: T) -> Rates:
    return lambda t, x, T: [x[1], u(T[0]) / 0.8 - 9.81 + push(x[0], x[1], T[0])]


def tanks(u=lambda q: q, upper=lambda h: 0.0, lower=lambda h: 0.0) -> Rates:
    def rates(t, x, q):
        h, low = (0.12 * math.sqrt(abs(v)) for v in x)
        return [(u(q[0]) - h) / 0.8 + upper(x[0]), (h - low) / 0.5 + lower(x[1])]

    return rates


def boat(u=lambda d: d) -> Rates:
    return lambda t, x, d: [x[1], (0.35 * u(d[0]) - x[1]) / 4]


def slewing_boat(t, x, d):
    return [x[1], (0.35 * x[2] - x[1]) / 4, max(-0.12, min(0.12, (d[0] - x[2]) / 0.05))]


def aircraft(u=lambda e: e) -> Rates:
    return lambda t, x, e: [x[1] - 1.2 * x[0], -6 * x[0] - 1.8 * x[1] - 9 * u(e[0])]


def hoist(push=lambda v: 0.0, m=40.0) -> Rates:
    return lambda t, x, F: [x[1], (F[0] - 15 * x[1] + push(x[1])) / m - 9.81]


def levitation(push=lambda w: 0.0) -> Rates:
    return lambda t, x, i: [x[1], 9.81 - 2 * i[0] ** 2 / (0.2 * x[0] ** 2) + push(x[1])]


def reactor(feed=5.0, death=0.0) -> Rates:
    def rates(t, x, D):
        growth = 0.5 * x[1] * x[0] / (0.4 + x[1])
        return [growth - D[0] * x[0] - death * x[0], D[0] * (feed - x[1]) - growth / 0.5]

    return rates


def exchanger(loss=lambda T: 0.0, u=lambda P: P) -> Rates:
    return lambda t, x, P: [
        0.08 * (x[1] - x[0]) + 0.02 * u(P[0]) - loss(x[0]),
        0.08 * (x[0] - x[1]) - 0.05 * (x[1] - 20),
    ]


def cylinder(push=lambda x, v: 0.0, u=lambda s: s) -> Rates:
    return lambda t, x, s: [x[1], (400 * u(s[0]) - 60 * x[1] + push(*x)) / 20]


def cart_pole(cart=lambda v: 0.0, pivot=lambda w: 0.0) -> Rates:
    def rates(t, x, F):
        s, c = math.sin(x[1]), math.cos(x[1])
        mass = 1 + 0.3 * s * s
        return [
            x[2],
            x[3],
            (F[0] + 0.3 * s * (0.5 * x[3] ** 2 + 9.81 * c)) / mass + cart(x[2]),
            (-F[0] * c - 0.15 * x[3] ** 2 * s * c - 1.3 * 9.81 * s) / (0.5 * mass) + pivot(x[3]),
        ]

    return rates


def table(push=lambda a, w: 0.0) -> Rates:
    return lambda t, x, M: [x[1], (M[0] - 0.02 * x[1] + push(*x)) / 0.05]


def copter_law(log: int) -> Callable:
    draw = random.Random(39 + log)
    goals = [draw.uniform(-2, 2) for _ in range(100)]
    return lambda k, t, x: max(
        0, min(20, 7.848 + 4 * (goals[k // 100] - x[0]) - 2.5 * x[1] + math.sin(3 * t + log))
    )


def hoist_law(log, t, x):
    goal = 1.2 * math.sin(0.5 * t + log) + 0.6 * math.sin(1.3 * t + 2 * log)
    return 392.4 + max(-150, min(150, 90 * (goal - x[0]) - 110 * x[1]))


def levitation_law(log, t, x):
    goal = 1 + 0.12 * math.sin(1.1 * t + log) + 0.06 * math.sin(2.9 * t)
    return max(0.0, math.sqrt(0.981) + 2.2 * (x[0] - goal) + 0.45 * x[1])


def cart_law(log, t, x):
    return 3 * math.sin(1.3 * t + log) + 2 * math.sin(3.6 * t + 2 * log) - 2.5 * x[0] - 1.5 * x[2]


def plants() -> dict[str, Plant]:
    all: dict[str, Plant] = {}

    def family(name: str, nominal: Plant, **variants: dict) -> None:
        all[f"{name}_null"] = replace(nominal, right=[])
        for effect, change in variants.items():
            all[f"{name}_{effect}"] = replace(nominal, **change)

    def dead(u, width):
        return 0.0 if abs(u) < width else u - math.copysign(width, u)

    family(
        "motor",
        Plant(
            {"i": ("A", "(V - R*i - K*w)/L"), "w": ("rad/s", "(K*i - b*w)/J")},
            {"V": "V"},
            {"R": 1.2, "L": 0.01, "K": 0.06, "J": 2e-4, "b": 1e-4},
            motor(),
            [mix(10, 3, 7.3, 40, 1)],
            0.005, 800, [0.02, 0.3],
        ),
        coulomb={"rates": motor(lambda w: -0.008 * sign(w, 0.05)), "right": one("coulomb_friction")},
        constant={"rates": motor(K=0.068), "right": one("parameter_error")},
        warm={"rates": motor(R=1.45), "right": one("parameter_error", "linear_stiffness", "viscous_friction")},
        limit={"rates": motor(u=lambda V: max(-6, min(6, V))), "right": one("input_saturation")},
        dead={"rates": motor(u=lambda V: dead(V, 1.0)), "right": one("input_dead_zone")},
        gain={"rates": motor(u=lambda V: 0.88 * V), "right": one("input_gain")},
    )
    family(
        "slider",
        Plant(
            {"x": ("m", "v"), "v": ("m/s", "(F - k*x - b*v)/m")},
            {"F": "N"},
            {"m": 1.5, "k": 8.0, "b": 0.8},
            slider(),
            [mix(6, 1.1, 2.7, 50, 2)],
            0.02, 500, [0.002, 0.005],
            fine=40,
        ),
        coulomb={"rates": slider(lambda x, v, t: -0.7 * sign(v)), "right": one("coulomb_friction")},
        stribeck={
            "rates": slider(lambda x, v, t: -(0.5 + 0.6 * math.exp(-((v / 0.15) ** 2))) * sign(v, 2e-3)),
            "right": one("stribeck_friction"),
        },
        asymmetric={
            "rates": slider(lambda x, v, t: -(0.9 if v > 0 else 0.4) * sign(v, 2e-3)),
            "right": one("asymmetric_friction"),
        },
        cubic={"rates": slider(lambda x, v, t: -5 * x**3), "right": one("cubic_stiffness")},
        mass={"rates": slider(m=1.8), "right": one("parameter_error", "inertia")},
        stop={
            "rates": slider(lambda x, v, t: -400 * (x - 0.5) - 5 * v if x > 0.5 else 0.0),
            "right": one("end_stop"),
        },
        drift={"rates": slider(lambda x, v, t: 0.12 * t), "right": one("drift")},
        step={"rates": slider(lambda x, v, t: -1.0 * (t > 4.2)), "right": one("step_disturbance")},
        hum={"rates": slider(lambda x, v, t: 0.5 * math.sin(9 * t + 0.4)), "right": one("periodic_disturbance")},
        scale={"reads": lambda x, t: [1.06 * x[0], x[1]], "right": one("sensor_scale")},
        offset={"reads": lambda x, t: [x[0], x[1] + 0.06], "right": one("sensor_bias")},
        worn={"rates": slider(lambda x, v, t: -1.2 * sign(v, 5e-3) * math.exp(-(((x - 0.2) / 0.1) ** 2))), "right": None},
    )
    family(
        "copter",
        Plant(
            {"z": ("m", "v"), "v": ("m/s", "T/m - g")},
            {"T": "N"},
            {"m": 0.8, "g": 9.81},
            copter(),
            [copter_law],
            0.02, 600, [0.01, 0.02],
        ),
        drag={"rates": copter(lambda z, v, T: -0.25 * v * abs(v)), "right": one("quadratic_drag")},
        ground={"rates": copter(lambda z, v, T: T / 0.8 * 0.3 * math.exp(-(z + 3) / 0.8)), "right": None},
        gain={"rates": copter(u=lambda T: 0.93 * T), "right": one("input_gain", "parameter_error", "inertia")},
    )
    family(
        "tanks",
        Plant(
            {"h": ("m", "(q - a*sqrt(abs(h)))/A"), "l": ("m", "(a*sqrt(abs(h)) - a*sqrt(abs(l)))/B")},
            {"q": "m^3/s"},
            {"a": 0.12, "A": 0.8, "B": 0.5},
            tanks(),
            [lambda log: lambda k, t, x: 0.12 + 0.05 * math.sin(0.09 * t + log) + 0.02 * ((k // 60 * 7 + 3 * log) % 5 - 2)],
            1.0, 400, [0.004, 0.004],
            start=(1.0, 0.9),
        ),
        leak={"rates": tanks(lower=lambda h: -0.02), "right": one("bias", "input_bias")},
        gain={"rates": tanks(u=lambda q: 0.9 * q), "right": one("input_gain")},
        evaporation={"rates": tanks(upper=lambda h: -0.01 * h), "right": one("linear_stiffness", "viscous_friction")},
    )
    family(
        "heater",
        Plant(
            {"T": ("degC", "(P - G*(T - Te))/C")},
            {"P": "W"},
            {"C": 50.0, "G": 1.5, "Te": 20.0},
            lambda t, x, P: [(P[0] - 1.5 * (x[0] - 20)) / 50],
            [steps(60, 40, 45)],
            1.0, 500, [0.05],
            start=(60.0,),
        ),
        late={"late": 3.4, "right": one("input_delay", "sensor_delay")},
        lag={
            "rates": lambda t, x, P: [(x[1] - 1.5 * (x[0] - 20)) / 50, (P[0] - x[1]) / 6],
            "hidden": (60.0,),
            "right": one("input_lag", "sensor_filter"),
        },
        probe={
            "rates": lambda t, x, P: [(P[0] - 1.5 * (x[0] - 20)) / 50, (x[0] - x[1]) / 4],
            "hidden": (60.0,),
            "reads": lambda x, t: [x[1]],
            "right": one("sensor_filter", "input_lag"),
        },
    )
    vehicle = Plant(
        {"s": ("m", "v"), "v": ("m/s", "(F - c*v)/M")},
        {"F": "N"},
        {"M": 800.0, "c": 30.0},
        lambda t, x, F: [x[1], (F[0] - 30 * x[1]) / 800],
        [mix(1500, 0.3, 0.9, 60, 8)],
        0.05,
        600,
        [0.05, 0.02],
    )
    gusty = {"rates": lambda t, x, F: [x[1], (F[0] - 30 * x[1]) / 800 + x[2], -x[2] / 1.5], "hidden": (0.0,)}
    family("vehicle", vehicle, gusts={**gusty, "gust": (0.25, 1.5), "right": one("process_noise")})
    family(
        "boat",
        Plant(
            {"psi": ("rad", "r"), "r": ("rad/s", "(K*d - r)/T")},
            {"d": "rad"},
            {"T": 4.0, "K": 0.35},
            boat(),
            [mix(0.5, 0.25, 0.6, 30, 11)],
            0.1, 600, [0.005, 0.002],
        ),
        rudder={"rates": slewing_boat, "hidden": (0.0,), "right": one("input_rate_limit")},
        trim={
            "rates": boat(lambda d: 0.85 * d + 0.03),
            "right": [{g, b} for g in ("input_gain", "parameter_error") for b in ("bias", "input_bias")],
        },
    )
    family(
        "aircraft",
        Plant(
            {"al": ("rad", "q - Za*al"), "q": ("rad/s", "-Ma*al - Mq*q - Md*e")},
            {"e": "rad"},
            {"Za": 1.2, "Ma": 6.0, "Mq": 1.8, "Md": 9.0},
            aircraft(),
            [mix(0.15, 1.7, 3.9, 40, 12)],
            0.02, 600, [0.001, 0.003],
        ),
        gain={"rates": aircraft(lambda e: 0.8 * e), "right": one("input_gain", "parameter_error")},
        late={"late": 0.07, "right": one("input_delay", "sensor_delay", "clock")},
        lag={
            "rates": lambda t, x, e: [x[1] - 1.2 * x[0], -6 * x[0] - 1.8 * x[1] - 9 * x[2], (e[0] - x[2]) / 0.06],
            "hidden": (0.0,),
            "right": one("input_lag"),
        },
    )
    family(
        "hoist",
        Plant(
            {"h": ("m", "v"), "v": ("m/s", "(F - c*v)/m - 9.81")},
            {"F": "N"},
            {"m": 40.0, "c": 15.0},
            hoist(),
            [lambda log: lambda k, t, x: hoist_law(log, t, x)],
            0.02, 700, [0.002, 0.004],
            fine=30,
        ),
        coulomb={"rates": hoist(lambda v: -25 * sign(v, 1e-2)), "right": one("coulomb_friction")},
        mass={"rates": hoist(m=44.0), "right": one("parameter_error", "inertia")},
        both={
            "rates": hoist(lambda v: -25 * sign(v, 5e-3), m=43.0),
            "right": [{"coulomb_friction", m} for m in ("parameter_error", "inertia")],
        },
    )
    family(
        "levitation",
        Plant(
            {"z": ("m", "w"), "w": ("m/s", "9.81 - k*i^2/(m*z^2)")},
            {"i": "A"},
            {"k": 2.0, "m": 0.2},
            levitation(),
            [lambda log: lambda k, t, x: levitation_law(log, t, x)],
            0.01, 700, [0.001, 0.01],
            start=(1.0, 0.0),
        ),
        drag={"rates": levitation(lambda w: -0.5 * w), "right": one("viscous_friction")},
        offset={"reads": lambda x, t: [x[0] + 0.02, x[1]], "right": one("sensor_bias")},
    )
    family(
        "reactor",
        Plant(
            {"X": ("g/L", "mu*Sb*X/(Ks+Sb) - D*X"), "Sb": ("g/L", "D*(Sf-Sb) - mu*Sb*X/(Y*(Ks+Sb))")},
            {"D": "1/h"},
            {"mu": 0.5, "Ks": 0.4, "Y": 0.5, "Sf": 5.0},
            reactor(),
            [lambda log: lambda k, t, x: 0.22 + 0.12 * math.sin(0.15 * t + log) + 0.08 * ((k // 40 * 5 + log) % 3 - 1)],
            0.2, 400, [0.02, 0.02],
            start=(2.0, 0.5),
        ),
        death={"rates": reactor(death=0.04), "right": one("viscous_friction", "linear_stiffness")},
        feed={"rates": reactor(feed=5.6), "right": one("parameter_error")},
    )
    family(
        "exchanger",
        Plant(
            {"T1": ("degC", "a*(T2 - T1) + 0.02*P"), "T2": ("degC", "a*(T1 - T2) - b*(T2 - Ta)")},
            {"P": "W"},
            {"a": 0.08, "b": 0.05, "Ta": 20.0},
            exchanger(),
            [steps(100, 80, 50)],
            1.0, 600, [0.05, 0.05],
            start=(50.0, 35.0),
        ),
        radiation={"rates": exchanger(lambda T: 3e-10 * ((T + 273) ** 4 - 293**4)), "right": None},
        leak={
            "rates": exchanger(lambda T: 0.01 * (T - 20)),
            "right": [{loss, b} for loss in ("viscous_friction", "linear_stiffness") for b in ("bias", "input_bias")],
        },
        limit={"rates": exchanger(u=lambda P: min(P, 150)), "right": one("input_saturation")},
    )
    family(
        "cylinder",
        Plant(
            {"x": ("m", "v"), "v": ("m/s", "(G*s - B*v)/M")},
            {"s": "V"},
            {"M": 20.0, "B": 60.0, "G": 400.0},
            cylinder(),
            [mix(1.0, 0.9, 2.3, 45, 14)],
            0.02, 600, [0.003, 0.01],
            fine=40,
        ),
        dead={"rates": cylinder(u=lambda s: dead(s, 0.12)), "right": one("input_dead_zone")},
        asymmetric={
            "rates": cylinder(lambda x, v: -(70 if v > 0 else 35) * sign(v, 3e-3)),
            "right": one("asymmetric_friction"),
        },
        stribeck={
            "rates": cylinder(lambda x, v: -(40 + 50 * math.exp(-((v / 0.2) ** 2))) * sign(v, 5e-3)),
            "right": one("stribeck_friction"),
        },
        diode={"rates": cylinder(lambda x, v: -4 * (math.exp(1.5 * v) - 1)), "right": None},
        worn={"rates": cylinder(lambda x, v: -60 * sign(v, 5e-3) * (abs(x - 0.4) < 0.25)), "right": None},
    )
    family(
        "cart_pole",
        Plant(
            {
                "p": ("m", "pv"),
                "th": ("rad", "om"),
                "pv": ("m/s", "(F + m*sin(th)*(l*om^2 + 9.81*cos(th)))/(M + m*sin(th)^2)"),
                "om": (
                    "rad/s",
                    "(-F*cos(th) - m*l*om^2*sin(th)*cos(th) - (M + m)*9.81*sin(th))/(l*(M + m*sin(th)^2))",
                ),
            },
            {"F": "N"},
            {"M": 1.0, "m": 0.3, "l": 0.5},
            cart_pole(),
            [lambda log: lambda k, t, x: cart_law(log, t, x)],
            0.02, 500, [0.002, 0.003, 0.01, 0.02],
        ),
        pivot={"rates": cart_pole(pivot=lambda w: -0.25 * w), "right": one("viscous_friction")},
        dry={"rates": cart_pole(cart=lambda v: -0.4 * sign(v, 1e-2)), "right": one("coulomb_friction")},
    )
    family(
        "table",
        Plant(
            {"a": ("rad", "w"), "w": ("rad/s", "(M - d*w)/J")},
            {"M": "N*m"},
            {"J": 0.05, "d": 0.02},
            table(),
            [mix(0.12, 0.6, 1.7, 50, 15)],
            0.01, 900, [0.002, 0.01],
        ),
        ripple={"rates": table(lambda a, w: 0.03 * math.sin(6 * a + 0.7)), "right": one("cogging")},
        unbalance={"rates": table(lambda a, w: 0.04 * math.sin(a + 0.5)), "right": one("gravity_load")},
        air={"rates": table(lambda a, w: -0.004 * w * abs(w)), "right": one("quadratic_drag")},
    )
    return all
