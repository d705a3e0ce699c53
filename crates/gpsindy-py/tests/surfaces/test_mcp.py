"""The server for assistants, through the client of the same library, over a pipe as a program would start it."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys

import pytest

import gpsindy
from conftest import CART, oscillator

mcp = pytest.importorskip("mcp")


def call(folder, *calls):
    """The results of calls to a server of its own, which may use one folder."""
    from mcp import Client
    from mcp.client.stdio import StdioServerParameters

    async def talk():
        start = StdioServerParameters(command=sys.executable, args=["-m", "gpsindy.mcp", str(folder)], env=dict(os.environ))
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
        folder,
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


def test_a_wrong_file_is_an_error_that_says_which(tmp_path):
    _, (result,) = call(tmp_path, ("inspect", {"log": str(tmp_path / "absent.csv")}))
    assert result.is_error and "absent.csv: cannot be read: there is no such file" in text(result)


def test_a_simulator_that_steps_is_refused_in_a_line(folder):
    (folder / "robot.xml").write_text("<mujoco/>", encoding="utf-8")
    (folder / "plant.fmu").write_bytes(b"PK\x03\x04more")
    log = str(folder / "log.csv")
    models = [(str(folder / "robot.xml"), "a MuJoCo model"), (str(folder / "plant.fmu"), "an FMU")]
    _, results = call(folder, *(("diagnose", {"model": model, "logs": [log]}) for model, _ in models))
    for result, (model, kind) in zip(results, models):
        assert result.is_error and f"{model}: {kind}; this server takes equations" in text(result), text(result)
        assert text(result).endswith("run gpsindy diagnose on the command line"), text(result)


SECRET = "root:x:0:0:administrator:/root"


def test_no_error_shows_what_stands_in_a_file(folder):
    for name, content in [("users", SECRET + "\n"), ("bad.csv", f"t,v\n0,1\n1,{SECRET}\n"), ("report.json", f'{{"{SECRET}": 1}}')]:
        (folder / name).write_text(content, encoding="utf-8")
    users, bad, report = (str(folder / name) for name in ("users", "bad.csv", "report.json"))
    model, log = str(folder / "cart.toml"), str(folder / "log.csv")
    (folder / "wrong.toml").write_text((folder / "cart.toml").read_text(encoding="utf-8").replace("v", SECRET), encoding="utf-8")
    _, results = call(
        folder,
        ("inspect", {"log": users}),
        ("diagnose", {"model": users, "logs": [log]}),
        ("diagnose", {"model": str(folder / "wrong.toml"), "logs": [log]}),
        ("diagnose", {"model": model, "logs": [users]}),
        ("diagnose", {"model": model, "logs": [bad]}),
        ("diagnose", {"model": model, "logs": [log], "run": "nobody"}),
        ("explain", {"what": report}),
    )
    for result in results:
        stated = text(result)
        assert result.is_error and str(folder) in stated, stated
        # The folder's own path may hold the name of whoever runs the test.
        stated = stated.replace(str(folder), "")
        assert not any(part in stated for part in ("root", "administrator", "x_0")), stated
    # What the call itself says stays.
    assert "`nobody`" in text(results[5])


def test_nothing_outside_the_folders_is_touched(folder, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside")
    (outside / "log.csv").write_text("t,v\n0,1\n1,2\n", encoding="utf-8")
    (outside / "report.json").write_text("{}", encoding="utf-8")
    (folder / "link.csv").symlink_to(outside / "log.csv")
    (folder / "linked").mkdir()
    (folder / "linked" / "report.html").symlink_to(outside / "page.html")
    log, model = str(folder / "log.csv"), str(folder / "cart.toml")
    _, results = call(
        folder,
        ("inspect", {"log": str(outside / "log.csv")}),
        ("inspect", {"log": str(folder / "link.csv")}),
        ("inspect", {"log": f"{folder}/../{outside.name}/log.csv"}),
        ("diagnose", {"model": str(outside / "model.toml"), "logs": [log]}),
        ("diagnose", {"model": model, "logs": [log, str(outside / "log.csv")]}),
        ("diagnose", {"model": model, "logs": [log], "run": "run", "effects": ["bias"], "out": str(outside)}),
        ("diagnose", {"model": model, "logs": [log], "run": "run", "effects": ["bias"], "out": str(folder / "linked")}),
        ("explain", {"what": str(outside / "report.json")}),
        # The same file by other names.
        ("explain", {"what": f"{outside}/report.json/"}),
        ("explain", {"what": f"{outside}/report.json/."}),
    )
    for result in results:
        assert result.is_error and "outside the folders that this server may use" in text(result), text(result)
    assert sorted(path.name for path in outside.iterdir()) == ["log.csv", "report.json"]


def test_a_missing_extra_or_folder_is_one_line(tmp_path):
    # A package of this name that can't be imported stands before the real one.
    (tmp_path / "mcp.py").write_text("raise ImportError('not here')\n", encoding="utf-8")
    for folder, expected in [
        (tmp_path, "error: the server needs the package mcp: pip install 'gpsindy[mcp]'\n"),
        (tmp_path / "none", f"error: {tmp_path / 'none'}: no such folder; name folders that the server may use\n"),
    ]:
        done = subprocess.run(
            [sys.executable, "-c", "from gpsindy.mcp import main; main()", str(folder)],
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stdout, done.stderr) == (2, "", expected)


@pytest.mark.parametrize("start", [["-m", "gpsindy"], [os.path.join(os.path.dirname(sys.executable), "gpsindy")]])
def test_the_command_finds_the_server_in_its_own_folder(tmp_path, start):
    # Nothing is on the PATH, and the interpreter may be a link out of its environment.
    line = [sys.executable, *start, "mcp", str(tmp_path)]
    ends = subprocess.run(line, input="", capture_output=True, text=True, env={**os.environ, "PATH": str(tmp_path)}, check=False)
    assert ends.returncode == 0, ends.stderr
    # The server of the package has its own words for a folder that is not there.
    absent = subprocess.run([*line[:-1], str(tmp_path / "none")], input="", capture_output=True, text=True, env={"PATH": ""}, check=False)
    assert absent.returncode == 2 and absent.stderr.endswith("none: no such folder; name folders that the server may use\n"), absent.stderr


def test_every_verdict_is_explained():
    from gpsindy.mcp import VERDICTS, explain

    assert set(VERDICTS) == {"no_gap", "explained", "partly_explained", "unexplained"}
    assert all(explain(verdict).startswith(f"{verdict}: ") for verdict in VERDICTS)
    assert all("In a log" in explain(effect.id) for effect in gpsindy.effects())
