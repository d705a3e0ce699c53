"""Writes the tables of docs/scoreboard.md from the results that are kept in benches/public/results.

    python benches/public/page.py [--check]

A results file is the `--out` of its script: a line a job. What stands between `<!-- NAME -->` and `<!-- end -->` on the page is
replaced by the table of NAME; with `--check` nothing is written, and the status is 1 where the page is not what would be written.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import dysts_systems
import jobs
import mdbench
import nonlinear
import odebench

RESULTS = Path(__file__).with_name("results")
PAGE = Path(__file__).parents[2] / "docs/scoreboard.md"


def results_of(name):
    return jobs.lines_of(RESULTS / f"{name}.jsonl")


def is_worse_than_the_mean(set_name, line):
    """Whether a model predicts data that a user would hold out worse than their mean does; a rollout that diverges is."""
    if set_name == "odebench":
        return (line["generalisation"] if line["generalisation"] is not None else -1.0) < 0
    if set_name == "mdbench":
        return line["nmse"] is None or line["nmse"] > 1
    return line["error"] is None or line["error"] > line["mean"]


def is_silent(set_name, line):
    """Whether gpsindy ended well and said nothing of the result."""
    if set_name == "nonlinear":
        # The remark that a velocity is not logged is about the input.
        return line["status"] == 0 and all("is not in the logs" in note for note in line["notes"])
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
    for name in ("odebench", "mdbench", "nonlinear"):
        lines = results_of(name)
        own = [line for line in lines if line["method"] == "gpsindy"]
        bad = [line for line in own if is_worse_than_the_mean(name, line)]
        rest = [line for line in bad if not is_beyond_reach(name, line, lines)]
        unsaid = sum(is_silent(name, line) for line in rest)
        warned = sum(not is_silent(name, line) for line in own if line not in bad)
        rows.append(f"| {name} | {len(own)} | {len(bad)} | {len(bad) - len(rest)} | {unsaid} | {warned} of {len(own) - len(bad)} |")
    return "\n".join(rows)


def tables():
    dysts = results_of("dysts")
    return {
        "odebench": odebench.table(results_of("odebench")),
        "mdbench": mdbench.table(results_of("mdbench")),
        "dysts": dysts_systems.table(dysts, [m for m in dysts_systems.METHODS if any(m == line["method"] for line in dysts)]),
        "nonlinear": nonlinear.table(results_of("nonlinear")),
        "silent": silent(),
    }


def drawn(page):
    """The page with the tables of the results in their places."""
    for name, table in tables().items():
        mark = f"<!-- {name} -->"
        if page.count(mark) != 1:
            raise SystemExit(f"{PAGE.name}: expected `{mark}` once, found it {page.count(mark)} times")
        page = re.sub(rf"{mark}\n.*?<!-- end -->", lambda _, t=table, m=mark: f"{m}\n\n{t}\n\n<!-- end -->", page, flags=re.DOTALL)
    return page


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="only compare")
    asked = parser.parse_args()
    page = PAGE.read_text(encoding="utf-8")
    new = drawn(page)
    if asked.check:
        if new != page:
            sys.exit(f"{PAGE.name} is not what the results say; run benches/public/page.py")
    else:
        PAGE.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
