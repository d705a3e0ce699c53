"""The server for assistants, through the client of the same library, over a pipe as a program would start it."""

from __future__ import annotations

import asyncio
import json
import os
import sys

import pytest

import gpsindy
from conftest import CART, oscillator

mcp = pytest.importorskip("mcp")


def call(*calls):
    """The results of calls to a server of its own."""
    from mcp import Client
    from mcp.client.stdio import StdioServerParameters

    async def talk():
        start = StdioServerParameters(command=sys.executable, args=["-m", "gpsindy.mcp"], env=dict(os.environ))
        async with Client(start) as client:
            tools = await client.list_tools()
            return [tool.name for tool in tools.tools], [await client.call_tool(name, values) for name, values in calls]

    return asyncio.run(talk())


def text(result):
    return "".join(part.text for part in result.content)


@pytest.fixture
def folder(tmp_path):
    """A cart whose bias the model lacks: four runs in one file, and the model."""
    rows = ["run,t [s],x [m],v [m/s],u"]
    for seed in range(4):
        t, x, u = oscillator(seed)
        rows += [f"{seed},{a:.3f},{b[0] + 0.2:.5f},{b[1]:.5f},{c:.2f}" for a, b, c in zip(t, x, u)]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (tmp_path / "cart.toml").write_text(CART, encoding="utf-8")
    return tmp_path


def test_an_assistant_inspects_diagnoses_and_looks_up(folder):
    log, model, out = str(folder / "log.csv"), str(folder / "cart.toml"), str(folder / "out")
    suspects = ["bias", "sensor_bias", "viscous_friction"]
    tools, (inspected, diagnosed, effect, report, unknown) = call(
        ("inspect", {"log": log, "run": "run"}),
        ("diagnose", {"model": model, "logs": [log], "run": "run", "effects": suspects, "out": out}),
        ("explain", {"what": "coulomb_friction"}),
        ("explain", {"what": str(folder / "out" / "report.json")}),
        ("explain", {"what": "witchcraft"}),
    )
    assert sorted(tools) == ["diagnose", "explain", "inspect"]
    found = json.loads(text(inspected))
    assert found["format"] == "CSV"
    assert {"x", "v", "u"} <= {column["name"] for topic in found["topics"] for column in topic["columns"]}
    diagnosis = json.loads(text(diagnosed))
    assert diagnosis["report"]["verdict"] == "explained"
    included = [cause["effect"] for cause in diagnosis["report"]["causes"] if cause["included"]]
    assert included and set(included) <= {"bias", "sensor_bias"}
    assert gpsindy.Model.from_toml(diagnosis["augmented"]).states[0].name == "x"
    assert (folder / "out" / "report.html").is_file()
    assert "viscous_friction" in text(effect) and "coast-down" in text(effect)
    assert "explained" in text(report).lower()
    assert "nothing is called" in text(unknown) and "stiction" in text(unknown)


def test_a_wrong_file_is_an_error_that_says_which():
    _, (result,) = call(("inspect", {"log": "absent.csv"}))
    assert result.is_error and "absent.csv" in text(result)


def test_every_verdict_is_explained():
    from gpsindy.mcp import VERDICTS, explain

    assert set(VERDICTS) == {"no_gap", "explained", "partly_explained", "unexplained"}
    assert all(explain(verdict).startswith(f"{verdict}: ") for verdict in VERDICTS)
    assert all("In a log" in explain(effect.id) for effect in gpsindy.effects())
