"""Worlds in; folders in EasySynth's layout out: of each its orbit and stereo pair, with and without the object."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dlama.datasets.easysynth.writer import SequenceFrame, SequenceKey, StereoSequence, write_scene
from dlama.files.atomic_write import new_file
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.trajectories import PIVOT_M
from dlama.worlds.dataset import YAWS, world_settings
from dlama.worlds.world import SIZE, Kind, World, classes_of, yaw_order

FRAMES = 30
"""Frames of a scene: thirteen poses and a stereo pair, with and without the object."""
DEPTH_RANGE_M = 10.0
CLASSES = {"background": (0, 0, 0), "object": (255, 0, 0), "sky": (70, 130, 180)}


def write_worlds(
    folder: Path,
    *,
    count: int = 4,
    seed: int = 0,
    size: int = SIZE,
    kind: Kind | None = None,
    shadows: bool = True,
    antialias: bool = True,
    textures: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write worlds in EasySynth's layout, depth range 10 m: scene folders `wNNN` with with, without, stereo_with, stereo_without.

    Each scene also gets poses.json (intrinsics, yaw and world_from_cam of every frame). `progress` is called with frames
    done and all frames. A scene is written whole or not at all. Returns the scenes' folders. Raises InputError, OutputError
    (a scene's folder is not empty, or the place cannot be written).
    """
    done = itertools.count(1)

    def step() -> None:
        if progress is not None:
            progress(next(done), FRAMES * count)

    every = world_settings(count, seed, size, kind, shadows, antialias, textures)
    return [write_world(Path(folder), each.scene, each.world(), size, YAWS, step) for each in every]


def write_world(
    root: Path, scene: str, world: World, size: int, yaws: Sequence[float], step: Callable[[], None]
) -> Path:
    """Write `root/scene` and return it; `step` is called after every frame. Raises OutputError."""

    def frame(camera: Camera, object: bool) -> SequenceFrame:
        seen = world.raycast(camera, object=object)
        step()
        return SequenceFrame(RGBD(seen.color, seen.depth, camera), classes_of(seen.group, world.object_index))

    def orbit(object: bool) -> Iterator[SequenceFrame]:
        return (frame(world.camera(yaw, size), object) for yaw in yaw_order(tuple(yaws)))

    def pair(object: bool) -> StereoSequence:
        rig = world.rig(size=size)
        return StereoSequence((frame(rig.left, object),), (frame(rig.right, object),))

    sequences: dict[SequenceKey, Iterator[SequenceFrame] | StereoSequence] = {
        "with": orbit(True),
        "without": orbit(False),
        "stereo_with": pair(True),
        "stereo_without": pair(False),
    }
    write_scene(root, scene, sequences, depth_range=DEPTH_RANGE_M, classes=CLASSES)
    with new_file(root / scene / "poses.json") as draft:
        draft.write_text(json.dumps(poses(scene, world, size, yaws), indent=1) + "\n", encoding="utf-8")
    return root / scene


def poses(scene: str, world: World, size: int, yaws: Sequence[float]) -> dict[str, object]:
    """The cameras in plain OpenCV axes, beside EasySynth's own tables."""
    first, rig = world.camera(0.0, size), world.rig(size=size)
    sequences: dict[str, object] = {}
    for key in ("with", "without"):
        frames = [
            _frame_entry(number, f"{scene}_{key}", yaw, world.camera(yaw, size))
            for number, yaw in enumerate(yaw_order(tuple(yaws)))
        ]
        sequences[key] = {"dir": key, "camera": "CameraComponent", "sequence": f"{scene}_{key}", "frames": frames}
        both = {
            "c0": _frame_entry(0, f"{scene}_stereo_{key}", 0.0, rig.left),
            "c1": _frame_entry(0, f"{scene}_stereo_{key}", 0.0, rig.right),
        }
        sequences[f"stereo_{key}"] = {
            "dir": f"stereo_{key}", "sequence": f"{scene}_stereo_{key}", "left": "c0", "right": "c1",
            "baseline_m": rig.baseline_m, "frames": both,
        }  # fmt: skip
    return {
        "scene": scene,
        "world": world.name,
        "image_size": [size, size],
        "K": first.K.tolist(),
        "pixel_centres": "+0.5: pixel (row v, col u) is the ray through (u+0.5, v+0.5)",
        "world_from_cam": "4x4, OpenCV axes (x right, y down, z forward), metres; p_world = T p_cam",
        "orbit_centre": [0, -world.eye_m, PIVOT_M],
        "orbit_radius_m": PIVOT_M,
        "depth_range_m": DEPTH_RANGE_M,
        "sequences": sequences,
    }


def _frame_entry(number: int, sequence: str, yaw: float, camera: Camera) -> dict[str, object]:
    return {
        "id": number,
        "file": f"{sequence}.{number:04d}",
        "yaw_deg": yaw,
        "world_from_cam": camera.world_from_cam.tolist(),
    }
