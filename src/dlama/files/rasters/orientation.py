"""A file's bytes, or stored pixels, in; the tag that says how a picture is turned, and the pixels as it says, out."""

from __future__ import annotations

import struct

import numpy as np
from PIL import ExifTags, Image

TIFF_HEADS = {b"II*\0": "<", b"MM\0*": ">"}
"""First bytes of a TIFF, and its byte order as `struct` calls it."""
BIG_TIFF_HEADS = {b"II+\0": "<"}
"""Of a BigTIFF, whose counts and offsets have 64 bits (Pillow reads no other byte order)."""
TIFF_WHOLE = {3: "H", 4: "I", 16: "Q"}
"""Types of whole numbers in a TIFF, as `struct` calls them."""


def decoder_orientation(picture: Image.Image) -> int:
    """The orientation that a decoder has made good already, 1 to 8: that of HEIC."""
    turned = picture.info.get("original_orientation") or 1
    return int(turned) if turned in range(2, 9) else 1


def reset_orientation(data: bytes) -> tuple[bytes, int]:
    """The bytes of a TIFF with its orientation set to 1, and what it was; other files as they are.

    Pillow turns TIFF by itself (and scrambles some, 13.0), OpenCV does not: here all kinds of files are turned alike.
    """
    order = (TIFF_HEADS | BIG_TIFF_HEADS).get(data[:4])
    if order is None:
        return data, 1
    offset_at, offset, counter, head = (8, "Q", "Q", "HHQ") if data[:4] in BIG_TIFF_HEADS else (4, "I", "H", "HHI")
    (start,) = struct.unpack_from(order + offset, data, offset_at)
    (count,) = struct.unpack_from(order + counter, data, start)
    first, to_value = start + struct.calcsize(f"={counter}"), struct.calcsize(f"={head}")
    entry = to_value + struct.calcsize(f"={offset}")
    for at in range(first, first + entry * count, entry):  # tag, type, count, value (TIFF 6.0, sec. 2; BigTIFF)
        tag, kind, number = struct.unpack_from(order + head, data, at)
        if tag == ExifTags.Base.Orientation and kind in TIFF_WHOLE and number == 1:
            layout, place = order + TIFF_WHOLE[kind], at + to_value
            (value,) = struct.unpack_from(layout, data, place)
            patched = data[:place] + struct.pack(layout, 1) + data[place + struct.calcsize(layout) :]
            return patched, value if value in range(2, 9) else 1
    return data, 1


def apply_orientation(values: np.ndarray, orientation: int) -> np.ndarray:
    """Stored pixels as the tag says they are to be shown (EXIF 2.32, Orientation): 2 to 4 flips, 5 to 8 transposed as well."""
    if orientation == 1:
        return values
    if orientation >= 5:
        values = np.swapaxes(values, 0, 1)
    if orientation in (3, 4, 7, 8):
        values = values[::-1]
    if orientation in (2, 3, 6, 7):
        values = values[:, ::-1]
    return np.ascontiguousarray(values)
