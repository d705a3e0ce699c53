import numpy as np
import gpsindy

model = gpsindy.Model.from_toml("""
name = "car"

[[state]]
name = "x"
unit = "m"
equation = "v*cos(phi)"

[[state]]
name = "y"
unit = "m"
equation = "v*sin(phi)"

[[state]]
name = "phi"
unit = "rad"
equation = "v/L*tan(delta)"

[[state]]
name = "v"
unit = "m/s"
equation = "a"

[[control]]
name = "delta"
unit = "rad"

[[control]]
name = "a"
unit = "m/s^2"

[[parameter]]
name = "L"
value = 0.33
unit = "m"
""")


def machine(seed, tau=0.25, n=300, period=0.04, steps=20):
    """Pose and speed of a car that turns left and right at changing speed."""
    random = np.random.default_rng(seed)
    t = period * np.arange(n)
    delta = np.repeat(random.uniform(-0.3, 0.3, n // 15), 15)
    a = 0.6 * np.cos(0.8 * t + seed)
    x, wheel, rows = np.array([0.0, 0.0, 0.1 * seed, 1.5]), delta[0], []
    for i in range(n):
        rows.append(x)
        for _ in range(steps):
            h = period / steps
            rate = np.array([x[3] * np.cos(x[2]), x[3] * np.sin(x[2]), x[3] / 0.33 * np.tan(wheel), a[i]])
            half = x + h / 2 * rate
            middle = wheel + (delta[i] - wheel) * (1 - np.exp(-h / 2 / tau))
            rate = np.array([half[3] * np.cos(half[2]), half[3] * np.sin(half[2]), half[3] / 0.33 * np.tan(middle), a[i]])
            x, wheel = x + h * rate, wheel + (delta[i] - wheel) * (1 - np.exp(-h / tau))
    log = np.array(rows) + np.array([0.005, 0.005, 0.005, 0.01]) * random.standard_normal((n, 4))
    return {"t": t, **dict(zip(("x", "y", "phi", "v"), log.T)), "delta": delta, "a": a}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(4)])
print(found.summary())

assert found.verdict == "explained"
cause = found.included[0]
assert cause.effect == "input_lag", cause
assert abs(cause.parameters[0]["value"] - 0.25) < 0.02, cause.parameters

found.save("diagnosis")
model.save("car.toml")
