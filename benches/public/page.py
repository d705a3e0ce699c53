"""Writes the tables of docs/scoreboard.md and docs/exam.md from the results that are kept in benches/public/results.

    python benches/public/page.py [--check]

A results file is the `--out` of its script: a line a job, or for the exam one object. What stands between `<!-- NAME -->` and
`<!-- end -->` on a page is replaced by the table of NAME; with `--check` nothing is written, and the status is 1 where a page is not what
would be written.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import sys
from pathlib import Path

import dysts_systems
import jobs
import mdbench
import nonlinear
import odebench

RESULTS = Path(__file__).with_name("results")
DOCS = Path(__file__).parents[2] / "docs"
# Parts of notes that speak of the logs or the motion, not of the model.
OF_THE_LOGS = (
    "is not in the logs",
    "if its sensor ends there, give its range",
    "look interpolated between samples",
    "small differences grow a million times",
    "differences of the size of the noise outgrow",
)


def results_of(name):
    return jobs.lines_of(RESULTS / f"{name}.jsonl")


def is_worse_than_the_mean(set_name, line):
    """Whether a model predicts data that a user would hold out worse than their mean does; a rollout that diverges is."""
    if set_name == "odebench":
        return (line["generalisation"] if line["generalisation"] is not None else -1.0) < 0
    if set_name in ("mdbench", "dysts"):
        missed = line["nmse" if set_name == "mdbench" else "rates"]
        return missed is None or missed > 1
    return line["error"] is None or line["error"] > line["mean"]


def is_silent(set_name, line):
    """Whether gpsindy ended well and said nothing of the result."""
    if set_name in ("nonlinear", "dysts"):
        return line.get("status") == 0 and all(any(part in note for part in OF_THE_LOGS) for note in line["notes"])
    return line["equations"] is not None and not line["noted"]


def is_beyond_reach(set_name, line, lines):
    """Whether the true equations do no better: MDBench puts noisy states into them, and what that costs is no fault of a model."""
    same = (other for other in lines if (other["system"], other.get("snr")) == (line["system"], line.get("snr")))
    return set_name == "mdbench" and any(other["method"] == "truth" and is_worse_than_the_mean(set_name, other) for other in same)


def silent():
    rows = [
        "| set | runs | worse than the mean | of these, the truth too | of the rest, without a warning | runs that are better, with a warning |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in ("odebench", "mdbench", "dysts", "nonlinear"):
        lines = results_of(name)
        own = [line for line in lines if line["method"].startswith("gpsindy")]
        bad = [line for line in own if is_worse_than_the_mean(name, line)]
        rest = [line for line in bad if not is_beyond_reach(name, line, lines)]
        unsaid = sum(is_silent(name, line) for line in rest)
        warned = sum(not is_silent(name, line) for line in own if line not in bad)
        rows.append(f"| {name} | {len(own)} | {len(bad)} | {len(bad) - len(rest)} | {unsaid} | {warned} of {len(own) - len(bad)} |")
    return "\n".join(rows)


def exam():
    """The table of the exam, written by its own script."""
    about = importlib.util.spec_from_file_location("exam_run", Path(__file__).parent / "exam/run.py")
    run = importlib.util.module_from_spec(about)
    about.loader.exec_module(run)
    return run.table(json.loads((RESULTS / "exam.json").read_text(encoding="utf-8")))


def tables():
    """Tables by the page that they stand on and their name there."""
    dysts = results_of("dysts")
    scoreboard = {
        "odebench": odebench.table(results_of("odebench")),
        "mdbench": mdbench.table(results_of("mdbench")),
        "dysts": dysts_systems.table(dysts, [m for m in dysts_systems.METHODS if any(m == line["method"] for line in dysts)]),
        "nonlinear": nonlinear.table(results_of("nonlinear")),
        "silent": silent(),
    }
    return {"scoreboard.md": scoreboard, "exam.md": {"exam": exam()}}


def drawn(name, page, tables):
    """The page with the tables of the results in their places."""
    for table_name, table in tables.items():
        mark = f"<!-- {table_name} -->"
        if page.count(mark) != 1:
            raise SystemExit(f"{name}: expected `{mark}` once, found it {page.count(mark)} times")
        page = re.sub(rf"{mark}\n.*?<!-- end -->", lambda _, t=table, m=mark: f"{m}\n\n{t}\n\n<!-- end -->", page, flags=re.DOTALL)
    return page


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="only compare")
    asked = parser.parse_args()
    for name, of_page in tables().items():
        page = (DOCS / name).read_text(encoding="utf-8")
        new = drawn(name, page, of_page)
        if asked.check and new != page:
            sys.exit(f"{name} is not what the results say; run benches/public/page.py")
        if not asked.check:
            (DOCS / name).write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
