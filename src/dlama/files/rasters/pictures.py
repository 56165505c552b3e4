"""Colour pictures, masks and code pictures: files in, arrays out, and back.

Inside the package a mask is a bool field, True = remove / fill; thresholds and polarity exist in this file only.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from PIL import Image

from dlama.arguments import check_arguments
from dlama.errors import FileError, MaskError, system_errors, warn
from dlama.files.rasters.color_profiles import rgb_to_srgb
from dlama.files.rasters.exr_files import read_exr
from dlama.files.rasters.images import SUFFIXES, StoredPicture, read_stored
from dlama.files.semantic_classes import class_color
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, UInt16Array, percent
from dlama.writing.atomic_write import PathLike, new_file, write_file

LOWEST_WHITE = 247
HIGHEST_BLACK = 8
PNG_LEVEL = 2
"""zlib level: on photographs three times as fast as Pillow's 6 and 4 % larger."""
PNG_FILTER = 19
"""OpenCV's number of the option that names the one filter of all rows, which versions before 4.12 pass over. To try all filters
on each row takes .4 to half of the time."""
COLOR_PNG = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE, PNG_FILTER, 128)
"""zlib looks for runs alone, which makes a photo of 11 MP 8 % smaller; Paeth's filter."""
DEPTH_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1, PNG_FILTER, 32)
"""zlib level 1; rows less the row above."""
DARK = 1 << 14
"""Largest value of 16 bits below which a picture comes from a camera of fewer bits (10, 12, 14)."""
ROWS_AT_ONCE = 64
"""Of a picture, so that what is computed on the way stays in the processor's cache."""


@system_errors(FileError)
def read_color(path: PathLike) -> UInt8Array:
    """A colour picture as uint8 H x W x 3 RGB.

    PNG, JPEG, WebP, TIFF, HEIC (extra `heic`). Colours of another ICC profile (Display P3 of phones, Adobe RGB, CMYK) become
    sRGB. 16 bits keep their high byte and alpha is dropped, each with a warning; grey is repeated, palettes are looked up. Turned
    as viewers show it, where EXIF says so; masks and depth pictures are, too.

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
        if (most := int(stored.values.max(initial=0))) < DARK:
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


@system_errors(FileError)
def read_mask(
    path: PathLike,
    mask_polarity: Literal["fill", "known"] = "fill",
    soft_mask: bool = False,
    mask_class: str | None = None,
) -> BoolArray:
    """A mask as bool H x W, True = remove / fill.

    Args:
        path: Black and white PNG, JPEG, WebP or TIFF; values <= 8 and >= 247 count as 0 and 255. In EXR and float TIFF 1 is
            white. Where pixels are transparent, alpha is the mask, which a warning says; of EXR it is always.
        mask_polarity: "fill": white (255) is removed; "known": white stays.
        soft_mask: Take a grey mask, values above 127 as white; else values between are refused.
        mask_class: The picture is an EasySynth semantic one; take the pixels of this class: "R,G,B", or a name that stands in
            SemanticClasses.csv next to the picture or up to three folders above.

    Raises:
        FileError: the file is missing or damaged.
        MaskError: the mask is grey, coloured, empty or full, or the class is not known.
    """
    check_arguments(read_mask, locals())
    if mask_polarity not in ("fill", "known"):
        raise MaskError(
            f"`mask_polarity` is {mask_polarity!r}; 'fill' (255 = remove) or 'known' (255 = keep) is expected"
        )
    if mask_class is not None:
        mask = _class_mask(path, mask_class)
        largest = 255
    else:
        grey = _grey(path)
        largest = int(grey.max())
        mask = _threshold(path, grey, soft_mask)
    if mask_polarity == "known":
        mask = ~mask
    if not mask.any():
        hint = f" (its largest value is {largest}; 255 means remove)" if 0 < largest <= HIGHEST_BLACK else ""
        kind = MaskError if hint else EmptyMaskError
        raise kind(f"{path}: the mask is empty, nothing is to be removed{hint}; see `mask_polarity`")
    if mask.all():
        raise MaskError(f"{path}: the mask is full, nothing would be known; see `mask_polarity`")
    return mask


class EmptyMaskError(MaskError):
    """A mask in which nothing is marked."""


@system_errors(FileError)
def read_region(path: PathLike) -> BoolArray:
    """A black and white picture as bool H x W, True = white; unlike a mask it may be all white. FileError, MaskError (grey)."""
    return _threshold(path, _grey(path), False)


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


def write_mask(path: PathLike, mask: BoolArray) -> None:
    """Write bool H x W as 8-bit grey, True = 255. Raises OutputError."""
    save_picture(path, Image.fromarray(mask.astype(np.uint8) * np.uint8(255)))


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


def _grey(path: PathLike) -> UInt8Array:
    """A mask file as uint8 H x W; refuses colour, and transparency next to black and white, whose meaning is not plain."""
    values = _eight_bits(path)
    if values.ndim == 2:
        return values
    if values.shape[2] in (2, 4):
        alpha, values = values[..., -1], values[..., :-1]
        if (alpha != 255).any():
            return _check_alpha(path, alpha, values)
    spread = int((values.max(axis=2).astype(np.int16) - values.min(axis=2)).max())
    if spread > HIGHEST_BLACK:
        raise MaskError(
            f"{path}: is a colour picture, a black and white mask is expected; for a semantic picture name the class: "
            "`mask_class=NAME` or `mask_class=R,G,B`"
        )
    return values[..., 0]


def _eight_bits(path: PathLike) -> UInt8Array:
    """The values of a mask file, H x W or H x W x C: of 16 bits the upper eight, of floats 0..1 as 0..255."""
    if Path(path).suffix.lower() == ".exr":
        values: np.ndarray = read_exr(path, what="matte")
        if values.min() == values.max() == 1:
            values = read_exr(path, what="opaque matte")
    else:
        values = read_stored(path).values
    if values.dtype == np.uint16:
        values = (values >> 8).astype(np.uint8)
    if values.dtype.kind == "f":
        if not -1 <= values.min() <= values.max() <= 2:  # filters overshoot
            raise MaskError(
                f"{path}: holds {values.min():.4g} to {values.max():.4g}; a mask of floats is 0 to 1, 1 = remove"
            )
        values = np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)
    if values.dtype != np.uint8:
        raise MaskError(f"{path}: holds {values.dtype} numbers; an 8-bit mask with 255 = remove is expected")
    return values


def _check_alpha(path: PathLike, alpha: UInt8Array, values: UInt8Array) -> UInt8Array:
    """The alpha of a cut-out (H x W) as its mask; MaskError where what it shows (values) is a black and white mask itself."""
    shown = values[alpha > 0]
    black, white = shown <= HIGHEST_BLACK, shown >= LOWEST_WHITE
    if black.any() and white.any() and (black | white).all():
        raise MaskError(
            f"{path}: the mask is black, white and transparent, its meaning is not plain; save it as black and white"
        )
    warn(f"{path}: its alpha is the mask: what is opaque is removed (`mask_polarity` turns it round)")
    return np.ascontiguousarray(alpha)


def _threshold(path: PathLike, grey: UInt8Array, soft_mask: bool) -> BoolArray:
    if soft_mask:
        return grey > 127
    between = grey[(grey > HIGHEST_BLACK) & (grey < LOWEST_WHITE)]
    if between.size:
        found = np.unique(between)
        shown = ", ".join(map(str, found[:6])) + (f", ... {found[-1]}" if found.size > 6 else "")
        deep = Path(path).suffix.lower() in SUFFIXES and read_stored(path).values.dtype == np.uint16
        hint = " (it holds 16-bit numbers, as depth does: is it the depth, and the mask not given?)" if deep else ""
        raise MaskError(
            f"{path}: {between.size} of {grey.size} pixels are neither black nor white (values {shown}); "
            f"0 and 255 are expected, or `soft_mask`, which takes values above 127 as white{hint}"
        )
    return grey >= LOWEST_WHITE


def _class_mask(path: PathLike, mask_class: str) -> BoolArray:
    """Where a semantic picture shows exactly the colour of one class."""
    picture = read_classes(path)
    class_rgb = class_color(mask_class, path)
    mask = (picture == np.array(class_rgb, np.uint8)).all(axis=2)
    if not mask.any():
        found = np.unique(picture.reshape(-1, 3), axis=0)
        shown = " ".join(",".join(map(str, color)) for color in found[:8]) + (" ..." if len(found) > 8 else "")
        raise MaskError(
            f"{path}: no pixel shows class {mask_class} ({class_rgb[0]},{class_rgb[1]},{class_rgb[2]}); found: {shown}"
        )
    return mask
