"""3-D photos: views of one filled scene next to completing each camera alone, against the truth; seconds and memory.

python benchmarks/photo3d.py truth --worlds 4 --cameras 12      # procedural worlds: the truth of any camera
python benchmarks/photo3d.py truth --street ../shared/street    # the street benchmark's scenes, at +-10 degrees
python benchmarks/photo3d.py speed IMAGE [DEPTH] --fov 65       # one photo in this process: seconds by stage, memory, sizes
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

import dlama
from dlama.datasets.frames import ViewTruth
from dlama.datasets.layouts import open_dataset
from dlama.evaluation.metrics.lpips import lpips
from dlama.geometry.rgbd import BoolArray, UInt8Array

SCENES = ("s03", "s05", "s06", "s08")


def scores(color: UInt8Array, truth: UInt8Array, region: BoolArray) -> tuple[float, float]:
    """LPIPS and squared error over what the source did not show."""
    return lpips(color, truth, region), float(((color.astype(float) - truth) ** 2).mean(2)[region].mean())


def world_jobs(count: int, cameras: int) -> Iterator[tuple[str, dlama.RGBD, dlama.Photo3D, list[dlama.RGBD]]]:
    """Worlds, their 3-D photos, and the truth of random cameras of the box."""
    from dlama.worlds.dataset import world

    for seed in range(count):
        made = world(seed)
        source = made.frame(made.camera())
        photo = dlama.photo3d(source)
        yield f"world {seed}", source, photo, [made.frame(camera) for camera in photo.box.sample(cameras)]


def street_truths(folder: Path, scene: str, yaws: Iterable[int]) -> list[ViewTruth]:
    """The scene at yaw 0 with its truth at other ones, in degrees."""
    cases = {case.yaw: case for case in open_dataset(folder / scene).cases if case.protocol == "vpi"}
    return [cases[yaw].load() for yaw in yaws]


def street_jobs(folder: Path) -> Iterator[tuple[str, dlama.RGBD, dlama.Photo3D, list[dlama.RGBD]]]:
    """The scenes at yaw 0, and their truth at +-10 degrees about 2.5 m, which the box is made to hold."""
    for scene in SCENES:
        truths = street_truths(folder, scene, (-10, 10))
        source = truths[0].source
        yield scene, source, dlama.photo3d(source, angle=10.0), [truth.target for truth in truths]


def compare(jobs: Iterator[tuple[str, dlama.RGBD, dlama.Photo3D, list[dlama.RGBD]]]) -> None:
    """A line a scene: means over its cameras, of the 3-D photo and of each camera alone; and the change over all."""
    rows = []
    for name, source, photo, truths in jobs:
        for truth in truths:
            alone = dlama.complete(source, [truth.camera])
            region = alone.warped[0].hole
            if region.sum() < 100:
                continue
            together = dlama.render(photo.scene, truth.camera).color
            rows.append((*scores(together, truth.color, region), *scores(alone.view.color, truth.color, region)))
        of_photo, of_alone = np.split(np.mean(rows[-len(truths) :], 0), 2)
        print(
            f"{name}: 3-D photo LPIPS {of_photo[0]:.4f} MSE {of_photo[1]:.0f}, alone {of_alone[0]:.4f} {of_alone[1]:.0f}"
        )
    mean = np.mean(rows, 0)
    print(f"{len(rows)} views: LPIPS {mean[0] / mean[2] - 1:+.1%}, MSE {mean[1] / mean[3] - 1:+.1%}")


def measure(image: Path, depth: Path | None, fov: float) -> None:
    """Seconds and memory of a photo, kernels compiled before on a small one."""
    small = dlama.RGBD(
        np.zeros((64, 64, 3), np.uint8), np.full((64, 64), 2, np.float32), dlama.Camera.from_fov(64, 64, 60)
    )
    dlama.photo3d(small)
    started, cpu = time.perf_counter(), time.process_time()
    rgbd = dlama.read_rgbd(image, depth, fov=fov)
    read = time.perf_counter() - started
    photo = dlama.photo3d(rgbd)
    with tempfile.TemporaryDirectory() as folder:
        out = dlama.write_photo3d(photo, Path(folder) / "out")
        sizes = {path.name: round(path.stat().st_size / 1e6, 2) for path in out.iterdir()}
    seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{rgbd!r}: {seconds:.1f} s ({cpu:.1f} s of processor, {read:.1f} s to read), {memory:.0f} MB")
    print(photo.meta["seconds"], len(photo.meta["photo3d"]["filled_cameras"]), "cameras;", sizes, "MB")


def main() -> None:
    """Which of the two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("truth", "speed"))
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--worlds", type=int, default=4)
    parser.add_argument("--street", type=Path)
    parser.add_argument("--cameras", type=int, default=12)
    parser.add_argument("--fov", type=float, default=65.0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.what == "speed":
        measure(asked.files[0], asked.files[1] if len(asked.files) > 1 else None, asked.fov)
    else:
        compare(street_jobs(asked.street) if asked.street else world_jobs(asked.worlds, asked.cameras))


if __name__ == "__main__":
    main()
