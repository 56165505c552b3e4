"""An OpenEXR file in; one of its channels out, as stored, H x W of its display window; and channels back. No units."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from dlama.errors import FileError, any_error, warn
from dlama.files.rasters.float_files import plane_of
from dlama.files.rasters.images import check_pixels, existing_file
from dlama.geometry.rgbd import Float32Array
from dlama.writing.atomic_write import PathLike, new_file

ORDERS = {
    "depth": ("z", "depth", "*depth.z", "*.z", "*depth*", "r", "y"),
    "matte": ("a", "*.a", "r", "y"),
    "opaque matte": ("r", "y"),
}
"""Which channel of an EXR it is: the first of these that is there (without regard to case), else the only one."""


def read_exr(path: PathLike, channel: str | None = None, what: str = "depth") -> Float32Array:
    """One channel of an OpenEXR file as float32 H x W; half infinity (or a half clamped at its largest) is +inf.

    The picture is the display window: overscan is cut off, and what was not rendered is 0, of which a warning tells. `channel` is
    the exact name, PART.NAME where several parts have it; None looks for `what` (ORDERS). Raises FileError.
    """
    file = existing_file(path)
    with (
        any_error(FileError, f"{file}: is damaged or no OpenEXR file"),
        OpenEXR.File(_name_or_bytes(file), separate_channels=True) as exr,
    ):
        with OpenEXR.File(_name_or_bytes(file), header_only=True) as headers:
            if len(exr.parts) < len(headers.parts):  # the library leaves out what it cannot decode
                raise FileError(f"{file}: is damaged or truncated")
        planes = _planes(exr.parts)
        chosen = _channel_of(file, {name: values for name, (_, values) in planes.items()}, channel, what)
        header, values = planes[chosen]
        if values.dtype == object:
            raise FileError(f"{file}: is a deep EXR, with several depths a pixel; flatten it")
        values = _in_display_window(file, header, np.array(values))
        _warn_of_aspect(file, float(header.get("pixelAspectRatio", 1)))
    result = plane_of(file, values).astype(np.float32)
    if values.dtype == np.float16:
        result[result >= 65504] = np.inf  # the largest; where a writer clamps, infinity becomes that
    return result


def write_exr(path: PathLike, channels: Mapping[str, np.ndarray]) -> None:
    """Write channels (each float32 or half H x W) as an OpenEXR file, compressed without loss (PIZ). Raises OutputError."""
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    with new_file(path) as draft:
        try:
            planes = {name: np.ascontiguousarray(values) for name, values in channels.items()}
            place = _name_or_bytes(draft)
            OpenEXR.File(header, planes).write(place)
            if isinstance(place, io.BytesIO):
                draft.write_bytes(place.getbuffer())
        except (RuntimeError, TypeError) as error:  # how OpenEXR reports a full disk, and no stream before 3.5
            raise OSError(str(error)) from error


def _name_or_bytes(file: Path) -> str | io.BytesIO:
    """What OpenEXR takes for a file: its name, or its bytes where the name is no text."""
    try:
        str(file).encode()
    except UnicodeEncodeError:
        return io.BytesIO(file.read_bytes())
    return str(file)


def _planes(parts: Sequence[Any]) -> dict[str, tuple[dict[str, Any], np.ndarray]]:
    """Channel -> header of its part, and its numbers. A name that several parts have becomes PART.NAME."""
    held = Counter(name for part in parts for name in part.channels)
    return {
        name if held[name] == 1 else f"{part.name()}.{name}": (part.header, each.pixels)
        for part in parts
        for name, each in part.channels.items()
    }


def _in_display_window(file: Path, header: Mapping[str, Any], values: np.ndarray) -> np.ndarray:
    """The numbers of the data window (H x W) where the display window has them: overscan is cut off, what was not rendered is 0.

    Warns (UserWarning) where something was not rendered. FileError: nothing was.
    """
    (left, top), (right, bottom) = (np.asarray(corner).ravel().tolist() for corner in header["dataWindow"])
    (x, y), (x_end, y_end) = (np.asarray(corner).ravel().tolist() for corner in header["displayWindow"])
    if (left, top, right, bottom) == (x, y, x_end, y_end):
        return values
    shown = f"data {left},{top} to {right},{bottom}, display {x},{y} to {x_end},{y_end}"
    check_pixels(file, x_end + 1 - x, y_end + 1 - y)
    rows = slice(max(top, y), min(bottom, y_end) + 1)
    columns = slice(max(left, x), min(right, x_end) + 1)
    if rows.start >= rows.stop or columns.start >= columns.stop:
        raise FileError(f"{file}: its data window lies outside its display window ({shown}): nothing of it is shown")
    out = np.zeros((y_end + 1 - y, x_end + 1 - x), values.dtype)
    shown_values = values[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    out[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x] = shown_values
    cut = (rows.stop - rows.start) * (columns.stop - columns.start) / out.size
    if cut < 1:
        warn(f"{file}: was rendered in {cut:.0%} of its display window ({shown}); the rest counts as missing")
    return out


def _warn_of_aspect(file: Path, ratio: float) -> None:
    """Warn (UserWarning) of pixels that are not square: a field of view alone makes the wrong camera."""
    if ratio > 0 and abs(ratio - 1) > 0.01:
        warn(
            f"{file}: its pixels are {ratio:.4g} times as wide as high (anamorphic): give `fx` and `fy`, fx = fy / {ratio:.4g}, "
            "or make picture and depth square"
        )


def _channel_of(file: Path, channels: dict[str, np.ndarray], expected: str | None, what: str) -> str:
    """Which channel holds `what` (ORDERS); refuses a colour picture."""
    known = ", ".join(sorted(channels))
    mend = "; choose one with `channel`" if what == "depth" else ""
    if expected is not None:
        if expected not in channels:
            raise FileError(f"{file}: has no channel '{expected}'; it has {known}")
        return expected
    for rule in ORDERS[what]:
        fits = [name for name in channels if fnmatchcase(name.lower(), rule) and not _is_of_vector(name, channels)]
        if len(fits) > 1:
            raise FileError(f"{file}: {what} may be any of {', '.join(fits)}{mend}")
        if fits:
            _check_grey(file, channels, fits[0], what)
            return fits[0]
    if len(channels) != 1:
        raise FileError(f"{file}: has the channels {known}, none of which is plainly {what}{mend}")
    return next(iter(channels))


def _is_of_vector(name: str, channels: Collection[str]) -> bool:
    """Whether a channel is one of X, Y and Z, which are all there: of normals, positions or motion Z is no depth."""
    axes = next((axes for axes in ("xyz", "XYZ") if name[-1] in axes), "")
    return bool(axes) and all(name[:-1] + axis in channels for axis in axes)


def _check_grey(file: Path, channels: dict[str, np.ndarray], chosen: str, what: str) -> None:
    """R stands for depth, or a matte, only where G and B say the same (EasySynth writes all three)."""
    for other in {"R": "GB", "r": "gb"}.get(chosen, ""):
        if other in channels and not np.array_equal(channels[chosen], channels[other], equal_nan=True):
            raise FileError(f"{file}: is a colour picture (R and {other} differ); {what} in one channel is expected")
