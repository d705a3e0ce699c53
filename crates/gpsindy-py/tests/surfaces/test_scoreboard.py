"""The scoreboard says what the results say that are kept beside its scripts."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
PUBLIC = ROOT / "benches/public"

pytestmark = pytest.mark.skipif(not PUBLIC.is_dir(), reason="benches/public is not here; the repository has it")


def test_the_page_is_drawn_from_the_results():
    done = subprocess.run([sys.executable, PUBLIC / "page.py", "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_bad_model_counts_as_silent_only_without_a_note(monkeypatch):
    monkeypatch.syspath_prepend(str(PUBLIC))
    import page

    line = {"equations": ["x"], "noted": False, "generalisation": -2.0, "nmse": 0.5}
    assert page.is_worse_than_the_mean("odebench", line) and page.is_silent("odebench", line)
    assert not page.is_silent("odebench", {**line, "noted": True})
    assert not page.is_worse_than_the_mean("odebench", {**line, "generalisation": 0.3})
    assert not page.is_worse_than_the_mean("mdbench", line)
    assert page.is_worse_than_the_mean("mdbench", {**line, "nmse": None})
    chaos = {"rates": 1.2, "status": 0, "notes": ["small differences grow a million times within 3 s: the motion is chaotic"]}
    assert page.is_worse_than_the_mean("dysts", chaos) and page.is_silent("dysts", chaos)
    assert not page.is_silent("dysts", {**chaos, "status": 1})
    assert not page.is_silent("dysts", {**chaos, "notes": ["the refinement stopped before it converged"]})
    assert page.is_worse_than_the_mean("dysts", {"rates": None}) and not page.is_silent("dysts", {"rates": None})


@pytest.mark.parametrize("name", ["odebench", "mdbench", "dysts", "nonlinear"])
def test_every_job_of_a_results_file_is_there_once(name):
    lines = [json.loads(line) for line in (PUBLIC / f"results/{name}.jsonl").read_text(encoding="utf-8").splitlines()]
    levels = ("noise", "kept", "samples", "snr")
    jobs = [(line["system"], line["method"], *(line.get(level) for level in levels)) for line in lines]
    assert lines and len(set(jobs)) == len(jobs)


def test_an_interrupted_run_goes_on_where_it_was(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(PUBLIC))
    import jobs

    ran = []

    def run(about, factor):
        if about["system"] == 2 and not ran[1:]:
            ran.append("interrupted")
            raise KeyboardInterrupt
        ran.append(about["system"])
        return {"value": factor * about["system"]}

    wanted = [({"system": system, "method": "m"}, 10) for system in (1, 2, 3)]
    with pytest.raises(KeyboardInterrupt):
        jobs.carried_on(tmp_path / "out.jsonl", wanted, run)
    lines = jobs.carried_on(tmp_path / "out.jsonl", wanted, run)
    assert ran == [1, "interrupted", 2, 3]
    assert [line["value"] for line in lines] == [10, 20, 30]
    assert jobs.lines_of(tmp_path / "out.jsonl") == lines


def test_missed_rates_are_those_of_the_printed_terms(monkeypatch):
    monkeypatch.syspath_prepend(str(PUBLIC))
    import dysts_systems
    import numpy as np

    x, y = np.array([0.5, 1.0, 2.0]), np.array([2.0, -1.0, 0.3])
    rates = np.column_stack([3 * x**2 * y - 1, x / (0.7 + x)])
    found = [{"x^2*y": 3.0, "1": -1.0}, {"(x/(h_x + x))": 1.0}]
    missed = dysts_systems.missed_rates(found, {"h_x": 0.7}, np.column_stack([x, y]), rates)
    assert missed < 1e-20
    # The worst state counts, and an equation without a term predicts no motion.
    assert abs(dysts_systems.missed_rates([found[0], {}], {}, np.column_stack([x, y]), rates) - 1) < 1e-12
