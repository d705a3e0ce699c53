"""Results of the public sets: a line of JSON a job, and runs that go on where they were interrupted."""

from __future__ import annotations

import json


def lines_of(path):
    """The lines of a file of results; none where there is no file yet."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def carried_on(path, jobs, run):
    """Runs the jobs that the file lacks, adds a line for each, and gives all lines.

    A job is a dict of what tells it from the others, and what `run` gets beside; `run(about, *beside)` gives the rest of its line.
    """
    lines = lines_of(path)
    for about, *beside in jobs:
        if any(about.items() <= line.items() for line in lines):
            continue
        lines.append({**about, **run(about, *beside)})
        with path.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(lines[-1]) + "\n")
    return lines
