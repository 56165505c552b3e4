"""A world in; its orbit and stereo pair, with and without the object, as a folder in EasySynth's layout out."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dlama.datasets.easysynth.writer import SequenceFrame, SequenceKey, StereoSequence, write_scene
from dlama.files.atomic_write import new_file
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.trajectories import PIVOT_M
from dlama.worlds.frames import World, classes_of, yaw_order

FRAMES = 30
"""Frames of a scene: thirteen poses and a stereo pair, with and without the object."""
DEPTH_RANGE_M = 10.0
CLASSES = {"background": (0, 0, 0), "object": (255, 0, 0), "sky": (70, 130, 180)}


def write_world(
    root: Path, scene: str, world: World, size: int, yaws: Sequence[float], step: Callable[[int], None] | None = None
) -> Path:
    """Write `root/scene`; `step` is called with the number of frames done. Raises OutputError."""
    done = 0

    def frame(camera: Camera, object: bool) -> SequenceFrame:
        nonlocal done
        seen = world.cast(camera, object=object)
        done += 1
        if step is not None:
            step(done)
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
            _place(number, f"{scene}_{key}", yaw, world.camera(yaw, size))
            for number, yaw in enumerate(yaw_order(tuple(yaws)))
        ]
        sequences[key] = {"dir": key, "camera": "CameraComponent", "sequence": f"{scene}_{key}", "frames": frames}
        both = {
            "c0": _place(0, f"{scene}_stereo_{key}", 0.0, rig.left),
            "c1": _place(0, f"{scene}_stereo_{key}", 0.0, rig.right),
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


def _place(number: int, sequence: str, yaw: float, camera: Camera) -> dict[str, object]:
    return {
        "id": number,
        "file": f"{sequence}.{number:04d}",
        "yaw_deg": yaw,
        "world_from_cam": camera.world_from_cam.tolist(),
    }
