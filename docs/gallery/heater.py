import numpy as np
import gpsindy

model = gpsindy.Model.from_toml("""
name = "oven"

[[state]]
name = "T"
unit = "K"
equation = "(p*u - T)/tau"

[[control]]
name = "u"

[[parameter]]
name = "p"
value = 60.0
unit = "K"
tolerance = 0.02

[[parameter]]
name = "tau"
value = 40.0
unit = "s"
tolerance = 0.02
""")


def machine(seed, delay=4, n=600):
    """Temperature above the room, one sample a second; the command switches between levels and is held."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.choice([0.0, 0.3, 0.6, 1.0], n // 25), 25)
    late = np.concatenate([np.full(delay, u[0]), u])[:n]
    T = np.empty(n)
    T[0] = 60.0 * u[0]
    for i in range(n - 1):
        T[i + 1] = 60.0 * late[i] + (T[i] - 60.0 * late[i]) * np.exp(-1 / 40.0)
    return {"t": np.arange(n, dtype=float), "T": T + 0.1 * random.standard_normal(n), "u": u}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(4)])
print(found.summary())

assert found.verdict == "explained"
cause = found.included[0]
assert cause.effect == "input_delay", cause
assert abs(cause.parameters[0]["value"] - 4.0) < 0.3, cause.parameters

found.save("diagnosis")
model.save("heater.toml")
