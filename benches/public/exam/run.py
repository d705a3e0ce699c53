"""The public exam: draws a suite with withheld effects, lets methods diagnose it, scores them.

    python benches/public/exam/run.py --programs target/release --out out/exam [--seed-from 2000000] [--cases 20]

The suite is drawn by `gpsindy-suite` of the version that `--programs` holds; the same version and seeds give the same bytes, and the
page of the table says their SHA-256. What the table shows is kept in `--out`/exam.json; the one of the page is
benches/public/results/exam.json. The answers are moved out of the suite before any method starts. Methods: gpsindy, and the two
of `baselines.py`. What is done already is not done again. Needs numpy, scipy, gpsindy and pysindy in the Python that runs this.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from pathlib import Path

BASELINES = Path(__file__).with_name("baselines.py")
KEYS = ("right_verdict", "detected", "false_alarms", "right_cause_state", "top_1", "top_3", "several_found", "wrongly_explained")


def digest(suite):
    """SHA-256 over names and bytes of the cases, in order."""
    found = hashlib.sha256()
    for path in sorted(suite.rglob("*")):
        if path.is_file():
            found.update(path.relative_to(suite).as_posix().encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def table(kept):
    """Markdown: every rate of every method."""

    def rate(hits, of):
        return f"{hits} of {of}" if of else "-"

    rows = ["| method | " + " | ".join(key.replace("_", " ") for key in KEYS) + " |", "| --- |" + " --- |" * len(KEYS)]
    rows += [f"| {method} | " + " | ".join(rate(*card[key]) for key in KEYS) + " |" for method, card in kept["methods"].items()]
    return "\n".join(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=Path, default=Path("target/release"), help="folder of gpsindy and gpsindy-suite")
    parser.add_argument("--out", type=Path, default=Path("out/exam"))
    parser.add_argument("--seed-from", type=int, default=2_000_000)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--time-limit", type=float, default=600.0, help="s a case, for gpsindy")
    parser.add_argument("--threads", type=int, default=0, help="threads of gpsindy; 0: all")
    asked = parser.parse_args()
    gpsindy, draw = ([str(asked.programs / name)] for name in ("gpsindy", "gpsindy-suite"))
    suite, answers = asked.out / "suite", asked.out / "answers.toml"
    if not answers.exists():
        seeds = ["--seed-from", str(asked.seed_from), "--seed-to", str(asked.seed_from + asked.cases)]
        subprocess.run([*draw, "draw", *seeds, "--out", str(suite)], check=True)
        (suite / "answers.toml").rename(answers)
    print(f"suite: {asked.cases} seeds from {asked.seed_from}, SHA-256 {digest(suite)}", flush=True)
    for method in ("discrepancy", "parameters"):
        subprocess.run([sys.executable, str(BASELINES), method, str(suite), str(asked.out / method)], check=True)
    cards = {}
    score = [*gpsindy, "exam", str(suite), "--answers", str(answers), "--quiet"]
    own = asked.out / "gpsindy"
    if not (own / "scorecard.json").exists():
        threads = ["--threads", str(asked.threads)] if asked.threads else []
        limit = ["--time-limit", str(asked.time_limit)]
        subprocess.run([*score, *limit, *threads, "--out", str(own)], check=True, stdout=subprocess.DEVNULL)
    cards["gpsindy"] = json.loads((own / "scorecard.json").read_text(encoding="utf-8"))
    for method in ("discrepancy", "parameters"):
        card = asked.out / f"{method}_card"
        reports = ["--reports", str(asked.out / method), "--out", str(card)]
        subprocess.run([*score, *reports], check=True, stdout=subprocess.DEVNULL)
        cards[method] = json.loads((card / "scorecard.json").read_text(encoding="utf-8"))
    kept = {
        "seeds": [asked.seed_from, asked.seed_from + asked.cases],
        "sha256": digest(suite),
        "methods": {method: {key: [card[key]["hits"], card[key]["of"]] for key in KEYS} for method, card in cards.items()},
    }
    (asked.out / "exam.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(table(kept))


if __name__ == "__main__":
    main()
