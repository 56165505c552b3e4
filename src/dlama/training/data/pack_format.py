"""A take in -> its parts as the bytes of picture files, and what the index of a pack says of it, out; and back.

Colours are WebP; depth is 16-bit PNG of millimetres (0 = missing, 65535 = far), disparity of 1/64 px (0 = unknown); masks are
8-bit PNG. What training does not read (a stereo pair's rig, cast shadows) is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dlama.datasets.frames import RemovalTruth, ViewTruth
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.training.data.cases import StereoPair
from dlama.training.data.crops import resized, resized_color, resized_disparity, resized_mask, scaled

FORMAT, VERSION, INDEX = "dlama pack", 2, "index.json"
"""Version 1 held photos and pairs of posed frames only, under other names; it is still read."""
QUALITY = 88
"""Of WebP; the pictures of a pair are to agree with their depth, photos are usually JPEG already."""
MILLIMETRES, FAR_CODE = 1000.0, 65535
DISPARITY_STEPS = 64.0
"""Of a pixel."""

Parts = dict[str, bytes]
"""Role (such as source.color) -> picture file."""
About = dict[str, Any]
"""Cameras by the frame they took, and whether exposure varies."""
Read = Callable[[str], np.ndarray]
"""Role -> picture: H x W x 3 RGB, or H x W as it is stored."""


def packed(kind: str, truth: Any, size: int) -> tuple[About, Parts]:
    """What `Take.load` of that kind gives, with the smaller side brought down to `size` px where it is larger."""
    return _PACKERS[kind](truth, size)


def unpacked(kind: str, about: Mapping[str, Any], roles: frozenset[str], read: Read) -> Any:
    """What `Take.load` gives, from a pack that has these roles. KeyError, TypeError, DlamaError where the index is wrong."""
    return _UNPACKERS[kind](about, roles, read)


def _pack_frame(truth: ViewTruth, size: int) -> tuple[About, Parts]:
    return _frames({"source": truth.source, "target": truth.target}, truth.exposure_varies, size)


def _unpack_frame(about: Mapping[str, Any], roles: frozenset[str], read: Read) -> ViewTruth:
    ends = [_frame(about, end, read) for end in ("source", "target")]
    return ViewTruth(ends[0], ends[1], exposure_varies=bool(about["exposure_varies"]))


def _pack_removal(truth: RemovalTruth, size: int) -> tuple[About, Parts]:
    about, parts = _frames({"source": truth.source, "without": truth.without}, truth.exposure_varies, size)
    hw = scaled(truth.source.camera.hw, _factor(truth.source.camera.hw, size))
    parts["mask"] = _mask_png(resized_mask(truth.mask, hw))
    if truth.compare is not None:
        parts["compare"] = _mask_png(~resized_mask(~truth.compare, hw))
    return about, parts


def _unpack_removal(about: Mapping[str, Any], roles: frozenset[str], read: Read) -> RemovalTruth:
    source, without = (_frame(about, end, read) for end in ("source", "without"))
    compare = read("compare") > 0 if "compare" in roles else None
    return RemovalTruth(source, without, read("mask") > 0, compare, exposure_varies=bool(about["exposure_varies"]))


def _pack_stereo(pair: StereoPair, size: int) -> tuple[About, Parts]:
    before = pair.left.shape[0], pair.left.shape[1]
    hw = scaled(before, _factor(before, size))
    parts = {"left.color": webp(resized_color(pair.left, hw)), "right.color": webp(resized_color(pair.right, hw))}
    parts["disparity"] = _png(_codes(resized_disparity(pair.disparity, hw), DISPARITY_STEPS))
    for number, side in enumerate(("left", "right")):
        if pair.masks is not None and pair.without is not None:
            parts[f"{side}.without"] = webp(resized_color(pair.without[number], hw))
            parts[f"{side}.mask"] = _mask_png(resized_mask(pair.masks[number], hw))
    return {}, parts


def _unpack_stereo(about: Mapping[str, Any], roles: frozenset[str], read: Read) -> StereoPair:
    disparity = (read("disparity") / DISPARITY_STEPS).astype(np.float32)
    left, right = read("left.color"), read("right.color")
    if "left.mask" not in roles:
        return StereoPair(left, right, disparity)
    masks = read("left.mask") > 0, read("right.mask") > 0
    return StereoPair(left, right, disparity, masks, (read("left.without"), read("right.without")))


_PACKERS: dict[str, Callable[[Any, int], tuple[About, Parts]]] = {
    "frame": _pack_frame,
    "removal": _pack_removal,
    "stereo": _pack_stereo,
}
_UNPACKERS: dict[str, Callable[[Mapping[str, Any], frozenset[str], Read], Any]] = {
    "frame": _unpack_frame,
    "removal": _unpack_removal,
    "stereo": _unpack_stereo,
}


def _frames(ends: Mapping[str, RGBD], exposure_varies: bool, size: int) -> tuple[About, Parts]:
    cameras, parts = {}, {}
    for end, rgbd in ends.items():
        small = resized(rgbd, _factor(rgbd.camera.hw, size))
        parts[f"{end}.color"], parts[f"{end}.depth"] = webp(small.color), png(small.depth)
        cameras[end] = _camera_entry(small.camera)
    return {"exposure_varies": exposure_varies, "cameras": cameras}, parts


def _frame(about: Mapping[str, Any], end: str, read: Read) -> RGBD:
    return RGBD(read(f"{end}.color"), _metres(read(f"{end}.depth")), _camera(about["cameras"][end]))


def _factor(hw: tuple[int, int], size: int) -> float:
    return min(1.0, size / min(hw))


def _camera_entry(camera: Camera) -> dict[str, Any]:
    numbers = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    return numbers | {"world_from_cam": camera.world_from_cam.tolist()}


def _camera(entry: dict[str, Any]) -> Camera:
    return Camera(**{**entry, "world_from_cam": np.array(entry["world_from_cam"])})


def webp(color: UInt8Array) -> bytes:
    """H x W x 3 RGB as a WebP file."""
    import cv2

    bgr = np.ascontiguousarray(color[..., ::-1])
    return bytes(cv2.imencode(".webp", bgr, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1])


def png(depth: Float32Array) -> bytes:
    """H x W metres as a 16-bit PNG file of millimetres."""
    codes = np.where(np.isposinf(depth), np.uint16(FAR_CODE), _codes(depth, MILLIMETRES))
    return _png(codes)


def _codes(values: Float32Array, per_unit: float) -> np.ndarray:
    """H x W uint16: 0 where the value is none (0 or infinite), else 1 to 65534."""
    valid = (values > 0) & (values < np.inf)
    codes = np.clip(np.rint(np.where(valid, values, 0) * per_unit), 1, FAR_CODE - 1)
    return np.where(valid, codes, 0).astype(np.uint16)


def _metres(codes: np.ndarray) -> Float32Array:
    return np.where(codes == FAR_CODE, np.float32(np.inf), (codes / MILLIMETRES).astype(np.float32)).astype(np.float32)


def _mask_png(mask: BoolArray) -> bytes:
    return _png(mask.astype(np.uint8) * np.uint8(255))


def _png(codes: np.ndarray) -> bytes:
    import cv2

    return bytes(cv2.imencode(".png", codes, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])
