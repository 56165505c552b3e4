"""Many frames: dlama beside nearest-wins of points and Open3D's TSDF (VoxelBlockGrid) with Telea, on held-out frames.

python benchmarks/sequence.py DATASET --held 5 11 17 --counts 1 4 --width 320 -o sequence.md
python benchmarks/sequence.py worlds:3 --held 3 --counts 1 2 4 -o worlds.md        # generated, poses are exact
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Sequence
from multiprocessing import TimeoutError, get_context
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.frames import Frame
from dlama.datasets.sequences.loading import open_frames
from dlama.evaluation.protocols.methods import ProtocolSettings
from dlama.geometry.camera import Camera
from dlama.geometry.frames.alignment import align_frames
from dlama.geometry.rgbd import RGBD
from dlama.worlds.dataset import open_dataset_or_worlds
from held_out_frames import (
    METHODS,
    SynthesisedView,
    fill_with_telea,
    score_sequence,
    sort_along_orbit,
    source_distance,
    table,
)

VOXEL_M = 0.01
TRUNCATION = 4.0
"""Voxels."""
TRIES, PATIENCE_S = 5, 60
"""How often the TSDF is begun, and how long it may take."""


def tsdf(sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
    """Open3D's VoxelBlockGrid of all frames (TSDF), ray cast from the camera, and Telea's filling."""
    import open3d as o3d

    core, far, weight = o3d.core, 20.0, 1.0
    kinds = (core.float32, core.float32, core.float32)
    grid = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight", "color"), kinds, ((1), (1), (3)), voxel_size=VOXEL_M, block_resolution=16, block_count=20000
    )
    for each in sources:
        depth = o3d.t.geometry.Image(core.Tensor(np.where(np.isfinite(each.depth), each.depth, 0).astype(np.float32)))
        color = o3d.t.geometry.Image(core.Tensor(each.color.astype(np.float32)))
        lens, pose = (core.Tensor(matrix) for matrix in matrices(each.camera))
        blocks = grid.compute_unique_block_coordinates(depth, lens, pose, 1.0, far, TRUNCATION)
        grid.integrate(blocks, depth, color, lens, lens, pose, 1.0, far, TRUNCATION)
    lens, pose = (core.Tensor(matrix) for matrix in matrices(camera))
    found = grid.ray_cast(
        grid.hashmap().key_tensor(), lens, pose, *camera.wh, ["depth", "color"], 1.0, 0.1, far, weight, TRUNCATION
    )
    shown = found["depth"].numpy()[..., 0]
    return fill_with_telea(
        found["color"].numpy().round().clip(0, 255).astype(np.uint8), shown.astype(np.float32), shown <= 0
    )


def matrices(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Open3D's intrinsic matrix (first pixel's centre at 0.0), and world to camera."""
    lens = camera.K.copy()
    lens[:2, 2] -= 0.5
    return lens, np.ascontiguousarray(camera.cam_from_world)


def resized(rgbd: RGBD, width: int | None) -> RGBD:
    """The frame at another width: colours by area means, depth from the nearest pixel."""
    if width is None:
        return rgbd
    camera = rgbd.camera.resized(width, round(width * rgbd.camera.height / rgbd.camera.width))
    color = cv2.resize(rgbd.color, camera.wh, interpolation=cv2.INTER_AREA)
    return RGBD(color, cv2.resize(rgbd.depth, camera.wh, interpolation=cv2.INTER_NEAREST), camera)


class InItsOwnProcess:
    """The TSDF in another process, which is replaced where it does not answer: VoxelBlockGrid.integrate of Open3D 0.19 waits for
    itself now and then, on few cores, whatever else runs."""

    def __init__(self) -> None:
        self._pool = get_context("spawn").Pool(1)

    def __call__(self, sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
        for _ in range(TRIES):
            try:
                made, seconds = self._pool.apply_async(timed_tsdf, (sources, camera)).get(PATIENCE_S)
                return dataclasses.replace(made, seconds=seconds)
            except TimeoutError:
                self._pool.terminate()
                self._pool = get_context("spawn").Pool(1)
        raise SystemExit(f"Open3D did not answer within {PATIENCE_S} s, {TRIES} times; --without-tsdf leaves it out")


def timed_tsdf(sources: Sequence[RGBD], camera: Camera) -> tuple[SynthesisedView, float]:
    """The same, and its seconds of processor time."""
    started = time.process_time()
    made = tsdf(sources, camera)
    return made, time.process_time() - started


def scenes_of(dataset: str) -> dict[str, list[Frame]]:
    """The frames of each scene of a folder or of generated worlds, in order."""
    if Path(dataset).is_dir():
        return {Path(dataset).name: list(open_frames(dataset))}
    frames = open_dataset_or_worlds(dataset).frames
    names = dict.fromkeys(one.scene for one in frames)
    return {name: sort_along_orbit([one for one in frames if one.scene == name]) for name in names}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", help="a folder, or worlds:N")
    parser.add_argument("--held", type=int, nargs="+", default=[6, 15, 24, 33, 42])
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--width", type=int)
    parser.add_argument("--given-poses", action="store_true", help="leave the data set's poses as they are")
    parser.add_argument("--without-tsdf", action="store_true")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    methods = dict(METHODS)
    if not options.without_tsdf:
        methods["TSDF + Telea"] = InItsOwnProcess()
    rows = []
    for name, listed in scenes_of(options.dataset).items():
        loaded = [each.load() for each in listed]
        frames = [resized(each, options.width) for each in (loaded if options.given_poses else align_frames(loaded))]
        names = [f"{name}/{each.name}" for each in listed]
        apart = source_distance(listed)
        rows += score_sequence(frames, options.held, names, ProtocolSettings(), methods, options.counts, apart=apart)
    parts = [
        f"**{region}**\n\n{table(rows, region)}"
        for region in ("whole", "seen by one", "seen by several", "seen by none")
    ]
    text = "\n\n".join(parts) + "\n"
    print(text)
    if options.output is not None:
        options.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
