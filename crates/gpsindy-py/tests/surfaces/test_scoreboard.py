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


@pytest.mark.parametrize("name", ["odebench", "mdbench", "dysts", "nonlinear"])
def test_every_job_of_a_results_file_is_there_once(name):
    lines = [json.loads(line) for line in (PUBLIC / f"results/{name}.jsonl").read_text(encoding="utf-8").splitlines()]
    levels = ("noise", "kept", "snr")
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
