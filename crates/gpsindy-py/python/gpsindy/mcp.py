"""A server of the Model Context Protocol: an assistant inspects logs, diagnoses a simulator and looks words up.

Started by an assistant's program as ``gpsindy-mcp FOLDER...``, ``gpsindy mcp FOLDER...`` or ``python -m gpsindy.mcp FOLDER...``; it
talks over standard input and output. Needs ``pip install 'gpsindy[mcp]'``. It reads and writes in the folders that its start names,
else in the one it is started in, and nowhere else. Its errors do not show what a file holds.
"""

from __future__ import annotations

import argparse
import functools
import inspect as signatures
import os
import pathlib
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import gpsindy
from gpsindy import _gpsindy

if TYPE_CHECKING:
    from mcp.server import MCPServer

#: What the verdicts mean, in one sentence each; the documentation has a page on it.
VERDICTS = {
    "no_gap": "The model and the noise of the sensors explain the logs, on held-out runs as well. Nothing to correct.",
    "explained": "With the included causes every logged column is predicted on held-out runs as well as its noise allows, and every "
    "check passes. The augmented model can be used.",
    "partly_explained": "Causes are named, but a check fails, none is believed enough, or the time limit ended the search. Another effect "
    "may be the true cause: run the experiment that the report asks for.",
    "unexplained": "No effect of the catalogue explains a material part of the gap. Look at where it lies, or add an effect of your own.",
}

INSTRUCTIONS = (
    "gpsindy says where a simulator differs from the logs of the real machine, which physical effect causes it, and how sure that is. "
    "Inspect the logs first: the findings say what would spoil a diagnosis. Then diagnose, and report the verdict with its probabilities "
    "and its notes as they are; a cause that has equivalents is not settled before the experiment that the report names. "
    "Explain looks up an effect, a verdict, or a report.json on disk."
)


def inspect(log: str, time: str | None = None, run: str | None = None) -> dict[str, Any]:
    """What a log holds (CSV, MCAP, Parquet, ULog, LeRobot or ROS 2 bag folder), and what in it would spoil an identification.

    ``time`` and ``run`` name the time column of a table and the column that identifies its runs. Returns topics with their columns,
    units and rates, and the findings.
    """
    found = gpsindy.inspect(log, time=time, run=run)
    return {"file": found.file, "format": found.format, "topics": found.topics, "findings": found.findings, "notes": found.notes}


def diagnose(
    model: str,
    logs: list[str],
    holdout: list[str] | None = None,
    run: str | None = None,
    time: str | None = None,
    map: dict[str, str] | None = None,
    effects: list[str] | None = None,
    out: str | None = None,
    time_limit: float = 300.0,
) -> dict[str, Any]:
    """Where a simulator (equations in a model file) differs from logs of the machine, and which physical effect causes it.

    ``run`` is the column that identifies the runs; ``map`` says where a column comes from in a log of topics, such as
    {"q": "/joint_states.position[elbow]"}; ``effects`` limits the suspects to these ids; ``time_limit`` is in seconds. With ``out``, a
    folder, report.json, report.html and augmented.toml are written there. Returns the summary for people, the report, and the
    corrected model.
    """
    if kind := _stepping(model):
        raise ValueError(
            f"{model}: {kind}; this server takes equations (TOML or JSON) only, because {kind} may load files or code from anywhere: "
            "run gpsindy diagnose on the command line"
        )
    nominal = gpsindy.Model.load(model)
    controls = [control.name for control in nominal.controls]

    def read(paths: list[str]) -> gpsindy.Dataset:
        return gpsindy.read_log(paths, map=map, controls=controls, time=time, run=run)

    found = gpsindy.diagnose(
        nominal, read(logs), read(holdout) if holdout else None, effects=effects or (), time_limit=time_limit
    )
    if out is not None:
        found.save(out)
    return {"summary": found.summary(), "report": found.to_dict(), "augmented": found.augmented.to_toml()}


def _stepping(path: str) -> str | None:
    """What a file is if it holds a simulator that steps and no equations."""
    try:
        with open(path, "rb") as file:
            begin = file.read(1024).removeprefix(b"\xef\xbb\xbf").lstrip()
    except OSError:
        return None  # Model.load says why it cannot be read.
    if begin.startswith(b"PK\x03\x04"):
        return "an FMU"
    return "a MuJoCo model" if begin.startswith(b"<") else None


def explain(what: str) -> str:
    """What an effect of the catalogue is (its id, such as coulomb_friction), what a verdict means, or what a report.json says.

    Without a match it lists what there is.
    """
    if what in VERDICTS:
        return f"{what}: {VERDICTS[what]}"
    for effect in gpsindy.effects():
        if effect.id == what:
            twins = "".join(f"\n- {twin}: {experiment}" for twin, experiment in effect.twins)
            apart = f"\nWhat logs may not distinguish from it, and the experiment that would:{twins}" if twins else ""
            return (
                f"{effect.name} ({effect.id}): {effect.meaning}\nForm: {effect.form}\nIts numbers: {effect.parameters}\n"
                f"In a log: {effect.signature}{apart}"
            )
    path = pathlib.Path(what)
    if _is_report(what) and path.is_file():
        try:
            return str(_gpsindy.summary(path.read_text(encoding="utf-8"), 100, False))
        except ValueError as failure:
            raise ValueError(f"{what}: no report of a diagnosis: {failure}") from failure
    known = ", ".join(effect.id for effect in gpsindy.effects())
    return f"nothing is called {what!r}. Verdicts: {', '.join(VERDICTS)}. Effects: {known}. Or the path of a report.json."


def _is_report(what: str) -> bool:
    """Whether a word to explain is the path of a report: the file's name says so, whatever stands behind it (`a.json/.`)."""
    return pathlib.Path(what).name.endswith(".json")


#: Arguments of the tools that are paths.
PATHS = ("log", "model", "logs", "holdout", "out")


def confined(paths: Iterable[str], folders: Sequence[pathlib.Path]) -> None:
    """Refuses a path that leads out of the folders, by ``..``, by a link, or by a link in a folder that it names."""
    for path in paths:
        given = pathlib.Path(path)
        for place in (given, *_links(given)):
            if not any(place.resolve().is_relative_to(folder) for folder in folders):
                allowed = ", ".join(str(folder) for folder in folders)
                which = path if place == given else place
                raise ValueError(
                    f"{which}: outside the folders that this server may use ({allowed}); start it with that folder as well"
                )


def _links(folder: pathlib.Path) -> list[pathlib.Path]:
    """Links where a report, a bag or a LeRobot data set has its files; none where the path is no folder."""
    if not folder.is_dir():
        return []
    inside = (folder.iterdir(), *((folder / name).rglob("*") for name in ("data", "meta")))
    return [one for part in inside for one in part if one.is_symlink()]


#: Words in quotes that are the library's own, not a file's.
OWN = frozenset({"t", "time", "timestamp", "=", "-"})


def without_content(message: str, said: Iterable[str]) -> str:
    """An error's message without what it quotes from a file; what the call itself ``said`` stays."""
    known = OWN.union(said)

    def kept(found: re.Match[str]) -> str:
        quote, words = found.group(0)[0], found.group(0)[1:-1]
        return found.group(0) if words in known or words.startswith("--") else f"{quote}...{quote}"

    message = re.sub(r"; (found|did you mean|known|there are)\b.*", "", message.split("\n")[0])
    return re.sub(r'`[^`]*`|"(?:[^"\\]|\\.)*"', kept, message)


def _words(value: Any) -> list[str]:
    """Every text in the arguments of a call."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, dict):
        return [word for pair in value.items() for word in _words(pair)]
    return [word for part in value for word in _words(part)] if isinstance(value, list | tuple) else []


def _paths(tool: Callable[..., Any], values: tuple[Any, ...], named: dict[str, Any]) -> list[str]:
    """The paths among the arguments of a call."""
    arguments = signatures.signature(tool).bind(*values, **named).arguments
    given = [arguments[name] for name in PATHS if arguments.get(name) is not None]
    if _is_report(str(arguments.get("what", ""))):
        given.append(arguments["what"])
    return [path for one in given for path in ([one] if isinstance(one, str) else one)]


def server(folders: Sequence[str | os.PathLike[str]] = (".",)) -> MCPServer:
    """The server with its three tools, which use files in ``folders`` alone."""
    allowed = [pathlib.Path(folder).resolve() for folder in folders]
    try:
        from mcp.server import MCPServer
        from mcp.server.mcpserver.exceptions import ToolError
    except ImportError as missing:
        raise ImportError("the server needs the package mcp: pip install 'gpsindy[mcp]'") from missing
    made = MCPServer("gpsindy", instructions=INSTRUCTIONS, version=gpsindy.__version__, log_level="ERROR")

    def with_errors(tool: Callable[..., Any]) -> Callable[..., Any]:
        # The library keeps to itself what it does not expect; what is wrong with the input the assistant must read.
        @functools.wraps(tool)
        def call(*values: Any, **named: Any) -> Any:
            confinement = _paths(tool, values, named)
            try:
                confined(confinement, allowed)
            except ValueError as failure:
                raise ToolError(str(failure)) from failure
            try:
                return tool(*values, **named)
            except (OSError, ValueError, gpsindy.NumericalError) as failure:
                message = without_content(str(failure), _words([values, named]))
                # The warning of what a call read is shown, too, if the error is about its content.
                is_named = any(path in message for path in confinement) or not confinement
                raise ToolError(message if is_named else f"{', '.join(confinement)}: {message}") from None

        return call

    for tool in (inspect, diagnose, explain):
        made.add_tool(with_errors(tool))
    return made


def main(line: Sequence[str] | None = None) -> None:
    """Serves over standard input and output until the other side closes."""
    parser = argparse.ArgumentParser(prog="gpsindy-mcp", description="A server of gpsindy for assistants (Model Context Protocol).")
    parser.add_argument("folders", nargs="*", default=["."], metavar="FOLDER", help="folders that it may use [default: the current one]")
    folders = parser.parse_args(line).folders
    try:
        if absent := [folder for folder in folders if not os.path.isdir(folder)]:
            raise NotADirectoryError(f"{absent[0]}: no such folder; name folders that the server may use")
        made = server(folders)
    except (ImportError, OSError) as failure:
        print(f"error: {failure}", file=sys.stderr)
        raise SystemExit(2) from None
    made.run("stdio")


if __name__ == "__main__":
    main()
