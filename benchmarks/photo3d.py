"""3-D photos: views of one filled scene next to completing each camera alone, against the truth; open pixels; seconds and memory.

python benchmarks/photo3d.py truth --worlds 4 --cameras 12      # procedural worlds: the truth of any camera
python benchmarks/photo3d.py truth --street ../shared/street    # the street benchmark's scenes, at +-10 degrees
python benchmarks/photo3d.py flicker --cameras 6               # procedural worlds: neighbours on a loop
python benchmarks/photo3d.py holes --cameras 200                # the bundled street: open pixels of random cameras
python benchmarks/photo3d.py speed IMAGE [DEPTH] --fov 65       # one photo in this process: seconds by stage, memory, sizes
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.evaluation.metrics.lpips import lpips
from dlama.geometry.camera import Float64Array
from dlama.geometry.projection import px_from_px
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


def street_jobs(folder: Path) -> Iterator[tuple[str, dlama.RGBD, dlama.Photo3D, list[dlama.RGBD]]]:
    """The scenes at yaw 0, and their truth at +-10 degrees about 2.5 m, which the box is made to hold."""
    from dlama.datasets.layouts import open_dataset

    for scene in SCENES:
        cases = [
            case for case in open_dataset(folder / scene).cases if case.protocol == "vpi" and abs(case.yaw or 0) == 10
        ]
        truths = [case.load() for case in cases]
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


def measure_flicker(count: int, cameras: int) -> None:
    """How much a pixel of one picture differs from the same place of the next, a 60th of the way round the loop on: in levels,
    the mean over all that both show, of the 3-D photo, of the truth, and of each camera completed alone."""
    from dlama.worlds.dataset import world

    rows = []
    for seed in range(count):
        made = world(seed)
        source = made.frame(made.camera())
        photo = dlama.photo3d(source)
        for turn in np.linspace(0, 2 * np.pi, cameras, endpoint=False):
            pair = [photo.box.at(np.cos(angle), 0.5 * np.sin(angle), 0.0) for angle in (turn, turn + 2 * np.pi / 60)]
            true = [made.frame(camera) for camera in pair]
            turned = [dlama.render(photo.scene, camera) for camera in pair]
            alone = [dlama.complete(source, [camera]).view for camera in pair]
            rows.append([difference(*views) for views in (turned, true, alone)])
    mean = np.mean(rows, 0)
    print(f"{len(rows)} pairs: 3-D photo {mean[0]:.2f}, truth {mean[1]:.2f}, each alone {mean[2]:.2f} levels")


def difference(one: dlama.RGBD | dlama.View, other: dlama.RGBD | dlama.View) -> float:
    """Mean difference of colour (0..255) at the places that both pictures show, read bilinearly in the other."""
    seen = np.isfinite(one.depth) & (one.depth > 0)
    depth = np.where(seen, one.depth, 1)
    matrix, offset = px_from_px(other.camera, one.camera)
    x, y, ahead = np.moveaxis((pixel_centers(one.camera) @ matrix.T) * depth[..., None] + offset, 2, 0)
    place = [(axis / ahead - 0.5).astype(np.float32) for axis in (x, y)]
    color = cv2.remap(other.color, *place, cv2.INTER_LINEAR).astype(float)
    found = [cv2.remap(other.depth, *place, how) for how in (cv2.INTER_LINEAR, cv2.INTER_NEAREST)]
    same = seen & np.all([np.abs(one / ahead - 1) < 0.01 for one in found], 0)
    return float(np.abs(color - one.color)[same].mean())


def pixel_centers(camera: dlama.Camera) -> Float64Array:
    """H x W x 3: (x, y, 1) of every pixel's centre."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    return np.stack([columns, rows, np.ones(camera.hw)], 2)


def count_holes(cameras: int) -> None:
    """Open pixels of random cameras of the box of the bundled street."""
    street = dlama.example()
    photo = dlama.photo3d(dlama.read_rgbd(street / "street.jpg", street / "depth.png", fov=90))
    shares, sides = [], []
    for camera in photo.box.sample(cameras):
        hole = dlama.render(photo.scene, camera, types=False, fine=False).hole
        shares.append(float(hole.mean()))
        fits = [
            side
            for side in range(1, 32)
            if cv2.erode(hole.astype(np.uint8), np.ones((side, side)), borderValue=0).any()
        ]
        sides.append(max(fits, default=0))
    print(
        f"{cameras} cameras: open {max(shares):.4%} at most, {np.mean(shares):.4%} on average; largest square {max(sides)} px"
    )


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
    """Which of the five."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("truth", "flicker", "holes", "speed"))
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--worlds", type=int, default=4)
    parser.add_argument("--street", type=Path)
    parser.add_argument("--cameras", type=int, default=12)
    parser.add_argument("--fov", type=float, default=65.0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.what == "holes":
        count_holes(asked.cameras)
    elif asked.what == "flicker":
        measure_flicker(asked.worlds, asked.cameras)
    elif asked.what == "speed":
        measure(asked.files[0], asked.files[1] if len(asked.files) > 1 else None, asked.fov)
    else:
        compare(street_jobs(asked.street) if asked.street else world_jobs(asked.worlds, asked.cameras))


if __name__ == "__main__":
    main()
