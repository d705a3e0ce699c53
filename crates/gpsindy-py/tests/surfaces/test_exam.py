"""The baseline of the public exam that fits parameters, and the table of the exam."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

EXAM = Path(__file__).parents[4] / "benches/public/exam"

pytestmark = pytest.mark.skipif(not EXAM.is_dir(), reason="benches/public is not here; the repository has it")


def script(name):
    about = importlib.util.spec_from_file_location(f"exam_{name}", EXAM / f"{name}.py")
    module = importlib.util.module_from_spec(about)
    about.loader.exec_module(module)
    return module


def case(folder, rate):
    """A tank that empties with `rate`, of which the simulator says 1."""
    model = """schema = "gpsindy.model/1"
name = "tank"
[[state]]
name = "x"
equation = "-a*x + u"
[[control]]
name = "u"
[[parameter]]
name = "a"
value = 1.0
tolerance = 0.02
"""
    (folder / "model.toml").write_text(model, encoding="utf-8")
    for name, seed in (("real_1", 0), ("real_2", 1), ("holdout_1", 2)):
        generator = np.random.default_rng(seed)
        x, rows = 1.0, ["t,x,u"]
        for k in range(200):
            u = float(k // 20 % 2)
            rows.append(f"{0.05 * k},{x + 0.002 * generator.standard_normal()},{u}")
            x = u / rate + (x - u / rate) * np.exp(-0.05 * rate)
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


@pytest.mark.parametrize(("rate", "verdict"), [(1.5, "explained"), (1.0, "no_gap")])
def test_a_fit_of_the_parameters_names_a_wrong_one_and_no_right_one(tmp_path, rate, verdict):
    pytest.importorskip("scipy")
    baselines = script("baselines")
    case(tmp_path, rate)
    found = baselines.parameters(baselines.Case(tmp_path))
    assert found["verdict"] == verdict and found["gap"]["detected"] == (verdict != "no_gap")
    assert [cause["variables"] for cause in found["causes"]] == ([["a"]] if rate != 1.0 else [])


def test_the_table_has_every_rate_and_none_of_nothing():
    run = script("run")
    rates = {key: [1, 2] for key in run.KEYS} | {"several_found": [0, 0]}
    lines = run.table({"methods": {"ours": rates}}).splitlines()
    assert len(lines) == 3 and lines[0].startswith("| method | right verdict |")
    assert lines[2] == "| ours | 1 of 2 | 1 of 2 | 1 of 2 | 1 of 2 | 1 of 2 | 1 of 2 | - | 1 of 2 |"
