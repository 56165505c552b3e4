"""What `dlama batch` gives: throughput against a shell loop and against warm processes.

    python benchmarks/batch.py [--jobs 24] [--fillers layered migan]

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
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dlama

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


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=24)
    parser.add_argument("--fillers", nargs="+", default=["layered", "migan"])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="dlama-batch-") as name:
        throughput(Path(name), given.jobs, given.fillers)


if __name__ == "__main__":
    main()
