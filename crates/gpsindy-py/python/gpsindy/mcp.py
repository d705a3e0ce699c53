"""A server of the Model Context Protocol: an assistant inspects logs, diagnoses a simulator and looks words up.

Started by an assistant's program as ``gpsindy-mcp``, ``gpsindy mcp`` or ``python -m gpsindy.mcp``; it talks over standard input and
output. Needs ``pip install 'gpsindy[mcp]'``. It reads the files that a call names and writes only into the folder that a call names.
"""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gpsindy
from gpsindy import _gpsindy

if TYPE_CHECKING:
    from mcp.server import MCPServer

#: What the verdicts mean, in one sentence each; the documentation has a page on it.
VERDICTS = {
    "no_gap": "The model and noise explain the logs; random disturbances count as noise. Nothing to correct.",
    "explained": "With the included causes every logged column is predicted on held-out runs as well as its noise allows, and their "
    "sizes agree between runs. The augmented model can be used.",
    "partly_explained": "Causes are named, but structure is left or their sizes disagree between parts of the logs. What is named may "
    "stand in for something else: run the experiment that the report asks for.",
    "unexplained": "No effect of the catalogue explains a material part of the gap. Look at where it lies, or add an effect of your own.",
}

INSTRUCTIONS = (
    "gpsindy says where a simulator differs from the logs of the real machine, which physical effect causes it, and how sure that is. "
    "Inspect the logs first: the findings say what would spoil a diagnosis. Then diagnose, and tell the verdict with its probabilities "
    "and its notes as they are; a cause that has equivalents is not settled before the experiment that the report names. "
    "Explain looks up an effect, a verdict, or a report.json on disk."
)


def inspect(log: str, time: str | None = None, run: str | None = None) -> dict[str, Any]:
    """What a log holds (CSV, MCAP, Parquet, ULog, LeRobot or ROS 2 bag folder), and what in it would spoil an identification.

    ``time`` and ``run`` name the time column of a table and the column that tells its runs apart. Returns topics with their columns,
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
    """Where a simulator (a model file) differs from logs of the machine, and which physical effect causes it.

    ``run`` is the column that tells runs apart; ``map`` says where a column comes from in a log of topics, such as
    {"q": "/joint_states.position[elbow]"}; ``effects`` limits the suspects to these ids; ``time_limit`` is in seconds. With ``out``, a
    folder, report.json, report.html and augmented.toml are written there. Returns the summary for people, the report, and the
    corrected model.
    """
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


def explain(what: str) -> str:
    """What an effect of the catalogue is (its id, such as coulomb_friction), what a verdict means, or what a report.json says.

    Without a match it lists what there is.
    """
    if what in VERDICTS:
        return f"{what}: {VERDICTS[what]}"
    for effect in gpsindy.effects():
        if effect.id == what:
            twins = "".join(f"\n- {twin}: {experiment}" for twin, experiment in effect.twins)
            apart = f"\nWhat logs may not tell from it, and the experiment that parts the two:{twins}" if twins else ""
            return (
                f"{effect.name} ({effect.id}): {effect.meaning}\nForm: {effect.form}\nIts numbers: {effect.parameters}\n"
                f"In a log: {effect.signature}{apart}"
            )
    path = pathlib.Path(what)
    if path.name.endswith(".json") and path.is_file():
        return str(_gpsindy.summary(path.read_text(encoding="utf-8"), 100, False))
    known = ", ".join(effect.id for effect in gpsindy.effects())
    return f"nothing is called {what!r}. Verdicts: {', '.join(VERDICTS)}. Effects: {known}. Or the path of a report.json."


def server() -> MCPServer:
    """The server with its three tools."""
    try:
        from mcp.server import MCPServer
        from mcp.server.mcpserver.exceptions import ToolError
    except ImportError as missing:
        raise ImportError("the server needs the package mcp: pip install 'gpsindy[mcp]'") from missing
    made = MCPServer("gpsindy", instructions=INSTRUCTIONS, version=gpsindy.__version__, log_level="ERROR")

    def told(tool: Callable[..., Any]) -> Callable[..., Any]:
        # The library keeps to itself what it does not expect; what is wrong with the input the assistant must read.
        @functools.wraps(tool)
        def call(*values: Any, **named: Any) -> Any:
            try:
                return tool(*values, **named)
            except (OSError, ValueError, gpsindy.NumericalError) as failure:
                raise ToolError(str(failure)) from failure

        return call

    for tool in (inspect, diagnose, explain):
        made.add_tool(told(tool))
    return made


def main() -> None:
    """Serves over standard input and output until the other side closes."""
    server().run("stdio")


if __name__ == "__main__":
    main()
