"""A folder in; which scenes and sequences in EasySynth's layout it holds, and where each frame's files lie, out."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from dlama.datasets.easysynth.frames import RenderedFrame, read_png_depth
from dlama.datasets.easysynth.text_files import PosedLens, read_poses, read_rig
from dlama.datasets.frames import Gamma
from dlama.datasets.posed.posed_frames import FrameFiles
from dlama.datasets.text_tables import folders_in
from dlama.errors import CameraError, DepthError, FileError, InputError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.geometry.camera import StereoRig
from dlama.geometry.rgbd import Float32Array

RIG, POSES = "CameraRig.json", "CameraPoses.csv"
COLOR, DEPTH, SEMANTIC, MILLIMETRES = "ColorImage", "DepthImage", "SemanticImage", "DepthMM"
PICTURE = re.compile(r"(?P<stem>.*\D|)(?P<number>\d+)(?P<suffix>\.(?:png|jpe?g|exr))", re.IGNORECASE)
"""<Sequence>.<NNNN>.<png, jpeg or exr>."""

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


def read_sequence(folder: Path, depth_range: float | None, gamma: Gamma | None) -> RenderedSequence:
    """The frames of one rendering output folder; pictures are not opened. depth_range, gamma: as in `easysynth`.

    Raises FileError, CameraError, DepthError, InputError.
    """
    if gamma not in ("srgb", "linear", None):
        raise InputError(f"`gamma` is {gamma!r}; 'srgb' or 'linear' is expected")
    rig = read_rig(folder / RIG) if (folder / RIG).exists() else {}
    places = {each.name: each for each in _folders(folder) if (each / COLOR).is_dir()}
    missing = [name for name in rig if name not in places]
    if missing:
        raise FileError(f"{folder / missing[0] / COLOR}: no such folder; {folder / RIG} has a camera '{missing[0]}'")
    cameras = {name: _camera(folder, place, rig.get(name), depth_range, gamma) for name, place in places.items()}
    return RenderedSequence(folder, cameras)


def _is_sequence(folder: Path) -> bool:
    if not ((folder / RIG).is_file() or (folder / POSES).is_file()):
        return False
    return any((each / COLOR).is_dir() for each in _folders(folder))


def _folders(root: Path) -> list[Path]:
    return sorted(folders_in(root)) if root.is_dir() else []


def _camera(
    folder: Path, place: Path, rig: PosedLens | None, depth_range: float | None, gamma: Gamma | None
) -> dict[int, RenderedFrame]:
    """The frames of one camera, by id."""
    table, poses = _poses(folder, place, rig)
    read, depths = _depth_pictures(place, list(poses), depth_range, gamma)
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
        frames[identity] = RenderedFrame(files, color, semantics.get(identity))
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
    place: Path, identities: list[int], depth_range: float | None, gamma: Gamma | None
) -> tuple[Callable[[Path], Float32Array], dict[int, Path]]:
    """Pictures, and how each is read: DepthMM (16-bit mm) where it is there, else DepthImage, if the options say how."""
    if (place / MILLIMETRES).is_dir():
        return read_depth, _pictures(place / MILLIMETRES, identities)
    pictures = _pictures(place / DEPTH, identities)
    first = next(iter(pictures.values()))
    if depth_range is None:
        raise DepthError(
            f"{place / DEPTH}: depth is divided by EasySynth's 'Depth range', which no file holds: give `depth_range=METRES`"
        )
    if first.suffix.lower() == ".exr":
        return partial(read_depth, depth_range=depth_range), pictures
    if first.suffix.lower() != ".png":
        raise DepthError(f"{first}: depth as JPEG is not exact; render DepthImage as EXR")
    if gamma is None:
        raise DepthError(
            f"{first}: depth as PNG has 256 steps and is usually gamma-encoded by Unreal; render it as EXR, or say how it is "
            "encoded: `gamma=srgb` (to be undone) or `gamma=linear`"
        )
    return partial(read_png_depth, depth_range=depth_range, gamma=gamma), pictures


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
