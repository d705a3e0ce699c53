"""A fleet of drawn sliders: lost workers, speed-up, overhead, memory, and what a larger fleet would take.

    cargo xtask python
    target/venv/bin/python benches/fleet.py loss          # 200 tasks, a worker killed every five seconds
    target/venv/bin/python benches/fleet.py speed         # one process beside two, in turns
    target/venv/bin/python benches/fleet.py collect       # memory and time of the comparison of 10,000 reports
    target/venv/bin/python benches/fleet.py table         # rows and units against time and memory
    target/venv/bin/python benches/fleet.py odd           # odd units found from logs, by how far off they are
    target/venv/bin/python benches/fleet.py wear          # wear dated from logs of a year, and alarms without wear

`loss` runs the fleet in one process, on dask with four worker processes, on a process pool of four, each with a worker killed by signal 9
every five seconds, and once more after its coordinator was killed half-way. It fails unless every report is byte for byte that of the
first run. `--size` makes the tasks slower or faster (samples of a run), `--units` more or fewer.

`speed` prints elapsed and processor time of pairs of runs, and the overhead of a task: the time of a second run, in which every report is
there already. Say what else the machine did; the load average stands in the output. Needs `distributed` and `fsspec`, which the
environment of `cargo xtask python` has.
"""

from __future__ import annotations

import argparse
import datetime
import os
import pathlib
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from multiprocessing import get_context

import numpy as np

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

SUSPECTS = ["quadratic_drag", "bias", "viscous_friction", "coulomb_friction"]


def log(path: pathlib.Path, drag: float, size: int, random: np.random.Generator, noise: float = 0.004) -> None:
    """Four runs of a slider with a drag that the model lacks."""
    t = np.linspace(0, 3, size)
    decay = np.exp(-0.2 * t)
    table = []
    for run, start in enumerate((1.5, 2.5, 3.0, 2.0)):
        v = start * decay / (1 + start * drag / 0.2 * (1 - decay)) + noise * random.standard_normal(size)
        table.append(np.column_stack([np.full(size, run), t, v]))
    np.savetxt(path, np.concatenate(table), delimiter=",", header="run,t,v", comments="", fmt=["%d", "%.5f", "%.5f"])


def draw(folder: pathlib.Path, units: int, size: int) -> pathlib.Path:
    """Sliders with a drag of 0.3 +- 0.03; every fortieth has twice as much."""
    folder.mkdir(parents=True)
    (folder / "slider.toml").write_text(SLIDER)
    rows = ["unit,logs,model"]
    for unit in range(units):
        random = np.random.default_rng([16, unit])
        drag = 0.6 if unit % 40 == 39 else 0.3 + 0.03 * random.standard_normal()
        log(folder / f"unit_{unit:06}.csv", drag, size, random)
        rows.append(f"s{unit},unit_{unit:06}.csv,slider.toml")
    (folder / "fleet.csv").write_text("\n".join(rows) + "\n")
    return folder / "fleet.csv"


def draw_odd(folder: pathlib.Path, seed: int, off: float) -> pathlib.Path:
    """200 sliders of spread 0.03, of which the first five are off by so many spreads."""
    folder.mkdir(parents=True)
    (folder / "slider.toml").write_text(SLIDER)
    random = np.random.default_rng([17, seed])
    rows = ["unit,logs,model"]
    for unit in range(200):
        drag = 0.3 + 0.03 * (off if unit < 5 else random.standard_normal())
        log(folder / f"unit_{unit:06}.csv", drag, 61, random)
        rows.append(f"s{unit},unit_{unit:06}.csv,slider.toml")
    (folder / "fleet.csv").write_text("\n".join(rows) + "\n")
    return folder / "fleet.csv"


def draw_year(folder: pathlib.Path, seed: int, units: int, wear: float) -> pathlib.Path:
    """A year of fortnights: the drag follows temperature and load; that of the first unit rises by a share of itself at mid-year."""
    folder.mkdir(parents=True)
    (folder / "slider.toml").write_text(SLIDER)
    random = np.random.default_rng([18, seed])
    rows = ["unit,logs,model,since,temperature,load"]
    for unit in range(units):
        own, phase = 0.3 + 0.015 * random.standard_normal(), random.uniform()
        for k in range(26):
            day = 14 * k
            temperature = 20 + 8 * np.sin(2 * np.pi * (day / 365 + 0.1 * phase)) + random.standard_normal()
            load = 1 + 2 * random.uniform()
            worn = own * wear if unit == 0 and day >= 180 else 0.0
            drag = own + worn - 0.006 * (temperature - 20) + 0.03 * (load - 2) + 0.006 * random.standard_normal()
            name = f"unit_{unit:03}_{k:02}.csv"
            log(folder / name, drag, 61, random)
            date = datetime.date(2026, 1, 5) + datetime.timedelta(days=day)
            rows.append(f"s{unit},{name},slider.toml,{date},{temperature:.2f},{load:.2f}")
    (folder / "fleet.csv").write_text("\n".join(rows) + "\n")
    return folder / "fleet.csv"


def odd(root: pathlib.Path, fleets: int) -> None:
    print("| off by, spreads | found | false | fleets with a false one |\n| --- | --- | --- | --- |")
    for off in (1, 2, 3, 4, 5, 6):
        found = wrong = alarms = 0
        for seed in range(fleets):
            folder = root / f"{off}_{seed}"
            names = [entry["unit"] for entry in diagnose(draw_odd(folder, seed, off), folder / "out").odd]
            right = len({f"s{unit}" for unit in range(5)}.intersection(names))
            found, wrong, alarms = found + right, wrong + len(names) - right, alarms + (len(names) > right)
            shutil.rmtree(folder)
        print(f"| {off} | {found} of {5 * fleets} | {wrong} | {alarms} of {fleets} |", flush=True)


def wear(root: pathlib.Path, fleets: int, units: int = 20) -> None:
    begun = (datetime.date(2026, 1, 5) + datetime.timedelta(days=180)).toordinal()
    dated = named = alarms = 0
    for seed in range(fleets):
        folder = root / f"wear_{seed}"
        changes = diagnose(draw_year(folder, seed, units, 0.2), folder / "out").changes
        shutil.rmtree(folder)
        own = [change for change in changes if change["unit"] == "s0" and change["effect"] == "quadratic_drag"]
        named += bool(own)
        dated += bool(own) and abs(datetime.date.fromisoformat(own[0]["date"]).toordinal() - begun) <= 30
        folder = root / f"none_{seed}"
        alarms += bool(diagnose(draw_year(folder, 1000 + seed, units, 0.0), folder / "out").changes)
        shutil.rmtree(folder)
        print(f"{seed + 1} fleets of {units}: wear named {named}, within 30 days {dated}; alarms without wear {alarms}", flush=True)


def diagnose(manifest: pathlib.Path, out: pathlib.Path, executor: Executor | Callable[[], Executor] | None = None) -> gpsindy.Fleet:
    return gpsindy.fleet(manifest, out=out, executor=executor, effects=SUSPECTS, run="run")


def reports(out: pathlib.Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in out.glob("tasks/*/report.json")}


def pool(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


@contextmanager
def killer(workers: Callable[[], list[int]], seconds: float) -> Iterator[list[int]]:
    """Kills one of the workers, which this script started, every so many seconds; the list of those killed."""
    over, killed = threading.Event(), []

    def work() -> None:
        while not over.wait(seconds):
            alive = workers()
            if alive:
                os.kill(alive[len(killed) % len(alive)], signal.SIGKILL)
                killed.append(alive[len(killed) % len(alive)])

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield killed
    finally:
        over.set()
        thread.join()


def check(name: str, out: pathlib.Path, expected: dict[str, bytes], begin: float, killed: list[int]) -> None:
    found = reports(out)
    same = sum(found.get(key) == report for key, report in expected.items())
    print(f"{name:30} {time.perf_counter() - begin:7.1f} s  {len(killed):3} killed  {same} of {len(expected)} reports equal", flush=True)
    if found != expected:
        sys.exit(f"{name}: reports differ")


def loss(root: pathlib.Path, units: int, size: int, every: float) -> None:
    from distributed import Client, LocalCluster

    manifest = draw(root / "logs", units, size)
    begin = time.perf_counter()
    diagnose(manifest, root / "serial")
    expected = reports(root / "serial")
    check("one process", root / "serial", expected, begin, [])
    begin = time.perf_counter()
    with LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:

        def workers() -> list[int]:
            return [nanny.pid for nanny in cluster.workers.values() if nanny.pid]

        with killer(workers, every) as killed:
            diagnose(manifest, root / "dask", client.get_executor())
    check("dask, four workers", root / "dask", expected, begin, killed)
    begin = time.perf_counter()
    pools: list[ProcessPoolExecutor] = []

    def fresh() -> ProcessPoolExecutor:
        pools.append(pool(4))
        return pools[-1]

    with killer(lambda: list(getattr(pools[-1], "_processes", None) or {}) if pools else [], every) as killed:
        diagnose(manifest, root / "pool", fresh)
    check("process pool, four workers", root / "pool", expected, begin, killed)
    begin = time.perf_counter()
    line = [sys.executable, __file__, "run", str(manifest), str(root / "killed")]
    coordinator = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    while len(reports(root / "killed")) < units // 2:
        time.sleep(0.05)
    coordinator.kill()
    coordinator.wait()
    stamps = {path: path.stat().st_mtime_ns for path in (root / "killed").glob("tasks/*/report.json")}
    diagnose(manifest, root / "killed", fresh)
    check("coordinator killed half-way", root / "killed", expected, begin, [coordinator.pid])
    again = sum(path.stat().st_mtime_ns != stamp for path, stamp in stamps.items())
    print(f"  {len(stamps)} reports were there, {again} of them made again")
    if again:
        sys.exit("the second run repeated work")


def load() -> str:
    return " ".join(f"{value:.1f}" for value in os.getloadavg())


def once(manifest: pathlib.Path, out: pathlib.Path, workers: int) -> tuple[float, float]:
    """Elapsed and processor time of a run in a process of its own."""
    line = [sys.executable, __file__, "run", str(manifest), str(out), "--workers", str(workers)]
    begin = time.perf_counter()
    child = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status:
        sys.exit("a run failed")
    return time.perf_counter() - begin, usage.ru_utime + usage.ru_stime


def speed(root: pathlib.Path, units: int, size: int, repeats: int) -> None:
    manifest = draw(root / "logs", units, size)
    ratios = []
    for turn in range(repeats):
        one, two = (once(manifest, root / f"{workers}_{turn}", workers) for workers in (1, 2))
        ratios.append(one[0] / two[0])
        print(f"one worker {one[0]:6.1f} s ({one[1]:.1f} s of processor), two {two[0]:6.1f} s ({two[1]:.1f} s): {ratios[-1]:.2f}, load {load()}")
    print(f"speed-up on two workers: median {statistics.median(ratios):.2f}, best {max(ratios):.2f}")
    for name, workers in (("one process", 0), ("a pool of two", 2)):
        elapsed = once(manifest, root / "1_0", workers)[0]
        print(f"second run, {name}: {1e3 * elapsed / units:.1f} ms a task, with the start of Python and of the workers")


def collect(root: pathlib.Path, count: int) -> None:
    """The comparison of so many reports: those of a few units, under the keys of many."""
    manifest = draw(root / "logs", 40, 61)
    diagnose(manifest, root / "few")
    texts = [path.read_text() for path in sorted((root / "few").glob("tasks/*/report.json"))]
    rows = ["unit,logs,model", *(f"s{unit},unit_{unit % 40:06}.csv,slider.toml" for unit in range(count))]
    (root / "logs" / "many.csv").write_text("\n".join(rows) + "\n")
    for unit in range(count):
        folder = root / "many" / "tasks" / f"{unit:032x}"
        folder.mkdir(parents=True)
        (folder / "report.json").write_text(texts[unit % 40])
    line = [sys.executable, __file__, "compare", str(root / "logs" / "many.csv"), str(root / "many")]
    begin = time.perf_counter()
    child = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    size = sum(map(len, texts)) / len(texts)
    page = (root / "many" / "fleet.html").stat().st_size
    print(
        f"{count} reports of {size / 1e3:.0f} kB: {time.perf_counter() - begin:.1f} s, {usage.ru_maxrss / 1024:.0f} MB, "
        f"page {page / 1e6:.1f} MB, status {status}, load {load()}",
        flush=True,
    )


def table(root: pathlib.Path) -> None:
    print("| rows a unit | units | elapsed, s | processor a unit, s | largest memory, MB |\n| --- | --- | --- | --- | --- |")
    for size, units in ((61, 10), (61, 100), (61, 1000), (610, 10), (610, 100), (6100, 10), (6100, 40)):
        folder = root / f"{size}_{units}"
        manifest = draw(folder / "logs", units, size)
        line = [sys.executable, __file__, "run", str(manifest), str(folder / "out"), "--workers", "0"]
        begin = time.perf_counter()
        child = subprocess.Popen(line, stdout=subprocess.DEVNULL)
        _, _, usage = os.wait4(child.pid, 0)
        elapsed, processor = time.perf_counter() - begin, (usage.ru_utime + usage.ru_stime) / units
        print(f"| {4 * size} | {units} | {elapsed:.1f} | {processor:.3f} | {usage.ru_maxrss / 1024:.0f} |", flush=True)
        shutil.rmtree(folder)
    print(f"load {load()}")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=["loss", "speed", "collect", "table", "odd", "wear", "run", "compare"])
    options.add_argument("places", nargs="*", help=argparse.SUPPRESS)
    options.add_argument("--units", type=int, default=200)
    options.add_argument("--size", type=int, default=61)
    options.add_argument("--every", type=float, default=5.0, help="seconds between two workers killed")
    options.add_argument("--repeats", type=int, default=5)
    options.add_argument("--reports", type=int, default=10_000)
    options.add_argument("--fleets", type=int, default=20)
    options.add_argument("--workers", type=int, default=0, help=argparse.SUPPRESS)
    found = options.parse_args()
    if found.what == "run":
        manifest, out = map(pathlib.Path, found.places)
        # A pool that is left open is closed by two threads at once when Python ends.
        with pool(found.workers) if found.workers else nullcontext() as executor:
            diagnose(manifest, out, executor)
        return
    if found.what == "compare":
        from gpsindy._gpsindy import FleetManifest

        manifest, out = found.places
        entries = FleetManifest(manifest)
        print(len(entries.compare([(f"{k:032x}", None) for k in range(len(entries.tasks()))], out)))
        return
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        match found.what:
            case "loss":
                loss(root, found.units, found.size, found.every)
            case "speed":
                speed(root, found.units, found.size, found.repeats)
            case "collect":
                collect(root, found.reports)
            case "table":
                table(root)
            case "odd":
                odd(root, found.fleets)
            case "wear":
                wear(root, found.fleets)


if __name__ == "__main__":
    main()
