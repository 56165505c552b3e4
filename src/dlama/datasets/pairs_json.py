"""A folder with a pairs.json (kitchen_vpi) in; its posed frames and a VPI case for each listed pair out.

Fields: `width, height, K, depth_scale` (metres per unit), `frames` (name: `color, depth, world_from_cam`), `pairs` (`a, b`,
source and target). K puts the first pixel's centre at 0.0, as its Kinect source does. Rotations are about any axis.
"""

from __future__ import annotations

from pathlib import Path

from dlama.datasets.frames import Case, Dataset
from dlama.datasets.posed.lenses import json_lens, units_per_metre
from dlama.datasets.posed.posed_frames import PosedFrame, files_of, posed_frame
from dlama.datasets.posed.view_pairs import pair_case
from dlama.datasets.text_tables import holds, pose_at, scene_folders
from dlama.errors import FileError
from dlama.files.fields import FileFields, read_json_fields

NAME = "pairs.json"
looks_like_pairs = holds(NAME)


def pairs_json(root: Path) -> Dataset:
    """The pairs of a folder (itself one, or holding several), in the file's order; `yaw` is the angle of rotation.

    Raises FileError, CameraError, naming the field.
    """
    name = root.resolve().name
    frames: list[PosedFrame] = []
    cases: list[Case] = []
    for scene, folder in scene_folders(root, looks_like_pairs, NAME).items():
        fields = read_json_fields(folder / NAME)
        own = _frames(scene, folder, fields)
        frames += own.values()
        pairs = fields.entries("pairs", "{a, b}")
        cases += [_case(name, fields, number, pair, own) for number, pair in enumerate(pairs)]
    return Dataset(name, "pairs", root, tuple(frames), tuple(cases))


def _frames(scene: str, folder: Path, fields: FileFields) -> dict[str, PosedFrame]:
    lens, units = json_lens(fields), units_per_metre(fields, "depth_scale", 0.001)
    listed = fields.part("frames", fields.values.get("frames"))
    frames = {}
    for name, values in listed.values.items():
        part = fields.part(f"frames.{name}", values)
        pose = pose_at(str(part.path), part.matrix("world_from_cam", (4, 4)))
        color, depth = (folder / part.text(each) for each in ("color", "depth"))
        frames[name] = posed_frame(scene, name, files_of(color, depth, lens, pose, units))
    return frames


def _case(dataset: str, fields: FileFields, number: int, pair: object, frames: dict[str, PosedFrame]) -> Case:
    ends = fields.part(f"pairs[{number}]", pair)
    for end in "ab":
        if ends.text(end) not in frames:
            raise FileError(f"{ends.path}: {end} is '{ends.values[end]}', which is not among the frames")
    source, target = (frames[ends.values[end]] for end in "ab")
    return pair_case(dataset, source, target)
