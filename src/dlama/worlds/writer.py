"""Worlds in; folders in EasySynth's layout out: of each its orbit and stereo pair, with and without the object."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dlama import __version__
from dlama.completion.memory import LONGEST_SIDE, check_memory
from dlama.datasets.easysynth.writer import SequenceFrame, SequenceKey, StereoSequence, write_scene
from dlama.errors import InputError, OutputError, system_errors
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.trajectories import PIVOT_M
from dlama.worlds.dataset import YAWS, WorldSettings, world_settings
from dlama.worlds.world import SIZE, Kind, World, classes_of, yaw_order

FRAMES = 30
"""Frames of a scene: thirteen poses and a stereo pair, with and without the object."""
DEPTH_RANGE_M = 10.0
POSES = "poses.json"
CLASSES = {"background": (0, 0, 0), "object": (255, 0, 0), "sky": (70, 130, 180)}


@system_errors(OutputError)
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
    done and all frames. A scene is written whole or not at all, and one that an earlier run has written with the same settings
    is kept: a run that was killed resumes where it was. Returns the scenes' folders. Raises InputError (memory cannot hold the
    pictures), OutputError (a scene's folder holds something else, or the place cannot be written).
    """
    done = itertools.count(1)

    def step() -> None:
        if progress is not None:
            progress(next(done), FRAMES * count)

    every = world_settings(count, seed, size, kind, shadows, antialias, textures)
    if size > LONGEST_SIDE:
        raise InputError(f"`size` is {size}; at most {LONGEST_SIDE} pixels are expected")
    check_memory([Camera.from_fov(size, size, 60.0)])
    return [_write_or_keep(Path(folder), each, step) for each in every]


def _write_or_keep(root: Path, settings: WorldSettings, step: Callable[[], None]) -> Path:
    """The folder of a scene: as an earlier run with these settings left it, else written now."""
    made_with = describe_settings(settings)
    if read_settings(root / settings.scene) != made_with:
        return write_world(root, settings.scene, settings.world(), settings.size, YAWS, step, made_with)
    for _ in range(FRAMES):
        step()
    return root / settings.scene


def describe_settings(settings: WorldSettings) -> dict[str, object]:
    """What a scene is made with, as poses.json keeps it."""
    names = ("seed", "kind", "shadows", "antialias", "size")
    textures = str(settings.textures) if isinstance(settings.textures, Path) else None
    return {"dlama": __version__, **{name: getattr(settings, name) for name in names}, "textures": textures}


def read_settings(folder: Path) -> dict[str, object] | None:
    """What the scene in a folder was made with; None where there is none, or it does not say."""
    try:
        found = json.loads((folder / POSES).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return found.get("made_with") if isinstance(found, dict) else None


def write_world(
    root: Path,
    scene: str,
    world: World,
    size: int,
    yaws: Sequence[float],
    step: Callable[[], None],
    made_with: dict[str, object] | None = None,
) -> Path:
    """Write `root/scene` and return it; `step` is called after every frame. Raises OutputError.

    made_with: goes into poses.json, by which a later run knows the scene.
    """

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
    about = {**poses(scene, world, size, yaws), "made_with": made_with}
    texts = {POSES: json.dumps(about, indent=1) + "\n"}
    write_scene(root, scene, sequences, depth_range=DEPTH_RANGE_M, classes=CLASSES, texts=texts)
    return root / scene


def poses(scene: str, world: World, size: int, yaws: Sequence[float]) -> dict[str, object]:
    """The cameras in plain OpenCV axes, next to EasySynth's own tables."""
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
