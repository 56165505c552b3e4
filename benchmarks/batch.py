"""What `dlama batch` costs and gives: throughput against a shell loop and against one warm process, Ray's overhead, memory.

    python benchmarks/batch.py throughput [--jobs 24] [--fillers layered migan]
    python benchmarks/batch.py overhead [--jobs 400]
    python benchmarks/batch.py memory [--rows 1000000]
    python benchmarks/batch.py cluster [--jobs 200]

Where other programs run on the computer, compare processor time; wall time is what counts where it is quiet.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import dlama
from dlama.jobs import batch as room
from dlama.jobs.perform import Task
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.result import JobResult
from dlama.jobs.run import Settings, run_jobs
from dlama.jobs.storage import Output, file_stamp
from dlama.workers.pool import Pool

ONLY = "image,depth"
CAMERA = dlama.example() / "camera.json"
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def rows(count: int, **more: Any) -> Iterator[dict[str, Any]]:
    """Views of the street that comes with dlama, each from another yaw."""
    street = {name: str(dlama.example() / file) for name, file in (("image", "street.jpg"), ("depth", "depth.png"))}
    for n in range(count):
        yield {
            "id": f"{n // 1000:04d}/{n:07d}",
            "verb": "view",
            **street,
            "camera": str(CAMERA),
            "yaw": 5 + n % 20,
            **more,
        }


def write_list(path: Path, count: int, **more: Any) -> Path:
    """A job list as CSV."""
    with path.open("w", newline="") as stream:
        names = list(next(rows(1, **more)))
        writer = csv.DictWriter(stream, names)
        writer.writeheader()
        writer.writerows(rows(count, **more))
    return path


@contextmanager
def clocks() -> Iterator[dict[str, float]]:
    """Seconds of wall and of processor time, of this process and of those that it started and that have ended."""

    def used() -> float:
        both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(one.ru_utime + one.ru_stime for one in both)

    found: dict[str, float] = {}
    wall, processor = time.perf_counter(), used()
    yield found
    found.update(wall=time.perf_counter() - wall, processor=used() - processor)


def throughput(folder: Path, jobs: int, fillers: list[str]) -> None:
    """Jobs a second of a shell loop, and of batches with 1 and 2 workers, each after as many warm processes that do nothing else:
    they share caches and memory as workers do."""
    print(
        "                                     per job (s)           times the shell loop     share of the limit    peak"
    )
    print(
        "filler   how                jobs/s    wall   processor     by wall   by processor   by wall   by processor    MiB"
    )
    for filler in fillers:
        shell = limit = shell_loop(folder, filler)
        for workers in (0, 1, 2):
            found = (
                {f"alone, {workers} at once": alone(folder, filler, jobs, workers)}
                if workers
                else {"shell loop": shell}
            )
            limit = next(iter(found.values()))
            if workers:
                found[f"batch, {workers} worker{'s' * (workers > 1)}"] = batched(
                    folder, filler, jobs * workers, workers
                )
            for how, one in found.items():
                times = [shell[clock] / one[clock] for clock in ("wall", "processor")]
                shares = [limit[clock] / one[clock] for clock in ("wall", "processor")]
                print(
                    f"{filler:8} {how:18} {1 / one['wall']:6.2f} {one['wall']:7.3f} {one['processor']:11.3f}"
                    f" {times[0]:11.1f} {times[1]:14.1f} {shares[0]:9.0%} {shares[1]:14.0%} {one.get('peak', 0):9.0f}"
                )


def shell_loop(folder: Path, filler: str, count: int = 3) -> dict[str, float]:
    """A command for each picture."""
    words = [*["-m", "dlama", "view"], str(dlama.example() / "street.jpg"), str(dlama.example() / "depth.png")]
    options = ["--camera", str(CAMERA), "--yaw", "10", "--filler", filler, "--only", ONLY, "--quiet"]
    with clocks() as took:
        for n in range(count):
            subprocess.run([sys.executable, *words, *options, "-o", str(folder / f"shell{n}")], check=True)
    return {name: seconds / count for name, seconds in took.items()}


def alone(folder: Path, filler: str, count: int, copies: int) -> dict[str, float]:
    """So many warm processes with one thread each that do nothing else: they read, complete and write."""
    code = (
        "import json, sys, time\nimport cv2, dlama\nfrom pathlib import Path\n"
        "from dlama.geometry.kernels.jit import use_threads\ncv2.setNumThreads(1); use_threads(1)\n"
        "street, out, filler, count = dlama.example(), Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])\n"
        "def one(n):\n"
        "    rgbd = dlama.read_rgbd(street / 'street.jpg', street / 'depth.png', camera=street / 'camera.json')\n"
        "    done = dlama.view(rgbd, yaw=5 + n % 20, filler=filler)\n"
        "    dlama.write(done, out / str(n), only=('image', 'depth'), inputs={'image': street / 'street.jpg'})\n"
        "one(0)\nwall, processor = time.perf_counter(), time.process_time()\n"
        "for n in range(count): one(n)\n"
        "took = {'wall': time.perf_counter() - wall, 'processor': time.process_time() - processor}\n"
        "print(json.dumps({name: seconds / count for name, seconds in took.items()}))\n"
    )
    words = [
        [sys.executable, "-c", code, str(folder / f"alone-{n}-{filler}"), filler, str(count)] for n in range(copies)
    ]
    started = [subprocess.Popen(one, stdout=subprocess.PIPE, text=True, env={**os.environ, **THREADS}) for one in words]
    took = [json.loads(one.communicate()[0].splitlines()[-1]) for one in started]
    mean = {name: statistics.fmean(one[name] for one in took) for name in took[0]}
    return {"wall": mean["wall"] / copies, "processor": mean["processor"]}


def batched(folder: Path, filler: str, count: int, workers: int) -> dict[str, float]:
    """A batch on processes, without their start, which a long run does not notice."""
    took, found, peak = [dict[str, float](), dict[str, float]()], list[float](), 0.0
    for number, size in enumerate((workers, count + workers)):  # the first, short one is what the start costs
        path = write_list(folder / "jobs.csv", size, filler=filler, only=ONLY)
        with clocks() as took[number]:
            out = folder / f"batch-{filler}-{workers}-{number}"
            done = list(dlama.batch(path, out, workers=workers, threads=1))
            found, peak = sorted(row.finished for row in done), max(row.peak_mib or 0 for row in done)
    wall = (found[-1] - found[workers - 1]) / count
    return {"wall": wall, "processor": (took[1]["processor"] - took[0]["processor"]) / count, "peak": peak}


def nothing(task: Task) -> JobResult:
    """A job that costs nothing."""
    return JobResult(task.job.id, "done")


def overhead(folder: Path, jobs: int) -> None:
    """Milliseconds a job of handing it out and entering its row, on processes and on a Ray cluster of this computer."""
    from dlama.jobs.on_ray import RayWorkers

    starts: dict[str, Callable[[], Any]] = {
        "processes": lambda: Pool(nothing, 1),
        "ray": lambda: RayWorkers(nothing, "local", 1, 1, 0.0),
    }
    source = room.JobList(list(rows(jobs)))
    found = {}
    for how, start in starts.items():
        settings = Settings(Output(str(folder / how)))
        times = [time.perf_counter() for _ in run_jobs(source, True, settings, start)]
        steps = [later - sooner for sooner, later in pairwise(times[20:])]
        found[how] = 1000 * sum(steps) / len(steps)
        print(f"{how:10} {found[how]:7.2f} ms a job (median step {1000 * statistics.median(steps):.2f} ms)")
    print(f"ray over processes: {found['ray'] - found['processes']:.2f} ms a job; expected: at most 15")


def memory(folder: Path, count: int) -> None:
    """Peak memory and seconds of a driver that lists so many jobs and finds every one of them done."""
    path = write_list(folder / "jobs.csv", count)
    jobs = iter(room.JobList(path))
    first = next(jobs)
    inputs = {role: {"path": file, "sha256": "", "stamp": file_stamp(file)} for role, file in first.files.items()}
    with Manifest(Output(str(folder / "out"))) as manifest:
        for job in room.JobList(path):
            row = JobResult(
                job.id, "done", "view", folder=job.id, options_hash=job.options_hash, inputs=inputs, finished=1.0
            )
            manifest.add(row)
    code = (
        "import resource, sys, time\nfrom dlama.jobs import batch as room\nfrom dlama.jobs.storage import Output\n"
        "Output.has = lambda self, name: True\n"
        "started = time.perf_counter()\n"
        "kept = sum(row.kept for row in room.batch(sys.argv[1], sys.argv[2], workers=1))\n"
        "peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024\n"
        "print(f'{kept} jobs listed and kept in {time.perf_counter() - started:.0f} s, peak memory {peak:.0f} MiB')\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path), str(folder / "out")], check=True)


def cluster(folder: Path, jobs: int) -> None:
    """A head and three nodes on this computer, a node and a worker killed in the middle: rows, and bytes against processes'."""
    import ray
    from ray.cluster_utils import Cluster

    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    path = write_list(folder / "jobs.csv", jobs, filler="telea", only="image")
    size = {"object_store_memory": 80_000_000}
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False, **size})
    nodes = [made.add_node(num_cpus=1, **size) for _ in range(3)]
    ray.init(address=made.address, log_to_driver=False, logging_level="ERROR")
    ids: list[str] = []
    with clocks() as took:
        for row in dlama.batch(path, folder / "ray", ray="auto", threads=1):
            ids.append(row.id)
            if len(ids) == jobs // 3:
                made.remove_node(nodes[0], allow_graceful=False)
            if len(ids) == jobs // 2:
                kill_a_worker()
    failed = sum(row.status == "failed" for row in dlama.batch(path, folder / "local", threads=1))
    names = [f"{one}/image.png" for one in ids]
    differ = sum((folder / "ray" / name).read_bytes() != (folder / "local" / name).read_bytes() for name in names)
    print(
        f"{len(ids)} rows of {jobs} jobs, {len(ids) - len(set(ids))} twice, {failed} failed, {differ} differ from processes'"
    )
    print(f"{took['wall']:.0f} s")


def kill_a_worker() -> None:
    """kill -9 of one process that runs an actor."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit() and b"ray::_Actor" in (folder / "cmdline").read_bytes():
            os.kill(int(folder.name), 9)
            return


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("throughput", "overhead", "memory", "cluster"))
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--fillers", nargs="+", default=["layered", "migan"])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="dlama-batch-") as name:
        folder = Path(name)
        if given.what == "throughput":
            throughput(folder, given.jobs or 24, given.fillers)
        elif given.what == "overhead":
            overhead(folder, given.jobs or 400)
        elif given.what == "memory":
            memory(folder, given.rows)
        else:
            cluster(folder, given.jobs or 200)


if __name__ == "__main__":
    main()
