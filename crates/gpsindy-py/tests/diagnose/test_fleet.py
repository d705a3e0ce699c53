"""A fleet on one process, on a pool, and on a pool whose workers die."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
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

    killed: list[int] = []

    def lose(done: int, _: int) -> None:
        if done >= 3 and not killed:
            # The newest pool's workers are processes that this test started.
            killed.append(next(iter(pools[-1]._processes)))
            os.kill(killed[0], signal.SIGKILL)

    found = gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS, executor=fresh, progress=lose)
    assert killed
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


def wait_for(what: Callable[[], bool], seconds: float = 120) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "not in time"
        time.sleep(0.02)


def test_a_run_whose_coordinator_was_killed_is_resumed_with_the_rest(tmp_path: Path) -> None:
    manifest = make(tmp_path, 8)
    out = tmp_path / "out"
    script = f"import gpsindy; gpsindy.fleet({str(manifest)!r}, out={str(out)!r}, effects={SUSPECTS!r})"
    coordinator = subprocess.Popen([sys.executable, "-c", script])
    try:
        wait_for(lambda: len(reports(out)) >= 3)
    finally:
        coordinator.kill()
        coordinator.wait()
    stamps = {path: path.stat().st_mtime_ns for path in out.glob("tasks/*/report.json")}
    assert 3 <= len(stamps) < 8
    gpsindy.fleet(manifest, out=out, effects=SUSPECTS)
    assert len(reports(out)) == 8
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())


def test_a_pool_that_is_handed_in_and_breaks_is_told_and_the_next_call_does_the_rest(tmp_path: Path) -> None:
    manifest = make(tmp_path, 4)

    class Breaks(ThreadPoolExecutor):
        """Does two tasks and breaks, as a process pool does when a worker dies."""

        def submit(self, task, /, *arguments, **named):  # type: ignore[no-untyped-def]
            if self._counter_of_mine >= 2:
                raise BrokenProcessPool("a worker died")
            self._counter_of_mine += 1
            return super().submit(task, *arguments, **named)

        _counter_of_mine = 0

    with Breaks(1) as executor, pytest.raises(RuntimeError, match="broke with 2 tasks left.*a function that makes an executor"):
        gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS, executor=executor)
    assert len(reports(tmp_path / "out")) == 2
    assert len(gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS).units) == 4


def test_results_go_to_any_url_and_a_second_call_finds_them(tmp_path: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    manifest = make(tmp_path, 4)
    serial = gpsindy.fleet(manifest, out=tmp_path / "serial", effects=SUSPECTS)
    memory = fsspec.filesystem("memory")
    name = f"gpsindy-{tmp_path.name}"
    url = f"memory://{name}/fleet"
    with ThreadPoolExecutor(2) as threads:
        found = gpsindy.fleet(manifest, out=url, effects=SUSPECTS, executor=threads)
    try:
        kept = {key: memory.cat_file(f"/{name}/fleet/tasks/{key}/report.json") for key in reports(tmp_path / "serial")}
        assert kept == reports(tmp_path / "serial")
        assert json.loads(memory.cat_file(f"/{name}/fleet/fleet.json")) == serial.to_dict() == found.to_dict()
        assert found.out == url
        # What is there is not made again; what is gone is.
        first, second = sorted(kept)[:2]
        memory.pipe_file(f"/{name}/fleet/tasks/{first}/report.html", b"kept")
        memory.rm_file(f"/{name}/fleet/tasks/{second}/report.json")
        gpsindy.fleet(manifest, out=url, effects=SUSPECTS)
        assert memory.cat_file(f"/{name}/fleet/tasks/{first}/report.html") == b"kept"
        assert memory.cat_file(f"/{name}/fleet/tasks/{second}/report.json") == kept[second]
    finally:
        memory.rm(f"/{name}", recursive=True)
    gpsindy.fleet(manifest, out=(tmp_path / "as url").as_uri(), effects=SUSPECTS, executor=pool)
    assert reports(tmp_path / "as url") == reports(tmp_path / "serial")


def test_a_file_system_that_writes_in_parts_shows_whole_files_only(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    manifest = make(tmp_path, 2)
    # A folder within a folder, by way of fsspec's own local files.
    url = f"dir::file://{tmp_path}/fsspec"
    found = gpsindy.fleet(manifest, out=url, effects=SUSPECTS)
    assert len(found.units) == 2
    (place,) = {path.parents[2] for path in (tmp_path / "fsspec").rglob("tasks/*/report.json")}
    assert reports(place) == reports(Path(gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS).out))
    assert not list((tmp_path / "fsspec").rglob("*.part"))


def test_a_url_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    with pytest.raises(ValueError, match="nowhere"):
        gpsindy.fleet(make(tmp_path, 1), out="nowhere://bucket/fleet")


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
