"""What an installed wheel must do with nothing but numpy beside it; the release runs it in a bare environment."""

import numpy as np

import gpsindy

t = np.linspace(0, 4, 81)
found = gpsindy.GPSINDy(degree=1).fit(3 * np.exp(-0.5 * t), t, feature_names=["x"])
assert found.equations(precision=3) == ["-0.5*x"], found.equations(precision=3)

model = gpsindy.Model.from_toml('[[state]]\nname = "x"\nequation = "-0.5*x"\n')
noise = np.random.default_rng(0).standard_normal((3, 81))
logs = [{"t": t, "x": 3 * np.exp(-0.5 * t) + 0.8 * (1 - np.exp(-0.5 * t)) + 0.01 * row} for row in noise]
diagnosis = gpsindy.diagnose(model, logs, effects=["bias"])
assert diagnosis.verdict == "explained", diagnosis.summary()
assert [cause.effect for cause in diagnosis.included] == ["bias"]
print(f"gpsindy {gpsindy.__version__} works here")
