"""A folder in EasySynth's layout in; its scenes and sequences, the files of each frame, and the truths read from them, out."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.easysynth.text_files import PosedLens, read_poses, read_rig
from dlama.datasets.frames import RemovalTruth, StereoTruth, ViewTruth, true_disparity
from dlama.datasets.posed.posed_frames import FrameFiles, load_rgbd
from dlama.datasets.text_tables import folders_in
from dlama.errors import CameraError, DepthError, FileError, MaskError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.pictures import read_classes, read_color_of_camera
from dlama.files.semantic_classes import RGB
from dlama.geometry.camera import StereoRig
from dlama.geometry.rgbd import BoolArray, Float32Array

RIG, POSES = "CameraRig.json", "CameraPoses.csv"
COLOR, DEPTH, SEMANTIC, MILLIMETRES = "ColorImage", "DepthImage", "SemanticImage", "DepthMM"
PICTURE = re.compile(r"(?P<stem>.*\D|)(?P<number>\d+)(?P<suffix>\.(?:png|jpe?g|exr))", re.IGNORECASE)
"""<Sequence>.<NNNN>.<png, jpeg or exr>."""


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """Where one frame lies, and how it is to be read."""

    files: FrameFiles
    semantic: Path | None


CameraPair = tuple[dict[int, RenderedFrame], dict[int, RenderedFrame]]


@dataclass(frozen=True, eq=False)
class RenderedSequence:
    """One rendering output folder."""

    folder: Path
    cameras: dict[str, dict[int, RenderedFrame]]
    """Frames by camera and frame id."""

    def name_of(self, camera: str, identity: int) -> str:
        """Unique within a scene: sequence, camera where there are several, id."""
        parts = [self.folder.resolve().name, *([camera] if len(self.cameras) > 1 else []), f"{identity:04d}"]
        return "-".join(parts)

    def pair(self) -> CameraPair | None:
        """(left, right) frames, if the sequence has exactly two cameras, in step, that make a rectified pair."""
        if len(self.cameras) != 2:
            return None
        one, other = self.cameras.values()
        for left, right in ((one, other), (other, one)):
            if set(left) == set(right) and all(_is_rectified(left[each], right[each]) for each in left):
                return left, right
        return None


def sequence_folders(root: Path) -> list[tuple[Path, list[Path]]]:
    """(scene folder, its sequence folders) of a sequence, a scene or a folder of scenes, by name; empty: none of these."""
    if _is_sequence(root):
        return [(root, [root])]
    sequences = [folder for folder in _folders(root) if _is_sequence(folder)]
    if sequences:
        return [(root, sequences)]
    below = [(scene, [each for each in _folders(scene) if _is_sequence(each)]) for scene in _folders(root)]
    return [(scene, found) for scene, found in below if found]


def read_sequence(folder: Path, depth_range: float | None) -> RenderedSequence:
    """The frames of one rendering output folder, or of one camera's own folder in it; pictures are not opened.
    depth_range: as in `easysynth`.

    Raises FileError, CameraError, DepthError.
    """
    alone = (folder / COLOR).is_dir()
    top = folder.resolve().parent if alone else folder
    rig = read_rig(top / RIG) if (top / RIG).exists() else {}
    inside = {each.name: each for each in _folders(folder) if (each / COLOR).is_dir()}
    places = {folder.resolve().name: folder} if alone else inside
    missing = [name for name in rig if name not in places and not alone]
    if missing:
        raise FileError(f"{folder / missing[0] / COLOR}: no such folder; {folder / RIG} has a camera '{missing[0]}'")
    cameras = {name: _camera(top, place, rig.get(name), depth_range) for name, place in places.items()}
    return RenderedSequence(folder, cameras)


def _is_sequence(folder: Path) -> bool:
    """Also of a camera's own folder, which is all that the versions before 1.2 write of a single camera."""
    if (folder / COLOR).is_dir():
        return (folder / POSES).is_file()
    if not ((folder / RIG).is_file() or (folder / POSES).is_file()):
        return False
    return any((each / COLOR).is_dir() for each in _folders(folder))


def _folders(root: Path) -> list[Path]:
    return sorted(folders_in(root)) if root.is_dir() else []


def _camera(folder: Path, place: Path, rig: PosedLens | None, depth_range: float | None) -> dict[int, RenderedFrame]:
    """The frames of one camera, by id."""
    table, poses = _poses(folder, place, rig)
    read, depths = _depth_pictures(place, list(poses), depth_range)
    colors = _pictures(place / COLOR, list(poses))
    semantics = _pictures(place / SEMANTIC, list(poses)) if (place / SEMANTIC).is_dir() else {}
    frames = {}
    for identity, pose in poses.items():
        lens = pose.lens or (rig.lens if rig else None)
        if lens is None:
            raise FileError(
                f"{folder / RIG}: no such file, or no camera '{place.name}' in it; {table} has no intrinsics"
            )
        color, depth = colors[identity], depths[identity]
        reading = partial(read_color_of_camera, color), partial(read, depth), lens, pose.pose
        files = FrameFiles((str(color), str(depth)), *reading, partial(picture_hw, color), has_far=True)
        frames[identity] = RenderedFrame(files, semantics.get(identity))
    return frames


def _poses(folder: Path, place: Path, rig: PosedLens | None) -> tuple[Path, dict[int, PosedLens]]:
    """(table, the camera's own poses): from its folder, else the rig's poses and where the camera sits in the rig."""
    if (place / POSES).exists():
        return place / POSES, read_poses(place / POSES)
    if rig is None:
        raise FileError(f"{place / POSES}: no such file")
    poses = read_poses(folder / POSES)
    return folder / POSES, {identity: PosedLens(pose.pose @ rig.pose, pose.lens) for identity, pose in poses.items()}


def _depth_pictures(
    place: Path, identities: list[int], depth_range: float | None
) -> tuple[Callable[[Path], Float32Array], dict[int, Path]]:
    """Pictures, and how each is read: DepthMM (16-bit mm) where it is there, else DepthImage."""
    if (place / MILLIMETRES).is_dir():
        return read_depth, _pictures(place / MILLIMETRES, identities)
    pictures = _pictures(place / DEPTH, identities)
    first = next(iter(pictures.values()))
    if depth_range is None:
        raise DepthError(
            f"{place / DEPTH}: depth is divided by EasySynth's 'Depth range', which no file holds: give `depth_range=METRES`"
        )
    if first.suffix.lower() != ".exr":
        raise DepthError(
            f"{first}: depth as PNG has 256 steps, usually gamma-encoded by Unreal, and as JPEG it is not exact; render "
            "DepthImage as EXR"
        )
    return partial(read_depth, depth_range=depth_range), pictures


def _pictures(folder: Path, identities: list[int]) -> dict[int, Path]:
    """The picture of every frame id. A missing one gets the name it should have: it is an error when it is read.

    Renderings that begin at another frame number than the poses are matched in step, if there are as many.
    """
    found = _by_number(folder)
    shift = min(found) - min(identities)
    if {identity + shift for identity in identities} == set(found):
        return {identity: found[identity + shift] for identity in identities}
    match = PICTURE.fullmatch(next(iter(found.values())).name)
    assert match is not None  # it is how it was found
    return {each: found.get(each, folder / f"{match['stem']}{each:04d}{match['suffix']}") for each in identities}


def _by_number(folder: Path) -> dict[int, Path]:
    found: dict[int, Path] = {}
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        match = PICTURE.fullmatch(path.name)
        if match is None or path.name.startswith("."):
            continue
        number = int(match["number"])
        if number in found:
            raise FileError(f"{path}: is the second picture of frame {number}, next to {found[number].name}")
        found[number] = path
    if not found:
        raise FileError(f"{folder}: no pictures <sequence>.<NNNN>.<jpeg, png or exr> are there")
    return found


def _is_rectified(left: RenderedFrame, right: RenderedFrame) -> bool:
    """By the sensors' sizes: pictures are not opened here."""
    try:
        StereoRig(*(frame.files.lens.camera(frame.files.world_from_cam) for frame in (left, right)))
    except CameraError:
        return False
    return True


def class_mask(frame: RenderedFrame, color: RGB) -> BoolArray:
    """H x W, True where the frame's semantic picture shows exactly this colour (perhaps nowhere). Raises FileError."""
    if frame.semantic is None:
        raise FileError(
            f"{Path(frame.files.names[0]).parents[1] / 'SemanticImage'}: no such folder; removal needs the object's mask"
        )
    if frame.semantic.suffix.lower() in (".jpg", ".jpeg"):
        raise FileError(f"{frame.semantic}: JPEG mixes the colours of the classes; render SemanticImage as PNG")
    return (read_classes(frame.semantic) == np.array(color, np.uint8)).all(axis=2)


def load_view(
    source: RenderedFrame, target: RenderedFrame, without: RenderedFrame | None = None, object_color: RGB | None = None
) -> ViewTruth:
    """VPI: source and true target; the object's mask and `without` as well, where the source shows the object."""
    mask = None if object_color is None or without is None else class_mask(source, object_color)
    if mask is None or without is None or not mask.any():
        return ViewTruth(load_rgbd(source.files), load_rgbd(target.files))
    return ViewTruth(load_rgbd(source.files), load_rgbd(target.files), mask, load_rgbd(without.files))


def load_removal(source: RenderedFrame, without: RenderedFrame, object_color: RGB) -> RemovalTruth:
    """ORI: the frame with the object, the same camera's frame without it, and the object's mask.

    Raises MaskError where the frame does not show the object.
    """
    return RemovalTruth(load_rgbd(source.files), load_rgbd(without.files), _object_mask(source, object_color))


def load_stereo(
    left: RenderedFrame,
    right: RenderedFrame,
    without: tuple[RenderedFrame, RenderedFrame] | None = None,
    object_color: RGB | None = None,
) -> StereoTruth:
    """SII: the pair, its rig, the disparity that its depth means; masks and the pair without the object where asked for.

    Raises MaskError where a view does not show the object, CameraError where the pair is not rectified.
    """
    one, other = load_rgbd(left.files), load_rgbd(right.files)
    try:
        rig = StereoRig(one.camera, other.camera)
    except CameraError as error:
        raise CameraError(f"{left.files.names[0]}, {right.files.names[0]}: {error}") from error
    disparities = true_disparity(rig, one.depth), true_disparity(rig, other.depth)
    if without is None or object_color is None:
        return StereoTruth(one.color, other.color, rig, *disparities)
    masks = _object_mask(left, object_color), _object_mask(right, object_color)
    truths = load_rgbd(without[0].files), load_rgbd(without[1].files)
    return StereoTruth(one.color, other.color, rig, *disparities, *masks, *truths)


def _object_mask(frame: RenderedFrame, color: RGB) -> BoolArray:
    mask = class_mask(frame, color)
    if not mask.any():
        raise MaskError(f"{frame.semantic}: no pixel shows the object's class ({','.join(map(str, color))})")
    return mask
