import numpy as np
import gpsindy

model = gpsindy.Model.from_toml("""
name = "drive"

[[state]]
name = "w"
unit = "rad/s"
equation = "(k*u - d*w)/J"

[[control]]
name = "u"
unit = "N*m"

[[parameter]]
name = "k"
value = 1.0
tolerance = 0.02

[[parameter]]
name = "d"
value = 0.05
unit = "N*m*s/rad"
tolerance = 0.02

[[parameter]]
name = "J"
value = 0.1
unit = "kg*m^2"
""")


def machine(seed, dry=0.15, n=400, period=0.02, steps=40):
    """Speed of a drive whose friction holds it at rest, integrated in small steps."""
    random = np.random.default_rng(seed)
    t, u, w = period * np.arange(n), np.empty(n), np.empty(n)
    speed = 0.0
    for i in range(n):
        u[i] = 0.8 * np.sin(1.3 * t[i] + seed) + 0.5 * np.sign(np.sin(0.7 * t[i] + 2 * seed))
        w[i] = speed
        for _ in range(steps):
            free = speed + period / steps * (u[i] - 0.05 * speed) / 0.1
            speed = np.sign(free) * max(abs(free) - period / steps * dry / 0.1, 0.0)
    return {"t": t, "w": w + 0.02 * random.standard_normal(n), "u": u}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(5)])
print(found.summary())

assert found.verdict == "explained"
cause = found.included[0]
assert cause.effect == "coulomb_friction", cause
level, corner = cause.parameters
# 0.15 N*m over an inertia of 0.1 kg*m^2.
assert level["low"] <= 1.5 <= level["high"], level
assert corner["value"] == 0.0, corner

found.save("diagnosis")
model.save("drive.toml")
