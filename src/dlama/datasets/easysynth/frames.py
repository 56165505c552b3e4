"""Files of one EasySynth frame in (colour, depth, semantics); RGBD and the truths of the protocols out. Units end here.

The shadow that an object casts is what differs between a frame with it and one without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.frames import Gamma, RemovalTruth, StereoTruth, ViewTruth
from dlama.datasets.posed.posed_frames import FrameFiles, load_rgbd
from dlama.errors import CameraError, DepthError, FileError, MaskError
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import read_classes
from dlama.files.semantic_classes import RGB
from dlama.geometry.camera import StereoRig
from dlama.geometry.holes import box_around, box_mean, dilate_mask, larger_box, sides_of
from dlama.geometry.projection import disparity_from_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

EDGE_PX = 3
"""Round the mask colour is a mix of object and background (anti-aliasing, JPEG ringing), neither object nor shadow."""
SMOOTHING_PX = 5
"""Side of the box over which darkening is averaged: noise and compression are finer than any shadow."""
DARKER_LEVELS = 6.0
DARKER_SHARE = 0.08
"""A shadow takes away this many levels and this share of the light (of luma without the object)."""
SMALLEST_SHARE = 2e-4
"""Of the picture, 50 px of 512 x 512; smaller darkened regions are noise."""
NEIGHBOURHOOD = 1.5
"""A shadow may lie as far from the object's box as this many times the box's diagonal."""
SAME_EXPOSURE_LEVELS = 2.0


def cast_shadow(color: UInt8Array, without: UInt8Array, mask: BoolArray) -> BoolArray | None:
    """H x W, True = in the object's shadow and not (near) the object; None where it cannot be found or there is none.

    Darkening is luma without the object minus luma with it, averaged over a box of SMOOTHING_PX. A pixel is dark where that is
    at least DARKER_LEVELS and DARKER_SHARE of its luma without. The shadow is all 8-connected regions of dark pixels that
    touch the neighbourhood of the object (its box grown by NEIGHBOURHOOD diagonals), lie outside the mask dilated by EDGE_PX
    and cover at least SMALLEST_SHARE of the picture. A change of colour without darkening is no shadow.
    None as well where the medians outside say that the two frames differ in exposure. color, without: H x W x 3 uint8 RGB.
    """
    if not mask.any() or mask.all():
        return None
    near = dilate_mask(mask, EDGE_PX)
    if near.all():
        return None
    before, after = (np.asarray(cv2.cvtColor(each, cv2.COLOR_RGB2GRAY), np.float32) for each in (color, without))
    if np.abs(np.median((after - before)[~near])) > SAME_EXPOSURE_LEVELS:
        return None
    outside = (~near).astype(np.float32)  # the object's own change must not bleed out
    lost, light = (box_mean(each, outside, SMOOTHING_PX) for each in (after - before, after))
    dark = ~near & (lost >= DARKER_LEVELS) & (lost >= DARKER_SHARE * light)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= SMALLEST_SHARE * mask.size
    large[0] = False  # what is not dark
    touching = np.zeros(len(stats), bool)
    tight = box_around(mask, 0)
    nearby = larger_box(tight, int(NEIGHBOURHOOD * np.hypot(*sides_of(tight))), mask.shape)
    touching[np.unique(labels[nearby])] = True
    shadow = (large & touching)[labels]
    return shadow if shadow.any() else None


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
    """ORI: the frame with the object, the same camera's frame without it, the object's mask and its cast shadow.

    Raises MaskError where the frame does not show the object.
    """
    frame, truth, mask = load_rgbd(source.files), load_rgbd(without.files), _object_mask(source, object_color)
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
    one, other = load_rgbd(left.files), load_rgbd(right.files)
    try:
        rig = StereoRig(one.camera, other.camera)
    except CameraError as error:
        raise CameraError(f"{left.color}, {right.color}: {error}") from error
    disparities = _disparity(rig, one.depth), _disparity(rig, other.depth)
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


def _disparity(rig: StereoRig, depth: Float32Array) -> Float32Array:
    """H x W px; 0 where depth is missing, or disparity is not > 0."""
    disparity = disparity_from_depth(depth, fx=rig.left.fx, baseline_m=rig.baseline_m, doffs=rig.doffs)
    return np.maximum(disparity, 0)


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
