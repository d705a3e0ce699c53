import pathlib
import numpy as np

MODEL = """
name = "axis"

[[state]]
name = "v"
unit = "m/s"
equation = "u"

[[control]]
name = "u"
unit = "m/s^2"
"""
random = np.random.default_rng(1)
folder = pathlib.Path("fleet")
folder.mkdir(exist_ok=True)
(folder / "axis.toml").write_text(MODEL)
manifest = ['model = "axis.toml"']
for number in range(1, 11):
    friction = 1.5 if number == 7 else 0.5 + 0.03 * random.standard_normal()
    lines, t = ["run,t [s],v [m/s],u [m/s^2]"], 0.05 * np.arange(300)
    for run in range(3):
        u = 0.8 * np.sin(0.9 * t + run) + 0.5 * np.sin(2.3 * t + 2 * run)
        v = np.zeros(300)
        for i in range(299):
            # The exact step of v' = u - friction*v under a held u.
            decay = np.exp(-0.05 * friction)
            v[i + 1] = decay * v[i] + (1 - decay) / friction * u[i]
        v = v + 0.01 * random.standard_normal(300)
        lines += [f"{run},{a:.2f},{b:.5f},{c:.6f}" for a, b, c in zip(t, v, u)]
    (folder / f"axis_{number}.csv").write_text("\n".join(lines) + "\n")
    manifest.append(f'[[unit]]\nunit = "axis {number}"\nlogs = "axis_{number}.csv"')
(folder / "fleet.toml").write_text("\n".join(manifest) + "\n")

import json

found = json.loads(open("result/fleet.json").read())
print(json.dumps(found["odd"], indent=1)[:600])
assert {entry["unit"] for entry in found["odd"]} == {"axis 7"}, found["odd"]
