import numpy as np
import gpsindy
import gpsindy.fmu


def machine(seed, damping=0.35, n=250, period=0.02, steps=10):
    """Angle of the pendulum under a mixture of sines, with a damping of 0.35 N m s."""
    random = np.random.default_rng(seed)
    t = period * np.arange(n)
    u = sum(random.uniform(1, 3) * np.sin(2 * np.pi * f * t + random.uniform(0, 6)) for f in (0.3, 0.7, 1.1))
    h, x, rows = period / steps, np.zeros(2), []

    def rate(x, u):
        th, w = x
        return np.array([w, (u - damping * w) / 0.8 - 9.81 * np.sin(th)])

    for i in range(n):
        rows.append(x[0])
        for _ in range(steps):
            x = x + h * rate(x + h / 2 * rate(x, u[i]), u[i])
    return {"t": t, "th": np.array(rows) + 1e-3 * random.standard_normal(n), "u": u}


simulator = gpsindy.fmu.Simulator("pendulum.fmu", kinematic={"th": "w"}, forces={"f": ("w", "th")}, dt=0.02)
found = gpsindy.diagnose(simulator, [machine(seed) for seed in range(4)], hold="zero")
print(found.summary())

assert found.verdict == "explained", found.verdict
(cause,) = found.included
assert (cause.effect, cause.variables) == ("parameter_error", ("b",)), cause
assert abs(cause.parameters[0]["value"] - 0.35) < 0.005, cause.parameters
found.save("diagnosis")

from pathlib import Path

print(Path("diagnosis/augmented.ssv").read_text())
