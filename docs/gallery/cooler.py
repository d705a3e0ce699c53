import numpy as np
import gpsindy

model = gpsindy.Model.from_toml("""
name = "block"

[[state]]
name = "T"
unit = "K"
equation = "(p*u^2 - T)/tau"

[[control]]
name = "u"
unit = "A"

[[parameter]]
name = "p"
value = 12.0
unit = "K/A^2"

[[parameter]]
name = "tau"
value = 30.0
unit = "s"
""")


def machine(seed, n=500):
    """Temperature above the room, one sample a second; the machine is what the simulator says."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.choice([0.0, 0.8, 1.4, 2.0], n // 20), 20)
    T = np.empty(n)
    T[0] = 20.0
    for i in range(n - 1):
        T[i + 1] = 12.0 * u[i] ** 2 + (T[i] - 12.0 * u[i] ** 2) * np.exp(-1 / 30.0)
    return {"t": np.arange(n, dtype=float), "T": T + 0.1 * random.standard_normal(n), "u": u}


found = gpsindy.diagnose(model, [machine(seed) for seed in range(4)])
print(found.summary())

assert found.verdict == "no_gap", found.verdict
assert not found.included
assert found.p_value > 0.05, found.p_value

for effect in found.to_dict()["excluded"][:6]:
    print(f"{effect['effect']:20} above {effect['above']:.3g} {effect['unit']}")

found.save("diagnosis")
