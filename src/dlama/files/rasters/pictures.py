"""Colour pictures and code pictures: files in, arrays out, and back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from dlama.arguments import check_arguments
from dlama.errors import FileError, warn
from dlama.files.rasters.color_profiles import rgb_to_srgb
from dlama.files.rasters.images import StoredPicture, read_stored
from dlama.geometry.rgbd import Float32Array, UInt8Array, UInt16Array, percent
from dlama.writing.atomic_write import PathLike, new_file, write_file

PNG_LEVEL = 2
"""zlib level: on photographs three times as fast as Pillow's 6 and 4 % larger."""
PNG_FILTER = 19
"""OpenCV's number of the option that names the one filter of all rows, which versions before 4.12 pass over. To try all filters
on each row takes .4 to half of the time."""
COLOR_PNG = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE, PNG_FILTER, 128)
"""zlib looks for runs alone, which makes a photo of 11 MP 8 % smaller; Paeth's filter."""
DEPTH_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1, PNG_FILTER, 32)
"""zlib level 1; rows less the row above."""
ROWS_AT_ONCE = 64
"""Of a picture, so that what is computed on the way stays in the processor's cache."""


def read_color(path: PathLike) -> UInt8Array:
    """A colour picture as uint8 H x W x 3 RGB.

    PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF, HEIC (extra `heic`). Colours of another ICC profile (Display P3 of phones, Adobe RGB,
    CMYK) become sRGB. 16 bits keep their high byte and alpha is dropped, each with a warning; grey is repeated, palettes are
    looked up. Turned as viewers show it, where EXIF says so; masks and depth pictures are, too.

    Raises:
        FileError: missing, damaged or float.
        MissingExtraError: HEIC, and pillow-heif is not installed.
    """
    check_arguments(read_color, locals())
    stored = read_stored(path)
    _warn_of_16_bits(stored, f"{path}: has", " (image.png of a picture's own view keeps 16 where they were measured)")
    _warn_of_alpha(stored, path)
    return srgb_of(stored, path)


def read_color_of_camera(path: PathLike) -> UInt8Array:
    """As `read_color`, for pictures whose camera is known for the pixels as stored: one that EXIF turns is a FileError."""
    stored = read_stored(path)
    if stored.orientation != 1:
        raise FileError(
            f"{path}: EXIF says the picture is turned (orientation {stored.orientation}), its camera would not fit; "
            "clear the tag (exiftool -Orientation= FILE)"
        )
    _warn_of_16_bits(stored, f"{Path(path).parent}: its pictures have")
    return srgb_of(stored, path)


def srgb_of(stored: StoredPicture, path: PathLike) -> UInt8Array:
    """A stored picture as `read_color` gives it. FileError."""
    return rgb_to_srgb(eight_bit_rgb(stored.values, path), stored.profile, path)


def _warn_of_16_bits(stored: StoredPicture, whose: str, kept: str = "") -> None:
    """Warn (UserWarning) that colours of 16 bits are shortened; whose: what the line begins with, kept: what it ends with."""
    if stored.values.dtype == np.uint16:
        warn(f"{whose} 16 bits a channel; colours are worked on, filled and written in 8{kept}")
        if (most := int(stored.values.max(initial=0))) < 1 << 14:  # of a camera of 10, 12 or 14 bits
            warn(
                f"{whose} values up to {most} of 65535, as of a camera of {max(most.bit_length(), 8)} bits: nearly black in 8; "
                "multiply them to fill 16 bits"
            )


def _warn_of_alpha(stored: StoredPicture, path: PathLike) -> None:
    """Warn (UserWarning) of transparent pixels, whose colours often are nobody's."""
    values = stored.values
    if values.ndim == 3 and values.shape[2] in (2, 4) and values.dtype.kind == "u":
        transparent = values[..., -1] < np.iinfo(values.dtype).max
        if transparent.any():
            warn(
                f"{path}: alpha is dropped; the colours of its transparent pixels ({percent(transparent)}) count as measured"
            )


def read_classes(path: PathLike) -> UInt8Array:
    """A semantic picture as uint8 H x W x 3: its colours as stored, since they are codes. FileError."""
    return eight_bit_rgb(read_stored(path).values, path)


def eight_bit_rgb(values: np.ndarray, path: PathLike) -> UInt8Array:
    """Stored values of a picture as uint8 H x W x 3: 16 bit keep their high byte, grey is repeated, alpha dropped. FileError."""
    if values.dtype == np.uint16:
        values = (values >> 8).astype(np.uint8)
    if values.dtype != np.uint8:
        raise FileError(f"{path}: holds {values.dtype} numbers; a picture with 8 or 16 bits per channel is expected")
    return rgb_of(values)


def rgb_of(values: np.ndarray) -> np.ndarray:
    """Stored values of a picture as H x W x 3: grey is repeated, alpha dropped."""
    if values.ndim == 3 and values.shape[2] < 3:  # grey and alpha
        values = values[..., 0]
    if values.ndim == 2:
        values = np.repeat(values[..., None], 3, axis=2)
    return np.ascontiguousarray(values[..., :3])


def write_color(path: PathLike, color: UInt8Array) -> None:
    """Write uint8 H x W x 3 RGB; the kind of file follows the name (PNG, TIFF, JPEG). Raises OutputError."""
    suffix = Path(path).suffix.lower()
    if suffix == ".png":
        write_png(path, cv2.cvtColor(color, cv2.COLOR_RGB2BGR), COLOR_PNG)
        return
    options = {"quality": 95, "subsampling": 0} if suffix in (".jpg", ".jpeg") else {}
    save_picture(path, Image.fromarray(np.ascontiguousarray(color)), **options)


def write_deep_color(path: PathLike, color: UInt16Array) -> None:
    """Write uint16 H x W x 3 RGB as PNG of 16 bits a channel. Raises OutputError."""
    write_png(path, cv2.cvtColor(color, cv2.COLOR_RGB2BGR), (cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL))


def write_png(path: PathLike, values: np.ndarray, options: Sequence[int]) -> None:
    """Write H x W, or H x W x 3 BGR, of 8 or 16 bits as PNG by OpenCV, with its options. Raises OutputError."""
    write_file(path, cv2.imencode(".png", values, options)[1].tobytes())


def write_codes(path: PathLike, codes: UInt8Array, palette: Sequence[tuple[int, int, int]]) -> None:
    """Write uint8 H x W codes as a palette PNG: the stored values are the codes, viewers show the colours.

    `palette[code]` is RGB. Raises OutputError.
    """
    picture = Image.fromarray(np.ascontiguousarray(codes))  # grey; a palette turns it into codes
    picture.putpalette([int(value) for color in palette for value in color])
    save_picture(path, picture)


def write_grey(path: PathLike, values: Float32Array) -> None:
    """Write float H x W in 0..1 as 8-bit grey (1 = 255, rounded, clipped; NaN = 0). Raises OutputError."""
    levels = np.empty(values.shape, np.uint8)
    for first in range(0, len(values), ROWS_AT_ONCE):
        some = np.clip(np.nan_to_num(values[first : first + ROWS_AT_ONCE]), 0, 1) * 255
        levels[first : first + ROWS_AT_ONCE] = np.rint(some)
    save_picture(path, Image.fromarray(levels))


def save_picture(path: PathLike, picture: Image.Image, **options: Any) -> None:
    """Write a Pillow picture whole or not at all; the kind of file follows the name. Raises OutputError."""
    if Path(path).suffix.lower() == ".png":
        options["compress_level"] = PNG_LEVEL
    with new_file(path) as draft:
        picture.save(draft, **options)
