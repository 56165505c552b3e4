"""A folder in EasySynth's layout in; its frames and its cases of all three protocols out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.easysynth.frames import (
    POSES,
    CameraPair,
    RenderedFrame,
    RenderedSequence,
    class_mask,
    load_removal,
    load_stereo,
    load_view,
    read_sequence,
    sequence_folders,
)
from dlama.datasets.frames import Case, Dataset, Protocol, Truth
from dlama.datasets.posed.posed_frames import PosedFrame, posed_frame
from dlama.datasets.text_tables import check_folder
from dlama.errors import CameraError, FileError
from dlama.files.semantic_classes import CLASSES_FILE, RGB, class_color
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose, rotation_deg

SAME_POSE = 1e-4
"""Largest difference between the poses (metres, and entries of the rotation) of a frame with and without the object."""
PIVOT_MISS = 0.01
"""By how much two optical axes may miss the pivot of an orbit, as a share of the distance to it."""
SAME_ORIENTATION_DEG = 0.01
"""Two orientations nearer than this are the same: no orbit."""

_Case = tuple[Protocol, str, Callable[[], Truth], "float | None"]


def easysynth(root: Path, *, depth_range: float | None = None, removal_object: str | None = None) -> Dataset:
    """The data set in a folder in the layout that EasySynth (github.com/ydrive/EasySynth) renders.

    VPI: the first frame of each camera of `with` (and of each sequence of another name) to every other; the object's mask and
    the frames without it where there is a `without`. ORI: the frames of `with` that show the object. SII: stereo_with
    against stereo_without, and rectified pairs of any other sequence for view synthesis.

    Args:
        root: one sequence, a scene (folders with, without, stereo_with, stereo_without, or of any other names), or a folder
            of scenes.
        depth_range: metres that 1.0 (= far) stands for in DepthImage; no file holds it. Not needed where a camera has DepthMM
            (16-bit mm over the full range, our addition), which is read first.
        removal_object: the class of SemanticClasses.csv that is removed, by name or as "R,G,B"; "object" by default.
    Raises:
        FileError, CameraError: a file, with line and column.
        DepthError: depth_range is needed, or DepthImage is no EXR.
        MaskError: removal_object is no class.
    """
    check_folder(root)
    scenes = sequence_folders(root)
    if not scenes:
        raise FileError(
            f"{root}: holds no EasySynth sequence (CameraRig.json or CameraPoses.csv next to <camera>/ColorImage), no scene "
            "of such, and no folder of scenes"
        )
    name = root.resolve().name
    frames: list[PosedFrame] = []
    cases: list[Case] = []
    for folder, folders in scenes:
        scene = folder.resolve().name
        sequences = [read_sequence(each, depth_range) for each in folders]
        frames += [frame for sequence in sequences for frame in _frames(scene, sequence)]
        for protocol, frame, load, yaw in _cases(sequences, removal_object):
            cases.append(Case(protocol, name, scene, frame, load, yaw))
    return Dataset(name, "easysynth", root, tuple(frames), tuple(cases))


def looks_like_easysynth(root: Path) -> bool:
    """True if `root` is a sequence, a scene or a folder of scenes in EasySynth's layout (names are looked at, not contents)."""
    return bool(sequence_folders(Path(root)))


def orbit_yaw(source: Float64Array, target: Float64Array) -> float | None:
    """Degrees of orbit from one 4x4 pose (OpenCV axes) to another, > 0 where the camera moves to its right; None: no orbit.

    It is one where both optical axes meet in a point before both cameras, at the same distance from them (within PIVOT_MISS).
    """
    step = invert_pose(source) @ target
    angle, offset, axis = _rotation_deg(source, target), step[:3, 3], step[:3, 2]
    if angle < SAME_ORIENTATION_DEG:
        return None
    lines = np.stack([[0.0, 0.0, 1.0], -axis], axis=1)  # source axis * a = offset + target axis * b
    (ahead, ahead_too), *_ = np.linalg.lstsq(lines, offset, rcond=None)
    miss = float(np.linalg.norm(lines @ (ahead, ahead_too) - offset))
    if ahead <= 0 or miss > PIVOT_MISS * ahead or abs(ahead - ahead_too) > PIVOT_MISS * ahead:
        return None
    return round(float(np.copysign(angle, offset[0])), 3)  # files carry six digits; 10.000003 is 10


def _rotation_deg(source: Float64Array, target: Float64Array) -> float:
    """Degrees between the orientations of two 4x4 poses, 0..180."""
    return float(rotation_deg(target[None, :3, :3], source[:3, :3])[0])


def _frames(scene: str, sequence: RenderedSequence) -> Iterator[PosedFrame]:
    for camera, by_id in sequence.cameras.items():
        first = next(iter(by_id.values())).files
        for identity, frame in by_id.items():
            yaw = 0.0 if frame.files is first else orbit_yaw(first.world_from_cam, frame.files.world_from_cam)
            yield posed_frame(scene, sequence.name_of(camera, identity), frame.files, yaw)


def _cases(sequences: list[RenderedSequence], removal_object: str | None) -> Iterator[_Case]:
    """Of one scene. A sequence that is the truth of another one has no cases of its own."""
    named = {sequence.folder.name: sequence for sequence in sequences}
    pairs = ("with", "without"), ("stereo_with", "stereo_without")
    truth_of = {shown: named[hidden] for shown, hidden in pairs if {shown, hidden} <= named.keys()}
    for sequence in sequences:
        if sequence in truth_of.values():
            continue
        without, color = truth_of.get(sequence.folder.name), None
        if without is not None:
            color = class_color(removal_object or "object", sequence.folder / CLASSES_FILE)
        pair = sequence.pair()
        if pair is not None:
            yield from _sii(sequence, pair, without, color)
            continue
        yield from _vpi(sequence, without, color)
        if without is not None and color is not None:
            yield from _ori(sequence, without, color)


def _vpi(sequence: RenderedSequence, without: RenderedSequence | None, color: RGB | None) -> Iterator[_Case]:
    for camera, by_id in sequence.cameras.items():
        truths = {} if without is None else _same_poses(sequence, without, camera)
        source, *targets = by_id
        start = by_id[source].files.world_from_cam
        for identity in targets:
            goal = by_id[identity].files.world_from_cam
            yaw = orbit_yaw(start, goal)
            angle = round(_rotation_deg(start, goal), 3) if yaw is None else yaw
            load = partial(load_view, by_id[source], by_id[identity], truths.get(identity), color)
            yield "vpi", sequence.name_of(camera, identity), load, angle


def _ori(sequence: RenderedSequence, without: RenderedSequence, color: RGB) -> Iterator[_Case]:
    """Frames that show the object: for this alone semantic pictures are read while listing."""
    for camera, by_id in sequence.cameras.items():
        for identity, truth in _same_poses(sequence, without, camera).items():
            frame = by_id[identity]
            if frame.semantic is not None and frame.semantic.exists() and not class_mask(frame, color).any():
                continue
            yield "ori", sequence.name_of(camera, identity), partial(load_removal, frame, truth, color), None


def _sii(
    sequence: RenderedSequence, pair: CameraPair, without: RenderedSequence | None, color: RGB | None
) -> Iterator[_Case]:
    truth = None
    if without is not None:
        truth = without.pair()
        if truth is None:
            raise CameraError(f"{without.folder}: is no rectified pair of two cameras, as {sequence.folder} is")
        for camera in sequence.cameras:
            _same_poses(sequence, without, camera)
    left, right = pair
    for identity in (each for each in left if truth is None or each in truth[0]):
        without_object = None if truth is None else (truth[0][identity], truth[1][identity])
        load = partial(load_stereo, left[identity], right[identity], without_object, color)
        yield "sii", f"{sequence.folder.resolve().name}-{identity:04d}", load, None


def _same_poses(sequence: RenderedSequence, without: RenderedSequence, camera: str) -> dict[int, RenderedFrame]:
    """The frames without the object, by id; raises FileError where one is not at the same pose."""
    if camera not in without.cameras:
        raise FileError(f"{without.folder}: has no camera '{camera}', which {sequence.folder} has")
    truths = {}
    for identity, frame in without.cameras[camera].items():
        mine = sequence.cameras[camera].get(identity)
        if mine is None:
            continue
        difference = float(np.abs(mine.files.world_from_cam - frame.files.world_from_cam).max())
        if difference > SAME_POSE:
            raise FileError(
                f"{without.folder / camera / POSES}: the pose of frame {identity} differs by {difference:.3g} from that in "
                f"{sequence.folder.name}; the same cameras are expected with and without the object"
            )
        truths[identity] = frame
    return truths
