"""A photo in; the depth that its file carries, turned as viewers show it, and what the file says of it, out; None without any.

HEIC: the depth image (ISO/IEC 23008-12, 6.9.6) with Apple's XMP (`ns.apple.com/pixeldatainfo/1.0`, `ns.apple.com/depthData/1.0`):
disparity in 1/m, depth in m, as of AVDepthData. JPEG: Apple's depth as a further picture (CIPA DC-007) with the same XMP;
Android's Dynamic Depth 1.0 (developer.android.com/static/training/camera2/Dynamic-depth-v1.0.pdf); the older GDepth
(developers.google.com/depthmap-metadata); the second view of a stereo photo (MPO), matched.
"""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dlama.errors import DepthError, any_error, format_size
from dlama.files.cameras import focal_of_film
from dlama.files.photos.containers import (
    JPEG_BEGINS,
    STEREO,
    Xmp,
    find_baseline,
    find_xmp,
    list_container_items,
    list_further_pictures,
    merge_xmp,
)
from dlama.files.photos.stereo import match_stereo_photo
from dlama.files.rasters.color_profiles import rgb_to_srgb
from dlama.files.rasters.images import (
    HEIC,
    check_pixels,
    existing_file,
    open_heif,
    orientation_of,
    picture_hw,
    read_stored,
)
from dlama.files.rasters.orientation import apply_orientation, decoder_orientation
from dlama.files.rasters.pictures import srgb_of
from dlama.files.rasters.turned_pairs import same_proportions
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.writing.atomic_write import PathLike

APDI, DEPTH_DATA = "{http://ns.apple.com/pixeldatainfo/1.0/}", "{http://ns.apple.com/depthData/1.0/}"
GDEPTH = "{http://ns.google.com/photos/1.0/depthmap/}"
DYNAMIC = "{http://ns.google.com/photos/dd/1.0/depthmap/}"
PHOTO_PROPORTIONS = 0.03
"""Relative difference of width / height up to which depth shows what the picture shows (Apple's have 768x576 for 4032x3024)."""
METRE_UNITS = {"m": 1.0, "meters": 1.0, "metres": 1.0, "mm": 1e-3}
HEIF_KINDS = {0: "inverse depth", 1: "disparity", 2: "depth", 3: "disparity"}
"""depth_representation_type (ITU-T H.265, table F.5): the numbers are linear in this; it has no unit."""


@dataclass(frozen=True, eq=False)
class PhotoDepth:
    """Depth as a photo carries it, or as a network gave it."""

    values: Float32Array
    """h x w inverse depth at its own size, turned as the picture is shown; larger is nearer, 0 and less is far."""
    metric: bool
    """Whether that is in 1/m by the file; else it is known up to a factor and a shift."""
    camera: Camera | None = None
    """The picture's camera, where the file has a calibration."""
    along_ray: bool = False
    """Whether depth counts along the ray of each pixel and not along the optical axis."""
    about: dict[str, Any] = field(default_factory=dict)
    """For meta.json: `source`, `size`, `accuracy`, `at_far_limit_share`, ..."""
    by: str = "the photo's own depth"
    """What gave it, for meta.json: its `estimator`."""

    @property
    def absolute(self) -> bool:
        """Whether the file's metres are meant to be true ones; a phone's "relative" ones serve to blur a background."""
        return self.metric and self.about.get("accuracy") != "relative"


def read_photo_depth(path: PathLike) -> PhotoDepth | None:
    """The depth in a photo's file; None where there is none, or the file is no photo.

    Raises FileError, and DepthError where there is depth that cannot be used, with the reason.
    """
    file = existing_file(path)
    data = file.read_bytes()
    heic = HEIC.match(data[:12]) is not None
    if not (heic or data.startswith(JPEG_BEGINS)):
        return None
    with any_error(DepthError, f"{file}: the depth in it is damaged"):
        opened = open_heif(file, io.BytesIO(data), convert_hdr_to_8bit=False) if heic else None
        hw = picture_hw(file) if opened is None else (opened.size[1], opened.size[0])  # not decoded
        found = _of_google(file, data)
        if found is None:
            found = _of_further_picture(file, data, hw) if opened is None else _of_heic(file, data, opened, hw)
    if found is not None:
        shape = found.values.shape
        if not same_proportions(shape, hw, PHOTO_PROPORTIONS):
            raise DepthError(
                f"{file}: the depth in it is {format_size(shape)} and the picture {format_size(hw)}; they do not show the same"
            )
    return found


def _of_heic(file: Path, data: bytes, opened: Any, hw: tuple[int, int]) -> PhotoDepth | None:
    images = opened.info.get("depth_images") or []
    if not images:
        return None
    check_pixels(file, *images[0].size)
    codes, metadata = np.asarray(images[0].to_pillow()), images[0].info.get("metadata") or {}
    orientation = decoder_orientation(opened)
    if orientation >= 5 and (codes.shape[0] > codes.shape[1]) != (opened.size[1] > opened.size[0]):
        codes = apply_orientation(codes, orientation)  # of a writer that turns the picture alone
    packet = _apple_packet(data)
    if packet is not None:
        return _of_apple(codes, packet, orientation, hw, "HEIC, Apple")
    kind = HEIF_KINDS.get(metadata.get("representation_type", -1)) if metadata else None
    if kind is None:
        raise DepthError(f"{file}: the depth image in it has no word of what its numbers mean")
    about = {"source": f"HEIC, {kind}", **_size(codes)}
    return PhotoDepth(_inverse(_levels(codes), kind != "depth"), False, about=about)


def _of_further_picture(file: Path, data: bytes, hw: tuple[int, int]) -> PhotoDepth | None:
    """A JPEG whose depth, or whose other view, follows it in the same file."""
    items, orientation = list_further_pictures(data), orientation_of(file)
    for _, one in items:
        packet = _apple_packet(one)
        if packet is not None:
            return _of_apple(_decode(file, one), packet, orientation, hw, "JPEG, Apple")
    kinds = (STEREO, 0) if file.suffix.lower() == ".mpo" else (STEREO,)  # some writers leave the type out
    pair = [one for kind, one in items if kind in kinds]
    return _of_stereo(file, pair[0], orientation) if pair else None


def _apple_packet(data: bytes) -> Xmp | None:
    """The packet of a depth or disparity picture; mattes are called depth too, with a subtype."""
    for packet in find_xmp(data):
        kind = packet.text(f"{APDI}AuxiliaryImageType")
        if kind in ("disparity", "depth") and packet.text(f"{APDI}AuxiliaryImageSubType") is None:
            return packet
    return None


def _of_apple(codes: np.ndarray, packet: Xmp, orientation: int, hw: tuple[int, int], source: str) -> PhotoDepth:
    names = ("IntMinValue", "IntMaxValue", "FloatMinValue", "FloatMaxValue")
    first, last, low, high = (packet.number(f"{APDI}{name}") for name in names)
    kind = packet.text(f"{APDI}AuxiliaryImageType")
    inverse, camera = kind == "disparity", _apple_camera(packet, orientation, hw)
    about: dict[str, Any] = {"source": f"{source} {kind}", **_size(codes)}
    stated = {name.lower(): packet.text(f"{DEPTH_DATA}{name}") for name in ("Accuracy", "Quality", "Filtered")}
    about |= {name: value for name, value in stated.items() if value is not None}
    if low is None or high is None or high <= low:
        return PhotoDepth(_inverse(_levels(codes), inverse), False, camera, about=about)
    first, last = first or 0.0, last or float(np.iinfo(codes.dtype).max)
    values = (low + (codes - first) * ((high - low) / (last - first))).astype(np.float32)
    far, unit = (codes <= first, "1/m") if inverse else (codes >= last, "m")
    about |= {"range": [low, high], "unit": unit, **_far_limit(far)}
    return PhotoDepth(_inverse(values, inverse), True, camera, about=about)


def _apple_camera(packet: Xmp, orientation: int, hw: tuple[int, int]) -> Camera | None:
    """The matrix lists its columns; it is for the stored pixels of a reference size. None where the picture was cropped since."""
    K = packet.numbers(f"{DEPTH_DATA}IntrinsicMatrix")
    width = packet.number(f"{DEPTH_DATA}IntrinsicMatrixReferenceWidth")
    height = packet.number(f"{DEPTH_DATA}IntrinsicMatrixReferenceHeight")
    if len(K) != 9 or not width or not height:
        return None
    fx, fy, cx, cy = K[0], K[4], K[6], K[7]
    if orientation >= 5:
        fx, fy, cx, cy, width, height = fy, fx, cy, cx, height, width
    if orientation in (3, 4, 7, 8):
        cy = height - cy
    if orientation in (2, 3, 6, 7):
        cx = width - cx
    if not same_proportions((height, width), hw, PHOTO_PROPORTIONS):
        return None
    return Camera(round(width), round(height), fx, fy, cx, cy).resized(hw[1], hw[0])


def _of_google(file: Path, data: bytes) -> PhotoDepth | None:
    merged = merge_xmp(data)
    if (text := merged.text(f"{GDEPTH}Data")) is not None:
        return _of_range(file, base64.b64decode(text), merged, GDEPTH, "GDepth")
    address = merged.text(f"{DYNAMIC}DepthURI")
    if address is None or merged.text(f"{DYNAMIC}ItemSemantic") == "Segmentation":
        return None
    items = list_container_items(data)
    place = next((place for place, item in enumerate(items) if item.get("DataURI") == address), None)
    if not place:
        raise DepthError(f"{file}: the depth in it is called {address}, which its container does not list")
    sizes = [int(item.get("Length", 0)) for item in items]
    start = len(data) - sum(sizes[place:])  # all but the first follow each other, up to the file's end
    if start <= 0 or sizes[place] <= 0:
        raise DepthError(f"{file}: the depth in it is cut off")
    return _of_range(file, data[start : start + sizes[place]], merged, DYNAMIC, "Dynamic Depth")


def _of_range(file: Path, picture: bytes, packet: Xmp, space: str, source: str) -> PhotoDepth:
    """RangeLinear: depth from near (0) to far (1); RangeInverse: 1 / depth from 1 / near (0) to 1 / far (1)."""
    codes = _decode(file, picture)
    how = packet.text(f"{space}Format") or "RangeInverse"
    near, far = packet.number(f"{space}Near"), packet.number(f"{space}Far")
    if how not in ("RangeInverse", "RangeLinear"):
        raise DepthError(f"{file}: the depth in it is of format {how!r}; RangeInverse or RangeLinear is expected")
    if near is None or far is None or not 0 < near < far:
        raise DepthError(f"{file}: the depth in it reaches from {near} to {far}; 0 < near < far is expected")
    inverse, part = how == "RangeInverse", _levels(codes)
    ends = (1 / near, 1 / far) if inverse else (near, far)
    values = (ends[0] + part * (ends[1] - ends[0])).astype(np.float32)
    unit = packet.text(f"{space}Units") or {GDEPTH: "m"}.get(space, "None")
    metre = METRE_UNITS.get(unit.lower())
    values = _inverse(values, inverse) / np.float32(metre or 1)
    about = {"source": f"{source}, {how}", **_size(codes), "range": [near, far], "unit": unit, **_far_limit(part >= 1)}
    ray = (packet.text(f"{space}MeasureType") or "").endswith("Ray")
    return PhotoDepth(values, metre is not None, None, ray, about)


def _of_stereo(file: Path, other: bytes, orientation: int) -> PhotoDepth:
    """Inverse depth of the left picture of a stereo photo (the first), by matching; metres where the file says the baseline."""
    stored = read_stored(file)
    disparity, share = match_stereo_photo(file, srgb_of(stored, file), _read_color(file, other, orientation))
    about: dict[str, Any] = {
        "source": "stereo photo (MPO), matched",
        **_size(disparity),
        "matched_share": round(share, 4),
    }
    baseline, farthest = find_baseline(other), float(np.percentile(disparity, 1))
    if baseline and stored.focal_35mm and farthest > 0:
        focal = focal_of_film(stored.focal_35mm, disparity.shape)
        about |= {"baseline_m": baseline, "accuracy": "relative"}
        return PhotoDepth((disparity / np.float32(focal * baseline)).astype(np.float32), True, about=about)
    return PhotoDepth(np.maximum(disparity - np.float32(farthest - 1), np.float32(0)), False, about=about)


def _read_color(file: Path, data: bytes, orientation: int) -> UInt8Array:
    with Image.open(io.BytesIO(data), formats=("JPEG",)) as picture:
        check_pixels(file, *picture.size)
        color = rgb_to_srgb(np.asarray(picture.convert("RGB")), picture.info.get("icc_profile"), file)
        return apply_orientation(color, orientation)


def _decode(file: Path, data: bytes) -> np.ndarray:
    """The codes of a depth picture, h x w, turned as the photo is shown."""
    with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as picture:
        check_pixels(file, *picture.size)
        codes = np.asarray(picture.convert("L") if picture.mode in ("P", "LA", "RGB", "RGBA", "YCbCr") else picture)
    return apply_orientation(codes, orientation_of(file))


def _levels(codes: np.ndarray) -> Float32Array:
    """Codes as 0..1."""
    return codes.astype(np.float32) / np.float32(np.iinfo(codes.dtype).max)


def _inverse(values: Float32Array, inverse: bool) -> Float32Array:
    return values if inverse else (1 / np.maximum(values, np.float32(1 / 255))).astype(np.float32)


def _size(codes: np.ndarray) -> dict[str, Any]:
    return {"size": [codes.shape[1], codes.shape[0]]}


def _far_limit(far: np.ndarray) -> dict[str, float]:
    """The share of pixels at the far end of the range, which may lie beyond it."""
    return {"at_far_limit_share": round(float(far.mean()), 4)}
