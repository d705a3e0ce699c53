"""The wheel's own command: the same program as the binary, with MuJoCo models and FMUs."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import gpsindy
from hinge import HINGE, SERVO, real_log
from program import command, write_log


def test_it_is_the_one_program_with_its_exit_statuses(tmp_path):
    version = command("--version")
    assert (version.returncode, version.stdout.split()) == (0, ["gpsindy", gpsindy.__version__])
    wrong = command("simulat")
    assert wrong.returncode == 2 and wrong.stdout == "" and wrong.stderr.startswith("error: ")
    missing = command("score", tmp_path / "none.toml", "--data", tmp_path / "none.csv")
    assert missing.returncode == 2 and "none.toml" in missing.stderr
    effects = command("effects", "--json")
    assert effects.returncode == 0 and len(json.loads(effects.stdout)) == len(gpsindy.effects())


def test_the_wheel_installs_the_command():
    from importlib.metadata import entry_points

    found = [entry for entry in entry_points(group="console_scripts") if entry.name == "gpsindy"]
    assert [entry.value for entry in found] == ["gpsindy.__main__:main"]


def test_a_mujoco_model_goes_in_and_a_corrected_one_comes_out(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    model = tmp_path / "robot.xml"
    model.write_text(HINGE)
    logs = []
    for seed in range(3):
        logs.append(tmp_path / f"run_{seed}.csv")
        write_log(logs[-1], real_log(seed, dof_frictionloss=0.15))
    out = tmp_path / "diagnosis"
    done = command("diagnose", model, *logs, "--effects", "coulomb_friction,bias", "--hold", "zero", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "report.html" in done.stdout
    report = json.loads((out / "report.json").read_text())
    assert report["augmented_model"] == "augmented.xml"
    assert [(c["effect"], c["place"]) for c in report["causes"] if c["included"]] == [("coulomb_friction", "hinge_torque")]
    corrected = mujoco.MjModel.from_xml_path(os.fspath(out / "augmented.xml"))
    assert abs(corrected.dof_frictionloss[0] - 0.15) < 0.01
    page = (out / "report.html").read_text()
    assert "+      &lt;joint name=" in page and "frictionloss" in page
    ranges = {}
    exec((out / "randomization.py").read_text(), ranges)
    low, high = ranges["IDENTIFIED"]["hinge.frictionloss"]
    assert low < 0.15 < high
    # The corrected model is again a simulator; a second run into the same folder may overwrite what the first one wrote.
    scored = command("score", model, out / "augmented.xml", "--data", logs[2], "--json")
    assert scored.returncode == 0, scored.stderr
    nominal, better = (one["rollout"]["pooled"] for one in json.loads(scored.stdout)["models"])
    assert better < 0.5 * nominal
    again = command("diagnose", model, *logs, "--effects", "coulomb_friction", "--hold", "zero", "--out", out, "--fail-if", "gap")
    assert again.returncode == 3 and "verdict" in again.stderr


def test_what_is_missing_is_told_in_one_line(tmp_path):
    (tmp_path / "robot.xml").write_text(HINGE)
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody></mujoco>")
    (tmp_path / "run.csv").write_text("t,hinge,drive\n0,0,0\n1,0,0\n")
    # A module of that name that cannot be imported stands for a package that is not there.
    (tmp_path / "hidden" / "mujoco").mkdir(parents=True)
    (tmp_path / "hidden" / "mujoco" / "__init__.py").write_text("raise ImportError")
    stated = command("diagnose", "robot.xml", "run.csv", folder=tmp_path, PYTHONPATH=os.fspath(tmp_path / "hidden"))
    assert stated.returncode == 2 and stated.stderr.count("\n") == 1
    assert "pip install 'gpsindy[mujoco]'" in stated.stderr
    pytest.importorskip("mujoco")
    broken = command("diagnose", "broken.xml", "run.csv", folder=tmp_path)
    assert broken.returncode == 2 and broken.stderr.startswith("error: broken.xml: a MuJoCo model")


def test_degrees_are_not_read_as_radians(tmp_path):
    pytest.importorskip("mujoco")
    model, log = tmp_path / "robot.xml", tmp_path / "run.csv"
    model.write_text(HINGE)
    write_log(log, real_log(0))
    header, rows = log.read_text().split("\n", 1)
    log.write_text(header.replace("hinge", "hinge [deg]", 1) + "\n" + rows)
    done = command("diagnose", model, log, "--out", tmp_path / "diagnosis")
    assert done.returncode == 2 and "0.017453" in done.stderr.strip().splitlines()[-1], done.stderr


def test_readings_beyond_a_full_turn_without_a_unit_are_doubted_and_columns_are_listed_once(tmp_path):
    pytest.importorskip("mujoco")
    model = tmp_path / "robot.xml"
    model.write_text(SERVO)
    log = real_log(0, SERVO)
    write_log(tmp_path / "rad.csv", log)
    write_log(tmp_path / "check.csv", real_log(1, SERVO))
    write_log(tmp_path / "deg.csv", {name: np.degrees(column) if name == "hinge" else column for name, column in log.items()})

    def said(train):
        options = ("--holdout", tmp_path / "check.csv", "--effects", "bias", "--time-limit", "5", "--out", tmp_path / "diagnosis")
        return command("diagnose", model, tmp_path / train, *options).stderr

    assert "multiply them by pi/180" in said("deg.csv")
    right = said("rad.csv")
    assert "pi/180" not in right and right.count("column of the logs") == 1, right


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_it_at_once():
    import signal
    import time

    line = [sys.executable, "-m", "gpsindy", "smooth", "-"]
    process = subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    # It waits for standard input; the interpreter needs a moment to start.
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10) == -signal.SIGINT
