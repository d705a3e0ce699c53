"""A fleet on clusters: dask, also with workers of their own that are killed, Ray and MPI where they are installed."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import gpsindy
from test_fleet import SUSPECTS, make, reports, wait_for


def serial(manifest: Path, folder: Path) -> dict[str, bytes]:
    gpsindy.fleet(manifest, out=folder / "serial", effects=SUSPECTS)
    return reports(folder / "serial")


@contextmanager
def process(*line: str) -> Iterator[subprocess.Popen[bytes]]:
    child = subprocess.Popen([sys.executable, "-m", *line], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield child
    finally:
        child.kill()
        child.wait()


def test_workers_that_are_processes_of_their_own_may_die(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    manifest = make(tmp_path, 12)
    address = tmp_path / "scheduler.json"
    dask = "distributed.cli.dask_"
    place = ("--scheduler-file", str(address))
    with ExitStack() as stack:
        local = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        stack.enter_context(process(f"{dask}scheduler", *place, *local))
        wait_for(address.exists)

        def worker(k: int) -> subprocess.Popen[bytes]:
            folder = ("--local-directory", str(tmp_path / f"worker {k}"))
            return stack.enter_context(process(f"{dask}worker", *place, *folder, "--no-nanny", "--nthreads", "1", "--no-dashboard"))

        workers = [worker(k) for k in range(2)]
        client = stack.enter_context(distributed.Client(scheduler_file=str(address)))
        client.wait_for_workers(2, timeout=60)

        def lose(done: int, _: int) -> None:
            if done == 3:
                os.kill(workers[0].pid, signal.SIGKILL)
                workers.append(worker(2))

        found = gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS, executor=client.get_executor(), progress=lose)
        assert len(workers) == 3
    assert len(found.units) == 12 and not found.failed
    assert reports(tmp_path / "out") == serial(manifest, tmp_path)


def test_a_local_cluster_gives_the_same_reports(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    manifest = make(tmp_path, 4)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, distributed.Client(cluster) as client:
        out = tmp_path / "out"
        gpsindy.fleet(manifest, out=out, effects=SUSPECTS, executor=client.get_executor())
        first, second = sorted(out.glob("tasks/*/report.json"))[:2]
        stamp = second.stat().st_mtime_ns
        # The same call again is no work that the cluster remembers: what is gone is made again.
        first.unlink()
        gpsindy.fleet(manifest, out=out, effects=SUSPECTS, executor=client.get_executor())
        assert second.stat().st_mtime_ns == stamp
    assert reports(out) == serial(manifest, tmp_path)


def test_mpi_gives_the_same_reports(tmp_path: Path) -> None:
    pytest.importorskip("mpi4py")
    start = next((p for p in (Path(sys.executable).with_name("mpiexec"), shutil.which("mpiexec")) if p and Path(p).exists()), None)
    if start is None:
        pytest.skip("needs mpiexec")
    manifest = make(tmp_path, 4)
    script = tmp_path / "run.py"
    script.write_text(
        "import sys\nimport gpsindy\nfrom mpi4py.futures import MPIPoolExecutor\n"
        "if __name__ == '__main__':\n"
        "    with MPIPoolExecutor() as executor:\n"
        f"        gpsindy.fleet(sys.argv[1], out=sys.argv[2], effects={SUSPECTS!r}, executor=executor)\n"
    )
    line = [str(start), "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script), str(manifest), str(tmp_path / "out")]
    subprocess.run(line, check=True, timeout=120)
    assert reports(tmp_path / "out") == serial(manifest, tmp_path)


class OnRay(Executor):
    """The executor that docs/formats.md describes."""

    def submit(self, task, /, *arguments):  # type: ignore[no-untyped-def]
        import ray

        return ray.remote(task).remote(*arguments).future()


def test_ray_gives_the_same_reports(tmp_path: Path) -> None:
    ray = pytest.importorskip("ray")
    manifest = make(tmp_path, 4)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        gpsindy.fleet(manifest, out=tmp_path / "out", effects=SUSPECTS, executor=OnRay())
    finally:
        ray.shutdown()
    assert reports(tmp_path / "out") == serial(manifest, tmp_path)
