"""Files of one EasySynth frame in (colour, depth, semantics); RGBD and the truths of the protocols out. Units end here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Gamma, RemovalTruth, StereoTruth, ViewTruth, true_disparity
from dlama.datasets.posed.posed_frames import FrameFiles, load_rgbd
from dlama.errors import CameraError, DepthError, FileError, MaskError
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import read_classes
from dlama.files.semantic_classes import RGB
from dlama.geometry.camera import StereoRig
from dlama.geometry.rgbd import BoolArray, Float32Array

SRGB_LINEAR_BELOW = 0.04045
"""IEC 61966-2-1."""


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """Where one frame lies, and how it is to be read."""

    files: FrameFiles
    color: Path
    semantic: Path | None


def class_mask(frame: RenderedFrame, color: RGB) -> BoolArray:
    """H x W, True where the frame's semantic picture shows exactly this colour (perhaps nowhere). Raises FileError."""
    if frame.semantic is None:
        raise FileError(
            f"{frame.color.parent.parent / 'SemanticImage'}: no such folder; removal needs the object's mask"
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
        raise CameraError(f"{left.color}, {right.color}: {error}") from error
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


def read_png_depth(path: Path, depth_range: float, gamma: Gamma) -> Float32Array:
    """H x W metres of a DepthImage in 8 bit; its largest value is far, 0 is missing. DepthError, FileError."""
    stored = read_stored(path).values
    values = stored if stored.ndim == 2 else stored[..., 0]
    if stored.dtype != np.uint8 or (stored.ndim == 3 and (stored[..., :3] != values[..., None]).any()):
        raise DepthError(f"{path}: is {stored.dtype} {stored.shape}; 8-bit grey is what EasySynth writes as PNG depth")
    share = values / 255.0
    if gamma == "srgb":
        share = np.where(share <= SRGB_LINEAR_BELOW, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.where(values == 255, np.inf, share * depth_range).astype(np.float32)
