"""The paper's two systems through Rust, the command line and Python: the true terms, no others, and equal numbers.

The two programs are there after `cargo test --profile checks --workspace`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import gpsindy

ROOT = Path(__file__).parents[4]
SUFFIX = ".exe" if sys.platform == "win32" else ""
COMMAND = ROOT / "target" / "checks" / f"gpsindy{SUFFIX}"
EXAMPLE = ROOT / "target" / "checks" / "examples" / f"identify{SUFFIX}"
SYSTEMS = [
    ("lotka_volterra", ["x1", "x2"], [], 2, [{"x1", "x1*x2"}, {"x2", "x1*x2"}]),
    ("unicycle", ["x1", "x2", "x3", "x4"], ["u1", "u2"], 1, [{"x3*cos(x4)"}, {"x3*sin(x4)"}, {"u1"}, {"u2"}]),
]


def run(*arguments):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return gpsindy.Model.from_toml(done.stdout)


@pytest.mark.parametrize(("name", "states", "controls", "degree", "truth"), SYSTEMS, ids=[s[0] for s in SYSTEMS])
def test_three_surfaces_give_the_same_numbers(name, states, controls, degree, truth):
    log = ROOT / "data" / f"{name}.csv"
    if not (log.exists() and COMMAND.exists() and EXAMPLE.exists()):
        pytest.skip("the programs are not built")
    # The controls of these logs are not held between samples.
    hold = "linear" if controls else None
    estimator = gpsindy.GPSINDy(degree=degree, trig=True, products=True, hold=hold)
    rates = {state: f"d{state}" for state in states}
    python = estimator.fit(str(log), x_dot=rates, u=controls or None).model_
    given = [part for state in states for part in ("--derivative", f"{state}=d{state}")]
    roles = ["--state", ",".join(states), *(["--control", ",".join(controls)] if controls else [])]
    library = ["--degree", degree, "--trig", "--products", "--hold", hold or "auto", "--quiet"]
    command = run(COMMAND, "identify", log, *roles, *given, *library)
    rust = run(EXAMPLE, log, ",".join(states), ",".join(controls), degree)
    record = python.identification
    found = [{term for term, value in zip(record.terms, row) if value != 0} for row in record.coefficients]
    assert found == truth
    for other in (command.identification, rust.identification):
        assert other.terms == record.terms
        assert (other.coefficients == record.coefficients).all()
        assert (other.standard_errors == record.standard_errors).all()
