"""A folder with a pairs.json (kitchen_vpi) in; its posed frames and a VPI case for each listed pair out.

Fields: `width, height, K, depth_scale` (metres per unit), `frames` (name: `color, depth, world_from_cam`), `pairs` (`a, b`,
source and target). K puts the first pixel's centre at 0.0, as its Kinect source does. Rotations are about any axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Case, Dataset
from dlama.datasets.posed_frames import FrameFiles, Lens
from dlama.datasets.text_tables import chosen_scenes, part_of, pose_at, read_json, sequences, text_of
from dlama.datasets.view_pairs import PosedFrame, load_view, posed_frame, rotation_deg
from dlama.errors import FileError
from dlama.files.checked_fields import FileFields

NAME = "pairs.json"


def looks_like_pairs(root: Path) -> bool:
    return (root / NAME).is_file()


def pairs_json(root: Path, *, scenes: Sequence[str] | None = None) -> Dataset:
    """The pairs of a folder (itself one, or holding several), in the file's order; `yaw_deg` is the angle of rotation.

    Raises FileError, CameraError, naming the field.
    """
    name = root.resolve().name
    frames: list[PosedFrame] = []
    cases: list[Case] = []
    for scene, folder in chosen_scenes(sequences(root, looks_like_pairs, NAME), scenes).items():
        fields = read_json(folder / NAME)
        own = _frames(scene, folder, fields)
        frames += own.values()
        cases += [_case(name, scene, fields, number, pair, own) for number, pair in enumerate(_pairs(fields))]
    return Dataset(name, "pairs", root, tuple(frame.frame for frame in frames), tuple(cases))


def _frames(scene: str, folder: Path, fields: FileFields) -> dict[str, PosedFrame]:
    lens = Lens(str(fields.path), fields.intrinsics("K"), fields.pixel_center(0.0), fields.size(None))
    scale = fields.number("depth_scale") if "depth_scale" in fields else 0.001
    if scale <= 0:
        raise FileError(f"{fields.path}: depth_scale is {scale:g}; metres per unit > 0 are wanted")
    listed = part_of(fields, "frames", fields.values.get("frames"))
    parts = {name: part_of(fields, f"frames.{name}", each) for name, each in listed.values.items()}
    return {name: _frame(folder, scene, name, part, lens, 1 / scale) for name, part in parts.items()}


def _frame(root: Path, scene: str, name: str, fields: FileFields, lens: Lens, units_per_metre: float) -> PosedFrame:
    pose = pose_at(str(fields.path), fields.matrix("world_from_cam", (4, 4)))
    color, depth = (root / text_of(fields, each) for each in ("color", "depth"))
    return posed_frame(scene, name, FrameFiles(color, depth, lens, pose, units_per_metre))


def _pairs(fields: FileFields) -> list[object]:
    pairs = fields.values.get("pairs")
    if not isinstance(pairs, list) or not pairs:
        raise FileError(f"{fields.path}: pairs is {str(pairs)[:40]}; a list of {{a, b}} is wanted")
    return pairs


def _case(
    dataset: str, scene: str, fields: FileFields, number: int, pair: object, frames: dict[str, PosedFrame]
) -> Case:
    ends = part_of(fields, f"pairs[{number}]", pair)
    for end in "ab":
        if text_of(ends, end) not in frames:
            raise FileError(f"{ends.path}: {end} is '{ends.values[end]}', which is not among the frames")
    source, target = (frames[ends.values[end]] for end in "ab")
    angle = rotation_deg(source.world_from_cam[None, :3, :3], target.world_from_cam[:3, :3])
    load = partial(load_view, source.load, target.load, True)
    return Case("vpi", dataset, scene, f"{source.name}_to_{target.name}", load, round(float(np.ravel(angle)[0]), 3))
