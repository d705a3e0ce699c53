import numpy as np
import gpsindy

TEXT = """
name = "tanks"

[[state]]
name = "h1"
unit = "m"
equation = "k*u - a1*sqrt(max(h1, 0.0001))"

[[state]]
name = "h2"
unit = "m"
equation = "a1*sqrt(max(h1, 0.0001)) - a2*sqrt(max(h2, 0.0001))"

[[control]]
name = "u"
unit = "V"

[[parameter]]
name = "k"
value = 0.02
unit = "m/(s*V)"

[[parameter]]
name = "a1"
value = 0.05
unit = "m^0.5/s"

[[parameter]]
name = "a2"
value = 0.05
unit = "m^0.5/s"
"""
model = gpsindy.Model.from_toml(TEXT)
true = model.with_parameters(a1=0.04)


def machine(seed, n=400, period=0.5):
    """Levels under a pump that changes every ten seconds; the sensors are good to a millimetre or two."""
    random = np.random.default_rng(seed)
    t = period * np.arange(n)
    u = np.repeat(random.uniform(0.5, 3.0, n // 20), 20)
    levels = np.asarray(true.simulate({"h1": 0.5, "h2": 0.5}, t, u[:, None]).x)
    h = levels + 0.002 * random.standard_normal(levels.shape)
    return {"t": t, "h1": h[:, 0], "h2": h[:, 1], "u": u}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(4)])
print(found.summary())

assert found.verdict == "explained"
cause = found.included[0]
assert cause.effect == "parameter_error" and cause.variables == ("a1",), cause
assert abs(found.augmented.parameters[1].value - 0.04) < 0.001

found.save("diagnosis")
model.save("tanks.toml")
