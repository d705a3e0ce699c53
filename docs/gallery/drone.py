import numpy as np
import gpsindy

model = gpsindy.Model.from_toml("""
name = "drone"

[[state]]
name = "y"
unit = "m"
equation = "v"

[[state]]
name = "v"
unit = "m/s"
equation = "g*tan(lean) - d*v*abs(v)"

[[control]]
name = "lean"
unit = "rad"

[[parameter]]
name = "g"
value = 9.81
unit = "m/s^2"

[[parameter]]
name = "d"
value = 0.12
unit = "1/m"
""")


def machine(seed, gust=0.6, memory=0.8, n=600, period=0.02, steps=10):
    """Place and speed of the drone in gusts: a first-order noise of 0.6 m/s^2 that remembers for 0.8 s."""
    random = np.random.default_rng(seed)
    lean = np.repeat(random.uniform(-0.2, 0.2, n // 30), 30)
    h, push = period / steps, gust * random.standard_normal()
    kept = np.exp(-h / memory)
    y, v, rows = 0.0, 0.0, []
    for i in range(n):
        rows.append((y, v))
        for _ in range(steps):
            y += h * v
            v += h * (9.81 * np.tan(lean[i]) - 0.12 * v * abs(v) + push)
            push = kept * push + gust * np.sqrt(1 - kept**2) * random.standard_normal()
    noise = np.array([0.01, 0.02]) * random.standard_normal((n, 2))
    y, v = (np.array(rows) + noise).T
    return {"t": period * np.arange(n), "y": y, "v": v, "lean": lean}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(5)])
print(found.summary())

assert found.verdict == "explained", found.verdict
(gusts,) = found.included
assert (gusts.effect, gusts.state) == ("process_noise", "v"), gusts
size = {p["name"]: p for p in gusts.parameters}
for name, truth in (("rms", 0.6), ("tau", 0.8)):
    assert 0.8 * size[name]["low"] < truth < 1.25 * size[name]["high"], size[name]

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt

log = machine(7)
still = model.simulate([log["y"][0], log["v"][0]], log["t"], u=log["lean"][:, None])
figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
axis.plot(log["t"], log["v"], label="log")
axis.plot(log["t"], still.x[:, 1], label="simulator, no wind")
axis.set(xlabel="time, s", ylabel="v, m/s")
axis.legend()
figure.savefig("drone.png")
found.save("diagnosis")
