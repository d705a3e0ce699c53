import numpy as np
import gpsindy

model = gpsindy.Model.from_toml("""
name = "mixer"

[[state]]
name = "w"
unit = "rad/s"
equation = "(u - d*w)/J"

[[control]]
name = "u"
unit = "N*m"

[[parameter]]
name = "d"
value = 0.08
unit = "N*m*s/rad"

[[parameter]]
name = "J"
value = 0.1
unit = "kg*m^2"
""")


def machine(seed, n=500, period=0.02, steps=20):
    """Speed of the shaft in a fluid whose resistance has ripples over the speed."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.uniform(-0.6, 0.6, n // 25), 25)
    w, speed, h = np.empty(n), 0.0, period / steps
    for i in range(n):
        w[i] = speed
        for _ in range(steps):
            speed += h * (u[i] - 0.08 * speed - 0.12 * np.sin(3.0 * speed) ** 2 * np.sin(9.0 * speed)) / 0.1
    return {"t": period * np.arange(n), "w": w + 0.01 * random.standard_normal(n), "u": u}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(5)])
print(found.summary())

assert found.verdict == "unexplained", found.verdict
assert not found.included, found.included
left = found.to_dict()["unexplained"]
assert left["depends_on"] in (["w"], ["u"]), left

found.save("diagnosis")
