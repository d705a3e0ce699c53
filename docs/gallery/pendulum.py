import gpsindy

logs = gpsindy.read_log("data/pendulum.csv", run="run")
found = gpsindy.diagnose("data/pendulum.toml", logs)
print(found.summary())

assert found.verdict == "explained"
cause = found.included[0]
assert cause.effect in ("coulomb_friction", "load_friction"), cause
size = cause.parameters[0]
assert abs(size["value"] - 0.35) < 0.02, size
assert found.closure["closed"] > 0.95

found.save("diagnosis")
