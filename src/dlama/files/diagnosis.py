"""A picture, a depth file and a mask in, as files; findings out: what is wrong with them and what was understood."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import CameraError, InputError
from dlama.files.atomic_write import PathLike
from dlama.files.cameras import FILM_DIAGONAL_MM, camera_for, read_stereo_calib
from dlama.files.photos.depth import read_photo_depth
from dlama.files.rasters.depth import (
    FAR_CODE,
    FAR_METRES,
    MILLIMETRES,
    check_depth_options,
    eight_bit_advice,
    read_stored_numbers,
)
from dlama.files.rasters.images import SUFFIXES, orientation_of, read_stored
from dlama.files.rasters.orientation import apply_orientation
from dlama.files.rasters.pictures import eight_bit_rgb, read_color, read_mask
from dlama.files.rasters.turned_pairs import orientation_difference
from dlama.files.rgbd import SAME_PROPORTIONS, nearest_pixels, read_rgbd
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, UInt8Array, describe_depth_range, percent
from dlama.perception.depth_scale import describe_depth_source
from dlama.perception.diagnosis.depth_scale import measure_extent
from dlama.perception.diagnosis.finding import Finding, Observed, understood
from dlama.perception.diagnosis.lens import check_lens, check_lens_options
from dlama.perception.diagnosis.registration import correlate_edges
from dlama.perception.diagnosis.rgbd_checks import run_checks
from dlama.perception.diagnosis.stereo_pair import check_pair

GUESSED_FOV = 65.0
"""Degrees, where how wide the camera sees is not known: a phone's."""
UNTURNED = (0, 1, 2, 3, 4, 5, 8, 7, 6)
"""EXIF orientation -> the one that undoes it."""


@dataclass(frozen=True)
class DepthOptions:
    """How the depth file is read, as in `read_depth` and `read_rgbd`."""

    depth_scale: float | None = None
    depth_range: float | None = None
    channel: str | None = None
    far: float | None = None
    resize_depth: str | None = None


def diagnose_rgbd(
    image: PathLike,
    depth: PathLike,
    mask: PathLike | None = None,
    *,
    lens_options: Mapping[str, Any],
    depth_options: DepthOptions,
    mask_options: Mapping[str, Any],
) -> list[Finding]:
    """Findings on a picture with depth, and a mask; the last one says what was understood. Never raises InputError."""
    try:
        color = eight_bit_rgb(read_stored(image).values, image)
        found, seen = _observe(image, depth, color, depth_options)
    except InputError as error:
        return [Finding("reading", "fault", 1.0, error.marked)]
    noted, camera = _camera(image, seen.color.shape[:2], lens_options)
    found += noted
    if seen.values.shape != seen.color.shape[:2]:
        return found
    seen = replace(seen, camera=camera)
    if mask is not None:
        noted, hole = _mask(mask, image, seen, mask_options)
        found += noted
        seen = replace(seen, mask=hole, names=(*seen.names[:2], Path(mask).name))
    skip = ("depth unit",) if any(finding.check == "eight-bit-depth" for finding in found) else ()
    found += run_checks(seen, skip)
    return [*found, summarise_inputs(seen, found)]


def diagnose_photo(image: PathLike, lens_options: Mapping[str, Any]) -> list[Finding]:
    """Findings on the depth that a photo's file carries; the last one says what was understood. Never raises InputError."""
    name = Path(image).name
    try:
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always", UserWarning)
            own = read_photo_depth(image)
            if own is None:
                read_stored(image)
                what = f"{name}: carries no depth: it is estimated, unless a depth file is given"
                return [
                    Finding("photo-depth", "note", 1.0, what),
                    Finding("understood", "fine", 1.0, f"{name}: a picture"),
                ]
            rgbd = read_rgbd(image, **lens_options)
    except InputError as error:
        return [Finding("photo-depth", "fault", 1.0, error.marked)]
    found = check_lens(rgbd.camera)
    found += [Finding("photo-depth", "note", 1.0, " ".join(str(one.message).split())) for one in noted]
    about = own.about
    parts = [f"{rgbd.camera.width}x{rgbd.camera.height}", f"{rgbd.camera.fov_deg:.3g} degrees wide"]
    parts.append(f"depth {describe_depth_source(about)}, {about['size'][0]}x{about['size'][1]}")
    parts += [f"accuracy {about['accuracy']}"] if "accuracy" in about else []
    parts.append(describe_depth_range(rgbd.depth))
    return [*found, understood(name, parts, found)]


def diagnose_pair(left: PathLike, right: PathLike, calib: PathLike) -> list[Finding]:
    """Findings on a stereo pair; the last one says what was understood. Never raises InputError."""
    try:
        pictures = read_color(left), read_color(right)
        rig = read_stereo_calib(calib, hw=pictures[0].shape[:2])
    except InputError as error:
        return [Finding("reading", "fault", 1.0, error.marked)]
    names = f"{Path(left).name}, {Path(right).name}"
    if pictures[0].shape != pictures[1].shape:
        sizes = " and ".join(f"{each.shape[1]}x{each.shape[0]}" for each in pictures)
        return [Finding("size", "fault", 1.0, f"{names}: are {sizes}", "rectify them to one size")]
    noted = check_lens(rig.left) + check_pair(*pictures, rig.doffs)
    found = [replace(each, what=f"{names}: {each.what}") for each in noted]
    parts = [f"{rig.left.width}x{rig.left.height}", f"{rig.left.fov_deg:.3g} degrees wide"]
    parts += [f"baseline {rig.baseline_m:.3g} m", f"doffs {rig.doffs:.3g} px"]
    return [*found, understood(names, parts, found)]


def summarise_inputs(seen: Observed, found: list[Finding]) -> Finding:
    """What was made of the inputs, in one line."""
    valid, (image, depth, mask) = seen.valid, seen.names
    metres = seen.values[valid] / seen.units
    parts = [f"{seen.camera.width}x{seen.camera.height}", f"{seen.camera.fov_deg:.3g} degrees wide"]
    if metres.size:
        parts.append(f"depth {metres.min():.3g} to {metres.max():.3g} m (half within {np.median(metres):.3g} m)")
    parts += [f"{percent(seen.values == 0)} missing", f"{percent(np.isposinf(seen.values))} far"]
    extent = measure_extent(seen)
    if extent is not None and extent.floor is not None and not found:
        parts.append(f"ground {extent.floor:.3g} m below the camera")
    names = f"{image}, {depth}"
    if seen.mask is not None:
        names, parts = f"{names}, {mask}", [*parts, f"mask {percent(seen.mask)}"]
    return understood(names, parts, found)


def _observe(
    image: PathLike, depth: PathLike, color: UInt8Array, options: DepthOptions
) -> tuple[list[Finding], Observed]:
    """The stored numbers and what is wrong with how they are stored; a camera is put in later."""
    check_depth_options(options.depth_scale, options.depth_range, options.far)
    name = Path(depth).name
    numbers = read_stored_numbers(depth, "depth", options.channel, eight_bit=True)
    found, whole = [], numbers.dtype.kind != "f"
    if numbers.dtype.itemsize == 1:
        found.append(Finding("eight-bit-depth", "fault", 0.95, f"{name}: {eight_bit_advice('depth')}"))
    values = numbers.astype(np.float64)
    if (values < 0).any():
        what = f"{name}: {percent(values < 0)} of the values are negative (smallest {values.min():.6g})"
        found.append(Finding("negative-depth", "fault", 1.0, what, "0 is missing, depth is > 0"))
    units = options.depth_scale or (MILLIMETRES if whole else 1.0)
    top = np.inf
    if options.depth_range is not None:
        units, top = 1 / options.depth_range, 1.0
    far = np.isposinf(values) | (values > FAR_METRES * units) | (values >= top)
    if numbers.dtype == np.uint16:
        far |= numbers == FAR_CODE
    if options.far is not None:
        far |= values >= options.far * units
    values = np.where(far, np.inf, np.where(values > 0, values, 0))  # NaN compares as False
    noted, color, values = _orient(image, depth, color, values)
    found += noted
    if values.shape != color.shape[:2]:
        noted, values = _resize(image, depth, color.shape[:2], values, options.resize_depth is not None)
        found += noted
    camera = Camera.from_fov(values.shape[1], values.shape[0], GUESSED_FOV)
    return found, Observed(color, values, units, camera, names=(Path(image).name, name, "mask"), whole=whole)


def _orient(
    image: PathLike, depth: PathLike, color: UInt8Array, values: np.ndarray
) -> tuple[list[Finding], UInt8Array, np.ndarray]:
    """Where only one of the two is turned by its tag: which way they fit, found by their edges."""
    turns = orientation_of(image), orientation_of(depth)
    if turns[0] == turns[1]:
        return [], color, values
    stored = apply_orientation(color, UNTURNED[turns[0]]), apply_orientation(values, UNTURNED[turns[1]])
    shown_fit, stored_fit = correlate_edges(color, values), correlate_edges(*stored)
    if shown_fit >= stored_fit:
        return [], color, values
    path = Path(image if turns[0] != 1 else depth)
    what = (
        f"{path.name}: EXIF turns it when it is shown (orientation {max(turns)}), and the other is not turned; picture and "
        "depth fit as their pixels are stored"
    )
    mend = f"clear the tag (exiftool -Orientation= {path.name})"
    return [Finding("orientation", "fault", 0.95, what, mend)], np.ascontiguousarray(stored[0]), stored[1]


def _resize(
    image: PathLike, depth: PathLike, hw: tuple[int, ...], values: np.ndarray, asked: bool
) -> tuple[list[Finding], np.ndarray]:
    """Depth of another size at the picture's, if they show the same field of view."""
    (h, w), (height, width) = hw, values.shape
    what = f"{Path(depth).name}: is {width}x{height} and {Path(image).name} {w}x{h}"
    if abs(width / height * h / w - 1) <= SAME_PROPORTIONS:
        finding = Finding("size", "fault", 1.0, f"{what}, of the same proportions", "give `resize_depth=nearest`")
        return [] if asked else [finding], nearest_pixels(values, (h, w))
    turned = abs(height / width * h / w - 1) <= SAME_PROPORTIONS
    mend = "turn one of them by 90 degrees" if turned else "crop one of them to what the other shows"
    return [Finding("size", "fault", 1.0, what, mend)], values


def _camera(image: PathLike, hw: tuple[int, ...], options: Mapping[str, Any]) -> tuple[list[Finding], Camera]:
    """The camera that was probably meant, and what is wrong with what was given."""
    size = int(hw[0]), int(hw[1])
    found, meant = check_lens_options(options, size[1])
    given = {**options, **meant}
    focal = read_stored(image).focal_35mm if Path(image).suffix.lower() in SUFFIXES else None
    exif = None if focal is None else 2 * math.degrees(
        math.atan(size[1] / 2 / (focal / FILM_DIAGONAL_MM * math.hypot(*size)))
    )  # fmt: skip
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the principal point: `check_lens` looks at it
            camera, _ = camera_for(size, image=image, **given)
    except CameraError as error:
        guessed = Camera.from_fov(size[1], size[0], GUESSED_FOV)
        return [*found, Finding("camera", "fault", 1.0, error.marked)], guessed
    except InputError as error:
        return [*found, Finding("reading", "fault", 1.0, error.marked)], Camera.from_fov(size[1], size[0], GUESSED_FOV)
    return found + check_lens(camera, exif), camera


def _mask(
    path: PathLike, image: PathLike, seen: Observed, options: Mapping[str, Any]
) -> tuple[list[Finding], BoolArray | None]:
    try:
        mask = read_mask(path, **options)
    except InputError as error:
        return [Finding("reading", "fault", 1.0, error.marked)], None
    if mask.shape != seen.values.shape:
        (height, width), (h, w) = mask.shape, seen.values.shape
        what = f"{Path(path).name}: the mask is {width}x{height} and {seen.names[0]} {w}x{h}"
        return [Finding("size", "fault", 1.0, what, "scale the mask to the picture's size")], None
    if turned := orientation_difference(image, path):
        return [Finding("orientation", "note", 0.5, turned, "clear the tag (exiftool -Orientation= FILE)")], mask
    return [], mask
