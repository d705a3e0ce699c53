"""A fleet on one process, on a pool, and on a pool whose workers die."""

import json
import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import gpsindy

SLIDER = """
schema = "gpsindy.model/1"
name = "slider"
[[state]]
name = "v"
unit = "m/s"
equation = "-b*v"
[[parameter]]
name = "b"
value = 0.2
"""


def make(folder: Path, units: int) -> Path:
    """Sliders with a drag of 0.3 that the model lacks; the last unit has twice as much."""
    (folder / "slider.toml").write_text(SLIDER)
    t = np.linspace(0, 3, 61)
    rows = ["unit,logs,model"]
    for unit in range(units):
        drag = 0.6 if unit == units - 1 else 0.3 + 0.002 * (unit % 5)
        random = np.random.default_rng(unit)
        names = []
        for run, start in enumerate((1.5, 2.5, 3.0, 2.0)):
            decay = np.exp(-0.2 * t)
            v = start * decay / (1 + start * drag / 0.2 * (1 - decay)) + 0.004 * random.standard_normal(t.size)
            name = f"unit_{unit}_{run}.csv"
            np.savetxt(folder / name, np.column_stack([t, v]), delimiter=",", header="t,v", comments="")
            names.append(name)
        rows.append(f"s{unit},{';'.join(names)},slider.toml")
    (folder / "fleet.csv").write_text("\n".join(rows) + "\n")
    return folder / "fleet.csv"


def reports(folder: Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in folder.glob("tasks/*/report.json")}


SUSPECTS = ["quadratic_drag", "bias"]


def pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(2, mp_context=get_context("spawn"))


def test_reports_are_the_same_bytes_on_one_process_on_threads_and_on_processes(tmp_path: Path) -> None:
    manifest = make(tmp_path, 6)
    serial = gpsindy.fleet(manifest, out=tmp_path / "serial", effects=SUSPECTS)
    assert [entry["unit"] for entry in serial.odd] == ["s5"]
    assert len(serial.units) == 6 and not serial.failed
    with ThreadPoolExecutor(2) as threads:
        gpsindy.fleet(manifest, out=tmp_path / "threads", effects=SUSPECTS, executor=threads)
    gpsindy.fleet(manifest, out=tmp_path / "processes", effects=SUSPECTS, executor=pool)
    expected = reports(tmp_path / "serial")
    assert len(expected) == 6
    assert reports(tmp_path / "threads") == expected
    assert reports(tmp_path / "processes") == expected
    one = json.loads((tmp_path / "serial" / "fleet.json").read_text())
    assert one == json.loads((tmp_path / "processes" / "fleet.json").read_text())


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that can't be caught")
def test_every_report_is_there_although_workers_are_killed(tmp_path: Path) -> None:
    manifest = make(tmp_path, 12)
    pools: list[ProcessPoolExecutor] = []

    def fresh() -> ProcessPoolExecutor:
        pools.append(pool())
        return pools[-1]

    over, killed = threading.Event(), []

    def kill() -> None:
        while not over.wait(1.5):
            # The newest pool's workers are processes that this test started.
            for worker in list(getattr(pools[-1], "_processes", None) or {}) if pools else []:
                os.kill(worker, signal.SIGKILL)
                killed.append(worker)
                break
            if len(killed) >= 2:
                return

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        found = gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS, executor=fresh)
    finally:
        over.set()
        killer.join()
    assert len(found.units) == 12
    serial = gpsindy.fleet(manifest, out=tmp_path / "serial", effects=SUSPECTS)
    assert reports(tmp_path / "out") == reports(tmp_path / "serial")
    assert len(serial.units) == 12


def test_a_second_call_does_only_what_is_missing(tmp_path: Path) -> None:
    manifest = make(tmp_path, 3)
    out = tmp_path / "out"
    gpsindy.fleet(manifest, out=out, effects=SUSPECTS)
    first, second = sorted(out.glob("tasks/*/report.json"))[:2]
    stamp = second.stat().st_mtime_ns
    first.unlink()
    time.sleep(0.02)
    steps: list[tuple[int, int]] = []
    gpsindy.fleet(manifest, out=out, effects=SUSPECTS, progress=lambda done, total: steps.append((done, total)))
    assert first.exists() and second.stat().st_mtime_ns == stamp
    assert steps[-1] == (3, 3)


def test_a_unit_without_logs_is_data_and_not_the_end(tmp_path: Path) -> None:
    manifest = make(tmp_path, 3)
    (tmp_path / "unit_1_2.csv").unlink()
    found = gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS)
    assert [entry["unit"] for entry in found.failed] == ["s1"]
    assert "unit_1_2.csv" in found.failed[0]["error"]
    assert len(found.units) == 2
    assert "failed=1" in repr(found)


def test_a_manifest_that_says_nothing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "fleet.csv").write_text("unit,logs,model\n")
    with pytest.raises(ValueError, match="no unit"):
        gpsindy.fleet(tmp_path / "fleet.csv", out=tmp_path / "out")
