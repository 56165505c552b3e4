"""A dataset case in -> its parts as the bytes of picture files, and its entry in a pack's index, out; a pack file in -> its
photos and cases, read on demand, out.

Colours are WebP; depth is 16-bit PNG of millimetres (0 = missing, 65535 = far), disparity of 1/64 px (0 = unknown); masks are
8-bit PNG. What training does not read (a stereo pair's rig, cast shadows) is left out. The index calls cases `takes`.
"""

from __future__ import annotations

import functools
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.datasets.frames import RemovalTruth, ViewTruth
from dlama.errors import DlamaError, FileError, ShapeError
from dlama.files.rasters.depth import MILLIMETRES, depth_from_mm, mm_from_depth
from dlama.files.rasters.images import picture_of_bytes
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.training.data.cases import KIND_NAMES, StereoPair, TrainingCase
from dlama.training.data.crops import resize_color, resize_disparity, resize_frame, resize_mask, scale_size
from dlama.training.data.photos import Photo

FORMAT, VERSION, INDEX = "dlama pack", 2, "index.json"
PHOTOS, CASES = "photos", "takes"
"""Tables of the index."""
QUALITY = 88
"""Of WebP; the pictures of a pair are to agree with their depth, photos are usually JPEG already."""
DISPARITY_STEPS = 64.0
"""Of a pixel."""

Parts = dict[str, bytes]
"""Role (such as source.color) -> bytes of a picture file."""
About = dict[str, Any]
"""Cameras by the role of their frame, and whether exposure varies."""
ReadRole = Callable[[str], np.ndarray]
"""Role -> picture: H x W x 3 RGB, or H x W as it is stored."""


def _decode_frame(about: Mapping[str, Any], roles: frozenset[str], read: ReadRole) -> ViewTruth:
    ends = [_frame(about, end, read) for end in ("source", "target")]
    return ViewTruth(ends[0], ends[1], exposure_varies=bool(about["exposure_varies"]))


def _encode_removal(truth: RemovalTruth, size: int) -> tuple[About, Parts]:
    about, parts = _frames({"source": truth.source, "without": truth.without}, truth.exposure_varies, size)
    hw = scale_size(truth.source.camera.hw, _factor(truth.source.camera.hw, size))
    parts["mask"] = _mask_png(resize_mask(truth.mask, hw))
    if truth.compare is not None:
        parts["compare"] = _mask_png(~resize_mask(~truth.compare, hw))
    return about, parts


def _decode_removal(about: Mapping[str, Any], roles: frozenset[str], read: ReadRole) -> RemovalTruth:
    source, without = (_frame(about, end, read) for end in ("source", "without"))
    hw = source.camera.hw
    compare = _read_picture("compare", read, hw) > 0 if "compare" in roles else None
    mask = _read_picture("mask", read, hw) > 0
    return RemovalTruth(source, without, mask, compare, exposure_varies=bool(about["exposure_varies"]))


def _read_picture(role: str, read: ReadRole, hw: tuple[int, ...]) -> np.ndarray:
    """The picture of a role, which must be of that shape; ShapeError."""
    picture = read(role)
    if picture.shape != hw:
        raise ShapeError(f"{role} has shape {picture.shape}; {hw} is expected")
    return picture


def _encode_stereo(pair: StereoPair, size: int) -> tuple[About, Parts]:
    before = pair.left.shape[0], pair.left.shape[1]
    hw = scale_size(before, _factor(before, size))
    parts = {"left.color": webp(resize_color(pair.left, hw)), "right.color": webp(resize_color(pair.right, hw))}
    disparity = resize_disparity(pair.disparity, hw)
    known_disparity = np.where(np.isfinite(disparity), disparity, np.float32(0))
    parts["disparity"] = _png(_codes(known_disparity, DISPARITY_STEPS))
    for number, side in enumerate(("left", "right")):
        if pair.masks is not None and pair.without is not None:
            parts[f"{side}.without"] = webp(resize_color(pair.without[number], hw))
            parts[f"{side}.mask"] = _mask_png(resize_mask(pair.masks[number], hw))
    return {}, parts


def _decode_stereo(about: Mapping[str, Any], roles: frozenset[str], read: ReadRole) -> StereoPair:
    left = read("left.color")
    hw = left.shape[:2]
    right = _read_picture("right.color", read, (*hw, 3))
    disparity = (_read_picture("disparity", read, hw) / DISPARITY_STEPS).astype(np.float32)
    if "left.mask" not in roles:
        return StereoPair(left, right, disparity)
    masks = _read_picture("left.mask", read, hw) > 0, _read_picture("right.mask", read, hw) > 0
    without = _read_picture("left.without", read, (*hw, 3)), _read_picture("right.without", read, (*hw, 3))
    return StereoPair(left, right, disparity, masks, without)


ENCODERS: dict[str, Callable[[Any, int], tuple[About, Parts]]] = {
    "frame": lambda view, size: _frames({"source": view.source, "target": view.target}, view.exposure_varies, size),
    "removal": _encode_removal,
    "stereo": _encode_stereo,
}
"""Kind -> what turns that which `TrainingCase.load` gives, with its smaller side brought down to so many px, into an index entry
and parts."""
DECODERS: dict[str, Callable[[Mapping[str, Any], frozenset[str], ReadRole], Any]] = {
    "frame": _decode_frame,
    "removal": _decode_removal,
    "stereo": _decode_stereo,
}
"""Kind -> the way back, from an index entry and the roles of a case. KeyError, TypeError, DlamaError where the entry is wrong."""


def _frames(ends: Mapping[str, RGBD], exposure_varies: bool, size: int) -> tuple[About, Parts]:
    cameras, parts = {}, {}
    for end, rgbd in ends.items():
        small = resize_frame(rgbd, _factor(rgbd.camera.hw, size))
        parts[f"{end}.color"], parts[f"{end}.depth"] = webp(small.color), depth_png(small.depth)
        cameras[end] = _camera_entry(small.camera)
    return {"exposure_varies": exposure_varies, "cameras": cameras}, parts


def _frame(about: Mapping[str, Any], end: str, read: ReadRole) -> RGBD:
    return RGBD(read(f"{end}.color"), depth_from_mm(read(f"{end}.depth")), _camera(about["cameras"][end]))


def _factor(hw: tuple[int, int], size: int) -> float:
    return min(1.0, size / min(hw))


def _camera_entry(camera: Camera) -> dict[str, Any]:
    numbers = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    return numbers | {"world_from_cam": camera.world_from_cam.tolist()}


def _camera(entry: dict[str, Any]) -> Camera:
    return Camera(**{**entry, "world_from_cam": np.array(entry["world_from_cam"])})


def webp(color: UInt8Array) -> bytes:
    """H x W x 3 RGB as a WebP file."""
    bgr = np.ascontiguousarray(color[..., ::-1])
    return bytes(cv2.imencode(".webp", bgr, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1])


def depth_png(depth: Float32Array) -> bytes:
    """H x W metres as a 16-bit PNG file of millimetres."""
    return _png(_codes(depth, MILLIMETRES))


def _codes(values: Float32Array, per_unit: float) -> np.ndarray:
    """H x W uint16 of steps of 1 / per_unit: 0 where there is no value, 65535 where it is infinite, else 1 to 65534.

    The steps are counted in float32, as packs always did.
    """
    return mm_from_depth(values * np.float32(per_unit), units=1.0)[0]


def _mask_png(mask: BoolArray) -> bytes:
    return _png(mask.astype(np.uint8) * np.uint8(255))


def _png(codes: np.ndarray) -> bytes:
    return bytes(cv2.imencode(".png", codes, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])


Places = dict[str, tuple[int, int]]
"""Name of a part -> where its header begins in the file, and its length in bytes."""


def _read_index(path: Path) -> tuple[Any, Places]:
    """The index of a pack, and where each part lies: offset and size. FileError."""
    try:
        size = path.stat().st_size
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
            if any(
                part.compress_type != zipfile.ZIP_STORED or part.header_offset + part.file_size > size for part in parts
            ):
                raise FileError(
                    f"{path}: is no pack that `dlama pack` wrote: a part is compressed, or longer than the file"
                )
            return json.loads(archive.read(INDEX)), {
                part.filename: (part.header_offset, part.file_size) for part in parts
            }
    except FileError:
        raise
    except Exception as error:  # OSError, KeyError, ValueError, BadZipFile, NotImplementedError, RecursionError, ...
        raise FileError(f"{path}: is no pack that `dlama pack` wrote, or is damaged ({error})") from error


def read_pack(path: Path) -> tuple[tuple[Photo, ...], tuple[TrainingCase, ...]]:
    """The photos and cases of a pack; nothing but the index is read. FileError where the file is no pack, or damaged."""
    index, at = _read_index(path)
    if not isinstance(index, dict) or index.get("format") != FORMAT or index.get("version") != VERSION:
        raise FileError(f"{path}: its {INDEX} does not say '{FORMAT}', version {VERSION}")
    try:
        photos = tuple(
            Photo(each["name"], functools.partial(load_photo, path, each["file"], at[each["file"]]))
            for each in index[PHOTOS]
        )
        return photos, tuple(_case_of_entry(path, each, at) for each in index[CASES])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FileError(f"{path}: its {INDEX} is incomplete: {error} is missing or of the wrong kind") from error


def _case_of_entry(path: Path, entry: dict[str, Any], at: Places) -> TrainingCase:
    if entry["kind"] not in KIND_NAMES:
        raise FileError(f"{path}: its {INDEX} has a case of kind {entry['kind']!r}; {', '.join(KIND_NAMES)} are known")
    places = {part: at[part] for part in entry["parts"].values()}
    load = functools.partial(load_case, path, entry, places)
    return TrainingCase(entry["kind"], entry["scene"], entry["name"], frozenset(entry["frames"]), load)


def load_photo(path: Path, name: str, place: tuple[int, int]) -> UInt8Array:
    """H x W x 3 RGB; FileError."""
    picture = _read_part(path, name, place)
    if picture.ndim != 3:
        raise FileError(f"{path}: {name} is grey; colours are expected")
    return picture


def load_case(path: Path, entry: dict[str, Any], places: Places) -> Any:
    """What `TrainingCase.load` gives of this kind; FileError."""
    parts: dict[str, str] = entry["parts"]

    def read(role: str) -> np.ndarray:
        return _read_part(path, parts[role], places[parts[role]])

    try:
        return DECODERS[entry["kind"]](entry, frozenset(parts), read)
    except FileError:
        raise
    except (DlamaError, TypeError, KeyError, ValueError, AttributeError, OverflowError, IndexError) as error:
        raise FileError(f"{path}: {entry['scene']} {entry['name']}: {error}") from error


def _read_part(path: Path, name: str, place: tuple[int, int]) -> np.ndarray:
    """The picture of one part. Parts are not compressed, so they are read without a directory."""
    start, length = place
    try:
        with path.open("rb") as stream:
            stream.seek(start)
            head = stream.read(30)
            stream.seek(start + 30 + int.from_bytes(head[26:28], "little") + int.from_bytes(head[28:30], "little"))
            data = stream.read(length)
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    return np.array(picture_of_bytes(data, f"{path}: {name}", ("PNG", "WEBP")))
