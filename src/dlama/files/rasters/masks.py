"""Masks: files in, bool arrays out, and back.

Inside the package a mask is a bool field, True = remove / fill; thresholds and polarity exist in this file only.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image

from dlama.arguments import check_arguments
from dlama.errors import FileError, MaskError, system_errors, warn
from dlama.files.rasters.exr_files import read_exr
from dlama.files.rasters.float_files import read_array
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import eight_bit_rgb, save_picture
from dlama.files.semantic_classes import class_color
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.writing.atomic_write import PathLike

LOWEST_WHITE = 247
HIGHEST_BLACK = 8


@system_errors(FileError)
def read_mask(
    path: PathLike,
    mask_polarity: Literal["fill", "known"] = "fill",
    soft_mask: bool = False,
    mask_class: str | None = None,
) -> BoolArray:
    """A mask as bool H x W, True = remove / fill.

    Args:
        path: Black and white PNG, JPEG, WebP or TIFF; values <= 8 and >= 247 count as 0 and 255. In EXR, float TIFF and NPY
            1 is white. Where pixels are transparent, alpha is the mask, which a warning says; of EXR it is always.
        mask_polarity: "fill": white (255) is removed; "known": white stays.
        soft_mask: Take a grey mask, values above 127 as white; else values between are refused.
        mask_class: The picture is an EasySynth semantic one, or a map of labels; take the pixels of this class: "R,G,B", the
            number of a label, or a name that stands in SemanticClasses.csv next to the picture or up to three folders above.

    Raises:
        FileError: the file is missing or damaged.
        MaskError: the mask is grey, coloured, empty or full, or the class is not known.
    """
    check_arguments(read_mask, locals())
    if mask_polarity not in ("fill", "known"):
        known = "'fill' (255 = remove) or 'known' (255 = keep)"
        raise MaskError(f"`mask_polarity` is {mask_polarity!r}; {known} is expected")
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
        hint = ""
        if 0 < largest <= HIGHEST_BLACK:
            hint = f" (its largest value is {largest} of 255; 255 means remove{_hint_at_kind(path, largest)})"
        kind = MaskError if hint else EmptyMaskError
        raise kind(f"{path}: the mask is empty, nothing is to be removed{hint}; see `mask_polarity`")
    if mask.all():
        raise MaskError(f"{path}: the mask is full, nothing would be known; see `mask_polarity`")
    return mask


class EmptyMaskError(MaskError):
    """A mask in which nothing is marked."""


def read_region(path: PathLike) -> BoolArray:
    """A black and white picture as bool H x W, True = white; unlike a mask it may be all white. FileError, MaskError (grey)."""
    return _threshold(path, _grey(path), False)


def write_mask(path: PathLike, mask: BoolArray) -> None:
    """Write bool H x W as 8-bit grey, True = 255. Raises OutputError."""
    save_picture(path, Image.fromarray(mask.astype(np.uint8) * np.uint8(255)))


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
    """The values of a mask file, H x W or H x W x C: of 16 bits the upper eight, unless none is above 255; of floats, and of an
    array of whole numbers up to 1, 0..1 as 0..255."""
    if Path(path).suffix.lower() == ".exr":
        values: np.ndarray = read_exr(path, what="matte")
        if values.min() == values.max() == 1:
            values = read_exr(path, what="opaque matte")
    else:
        values = _numbers(path)
        if _is_array(path) and values.dtype.kind in "iu" and 0 <= values.min() <= values.max() <= 255:
            values = values.astype(np.uint8) * np.uint8(255 if values.max() == 1 else 1)
    if values.dtype == np.uint16:
        values = (values >> 8 if values.max() > 255 else values).astype(np.uint8)
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
    black, white = (shown <= HIGHEST_BLACK).all(1), (shown >= LOWEST_WHITE).all(1)
    if black.any() and white.any() and (black | white).all():
        raise MaskError(
            f"{path}: the mask is black, white and transparent, its meaning is not plain; save it as black and white"
        )
    warn(f"{path}: its alpha is the mask: what is opaque is removed (`mask_polarity` turns it round)")
    return np.ascontiguousarray(alpha)


def _numbers(path: PathLike) -> np.ndarray:
    """What a file other than EXR holds, as stored."""
    return read_array(path, "mask") if _is_array(path) else read_stored(path).values


def _is_array(path: PathLike) -> bool:
    return Path(path).suffix.lower() in (".npy", ".npz")


def _threshold(path: PathLike, grey: UInt8Array, soft_mask: bool) -> BoolArray:
    if soft_mask:
        return grey > 127
    between = grey[(grey > HIGHEST_BLACK) & (grey < LOWEST_WHITE)]
    if between.size:
        found = np.unique(between)
        shown = ", ".join(map(str, found[:6])) + (f", ... {found[-1]}" if found.size > 6 else "")
        hint = _hint_at_kind(path, found[-1]) if found.size <= 6 or _is_deep(path) else ""
        raise MaskError(
            f"{path}: {between.size} of {grey.size} pixels are neither black nor white (values {shown}); "
            f"0 and 255 are expected, or `soft_mask`, which takes values above 127 as white{hint}"
        )
    return grey >= LOWEST_WHITE


def _is_deep(path: PathLike) -> bool:
    """Whether a mask file holds 16-bit numbers."""
    return Path(path).suffix.lower() != ".exr" and _numbers(path).dtype == np.uint16


def _hint_at_kind(path: PathLike, value: int) -> str:
    """That it may be depth, and what removes the pixels of one value of a map of labels, as segmenters write them."""
    deep, label = "", f"{value},{value},{value}"
    if _is_deep(path):
        deep = "; it holds 16-bit numbers, as depth does: is it the depth, and the mask not given, or given before it?"
        label = "NUMBER"
    return f"{deep}; of a map of labels `mask_class={label}` removes one"


def _class_mask(path: PathLike, mask_class: str) -> BoolArray:
    """Where a semantic picture shows exactly the colour of one class, or a map of labels has its number."""
    values = _numbers(path)
    if values.ndim == 2 and mask_class.isdecimal():
        picture, wanted = values[..., None], [int(mask_class)]
    else:
        picture, wanted = eight_bit_rgb(values, path), list(class_color(mask_class, path))
    mask = (picture == np.array(wanted)).all(axis=2)
    if not mask.any():
        found = np.unique(picture.reshape(-1, len(wanted)), axis=0)
        shown = " ".join(",".join(map(str, color)) for color in found[:8]) + (" ..." if len(found) > 8 else "")
        rgb = ",".join(map(str, wanted))
        raise EmptyMaskError(f"{path}: no pixel shows class {mask_class} ({rgb}); found: {shown}")
    return mask
