"""Memory and time by number of frames: a sequence repeated with poses a few millimetres off, completed at some cameras.

python benchmarks/many_frames.py kitchen_sequence --frames 10 100 1000
python benchmarks/many_frames.py kitchen_sequence --frames 1000 --whole      # `dlama sequence` at all frames, with all files

Each number of frames runs in a process of its own, whose peak memory is printed.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.datasets.sequences.loading import read_scene_of
from dlama.workers.memory import peak_mib

OFF_M, OFF_DEG = 0.003, 0.1
"""By which repeated frames are off."""


def repeated(source: Path, folder: Path, count: int) -> Path:
    """A data set in nerfstudio's layout of so many frames: those of `source`, by links, again and again."""
    fields = json.loads((source / "transforms.json").read_text("utf-8"))
    rng, frames = np.random.default_rng(0), []
    for name in ("images", "depth"):
        (folder / name).mkdir(parents=True)
    for number in range(count):
        frame = dict(fields["frames"][number % len(fields["frames"])])
        if number >= len(fields["frames"]):
            pose = np.array(frame["transform_matrix"])
            pose[:3, :3] = cv2.Rodrigues(np.radians(rng.normal(0, OFF_DEG, 3)))[0] @ pose[:3, :3]
            pose[:3, 3] += rng.normal(0, OFF_M, 3)
            frame["transform_matrix"] = pose.tolist()
        for key, kind in (("file_path", "images"), ("depth_file_path", "depth")):
            file = source / frame[key]
            frame[key] = f"{kind}/{number:05d}{file.suffix}"
            (folder / frame[key]).symlink_to(file.resolve())
        frames.append(frame)
    (folder / "transforms.json").write_text(json.dumps(fields | {"frames": frames}), encoding="utf-8")
    return folder


def measured(folder: Path, views: int) -> str:
    """A line: seconds to gather, then seconds a camera (between two frames, each completed), and peak memory."""
    dlama.complete(dlama.read_rgbd(dlama.example() / "street.jpg", dlama.example() / "depth.png", fov=90), [_warm()])
    started, used = time.perf_counter(), time.process_time()
    scene = read_scene_of(folder).scene
    gathered, gathered_used = time.perf_counter() - started, time.process_time() - used
    numbers = np.linspace(0, len(scene.numbers) - 1, views).round().astype(int)
    frames = [scene.layers[number].camera for number in numbers]
    cameras = [dlama.orbit(camera, 3.0, 0.0, 2.0) for camera in frames]
    rendered, used = time.perf_counter(), time.process_time()
    for camera in cameras:
        dlama.render(scene, camera)
    a_view, a_view_used = (
        (now - then) / views for now, then in zip((time.perf_counter(), time.process_time()), (rendered, used))
    )
    used = time.process_time()
    dlama.complete(scene, cameras[:1])
    first = time.process_time() - used
    return (
        f"{len(scene.numbers):6d} {gathered:9.1f} {gathered_used:9.1f} {a_view:12.2f} {a_view_used:9.2f} {first:12.1f}"
        f" {peak_mib(False) or 0:10.0f}"
    )


def _warm() -> dlama.Camera:
    return dlama.orbit(dlama.Camera.from_fov(64, 64, 60), 5.0, 0.0, 2.5)


def completed_whole(folder: Path) -> str:
    """A line: `dlama sequence` at all frames, with every file."""
    with tempfile.TemporaryDirectory() as out:
        used = time.process_time()
        meta = dlama.sequence(folder).write(Path(out) / "out", also=["scene", "points"])
        size = sum(file.stat().st_size for file in (Path(out) / "out").rglob("*") if file.is_file())
        views, spent = len(meta["filled_share"]), time.process_time() - used
    return (
        f"{views:6d} views {meta['seconds']:8.1f} s {spent:8.1f} s of processor time, {spent / views:.2f} a view,"
        f" {size / 1e6:.0f} MB of files, peak {peak_mib(False) or 0:.0f} MiB"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--frames", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--views", type=int, default=8)
    parser.add_argument("--whole", action="store_true")
    options = parser.parse_args()
    if not options.whole:
        print("frames  gather, s  processor  a render, s  processor  complete, s  peak, MiB")
    for count in options.frames:
        with tempfile.TemporaryDirectory() as scratch, ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            folder = repeated(options.dataset, Path(scratch) / "frames", count)
            job = (
                pool.submit(completed_whole, folder) if options.whole else pool.submit(measured, folder, options.views)
            )
            print(job.result(), flush=True)


if __name__ == "__main__":
    main()
