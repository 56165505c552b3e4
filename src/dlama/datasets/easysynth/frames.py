"""Files of one EasySynth frame in (colour, depth, semantics); RGBD and the truths of the protocols out. Units end here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from dlama.datasets.easysynth.shadow import cast_shadow
from dlama.datasets.easysynth.text_files import Sensor
from dlama.datasets.frames import Gamma, RemovalTruth, StereoTruth, ViewTruth
from dlama.errors import CameraError, DepthError, FileError, MaskError
from dlama.files.rasters.depth import read_depth
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import read_color
from dlama.files.semantic_classes import RGB
from dlama.geometry.camera import Camera, Float64Array, StereoRig
from dlama.geometry.projection import disparity_from_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array

DepthKind = Literal["millimetres", "exr", "png"]
"""DepthMM (our addition, 16-bit mm, full range), or DepthImage as EXR, or as PNG."""
SRGB_LINEAR_BELOW = 0.04045
"""IEC 61966-2-1."""


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """Where one frame lies, and how it is to be read."""

    color: Path
    depth: Path
    kind: DepthKind
    semantic: Path | None
    sensor: Sensor
    world_from_cam: Float64Array
    """4x4, OpenCV axes, metres."""
    depth_range: float | None = None
    """Metres that 1.0 stands for in DepthImage."""
    gamma: Gamma | None = None
    """How an 8-bit DepthImage is encoded."""


def load_frame(files: RenderedFrame) -> RGBD:
    """Colour, depth and camera of one frame. Raises FileError, DepthError, CameraError, ShapeError."""
    color = read_color(files.color)
    return RGBD(color, _depth(files), files.sensor.camera(color.shape[:2], files.world_from_cam))


def load_depth(files: RenderedFrame) -> tuple[Float32Array, Camera]:
    """The depth of `load_frame` (H x W, metres) and its camera, without the colour."""
    depth = _depth(files)
    return depth, files.sensor.camera(depth.shape[:2], files.world_from_cam)


def class_mask(files: RenderedFrame, color: RGB) -> BoolArray:
    """H x W, True where the frame's semantic picture shows exactly this colour (perhaps nowhere). Raises FileError."""
    if files.semantic is None:
        raise FileError(
            f"{files.color.parent.parent / 'SemanticImage'}: no such folder; removal needs the object's mask"
        )
    if files.semantic.suffix.lower() in (".jpg", ".jpeg"):
        raise FileError(f"{files.semantic}: JPEG mixes the colours of the classes; render SemanticImage as PNG")
    return (read_color(files.semantic) == np.array(color, np.uint8)).all(axis=2)


def load_view(
    source: RenderedFrame, target: RenderedFrame, without: RenderedFrame | None = None, object_color: RGB | None = None
) -> ViewTruth:
    """VPI: source and true target; the object's mask and `without` as well, where the source shows the object."""
    mask = None if object_color is None or without is None else class_mask(source, object_color)
    if mask is None or without is None or not mask.any():
        return ViewTruth(load_frame(source), load_frame(target))
    return ViewTruth(load_frame(source), load_frame(target), mask, load_frame(without))


def load_removal(source: RenderedFrame, without: RenderedFrame, object_color: RGB) -> RemovalTruth:
    """ORI: the frame with the object, the same camera's frame without it, the object's mask and its cast shadow.

    Raises MaskError where the frame does not show the object.
    """
    frame, truth, mask = load_frame(source), load_frame(without), _object_mask(source, object_color)
    return RemovalTruth(frame, truth, mask, shadow=cast_shadow(frame.color, truth.color, mask))


def load_stereo(
    left: RenderedFrame,
    right: RenderedFrame,
    without: tuple[RenderedFrame, RenderedFrame] | None = None,
    object_color: RGB | None = None,
) -> StereoTruth:
    """SII: the pair, its rig, the disparity that its depth means; masks and the pair without the object where asked for.

    Raises MaskError where a view does not show the object, CameraError where the pair is not rectified.
    """
    one, other = load_frame(left), load_frame(right)
    try:
        rig = StereoRig(one.camera, other.camera)
    except CameraError as error:
        raise CameraError(f"{left.color}, {right.color}: {error}") from error
    disparities = _disparity(rig, one.depth), _disparity(rig, other.depth)
    if without is None or object_color is None:
        return StereoTruth(one.color, other.color, rig, *disparities)
    masks = _object_mask(left, object_color), _object_mask(right, object_color)
    truths = load_frame(without[0]), load_frame(without[1])
    return StereoTruth(one.color, other.color, rig, *disparities, *masks, *truths)


def _object_mask(files: RenderedFrame, color: RGB) -> BoolArray:
    mask = class_mask(files, color)
    if not mask.any():
        raise MaskError(f"{files.semantic}: no pixel shows the object's class ({','.join(map(str, color))})")
    return mask


def _disparity(rig: StereoRig, depth: Float32Array) -> Float32Array:
    """H x W px; 0 where depth is missing, or disparity is not > 0."""
    disparity = disparity_from_depth(depth, fx=rig.left.fx, baseline_m=rig.baseline_m, doffs=rig.doffs)
    return np.maximum(disparity, 0)


def _depth(files: RenderedFrame) -> Float32Array:
    if files.kind == "millimetres":
        return read_depth(files.depth)
    if files.kind == "exr":
        return read_depth(files.depth, depth_range=files.depth_range)
    return _png_depth(files)


def _png_depth(files: RenderedFrame) -> Float32Array:
    """Metres of a DepthImage in 8 bit; its largest value is far, 0 is missing."""
    stored = read_stored(files.depth).values
    values = stored if stored.ndim == 2 else stored[..., 0]
    if stored.dtype != np.uint8 or (stored.ndim == 3 and (stored[..., :3] != values[..., None]).any()):
        raise DepthError(
            f"{files.depth}: is {stored.dtype} {stored.shape}; 8-bit grey is what EasySynth writes as PNG depth"
        )
    share = values / 255.0
    if files.gamma == "srgb":
        share = np.where(share <= SRGB_LINEAR_BELOW, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    assert files.depth_range is not None  # the listing has refused this
    depth = np.where(values == 255, np.inf, share * files.depth_range)
    return depth.astype(np.float32)
