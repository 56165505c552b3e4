"""A picture file in; how many bits a channel it holds, and colours of 16, which Pillow would shorten to 8, out."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, TiffImagePlugin

from dlama.errors import FileError

PPM_HEADS = (b"P5", b"P6")
"""How a PGM and a PPM of bytes begin (Netpbm)."""


def bits_of(picture: Image.Image, file: Path) -> int:
    """Bits per channel as stored."""
    if picture.format == "PNG":
        with file.open("rb") as stream:
            return stream.read(25)[24]  # IHDR: signature 8, length 4, type 4, size 8, depth
    if picture.format == "PPM":
        with file.open("rb") as stream:
            words = re.sub(rb"#[^\n]*", b"", stream.read(4096)).split(None, 4)
        return 16 if words[0] in PPM_HEADS and int(words[3]) > 255 else 8  # kind, width, height, largest value
    tags: Any = getattr(picture, "tag_v2", {})
    return int(max(np.atleast_1d(tags.get(258, 8))))  # BitsPerSample


def decode_16_bits(picture: Image.Image, file: Path, data: bytes) -> np.ndarray:
    """uint16 of a whole PNG, TIFF or PPM with 16-bit colours, H x W x C as RGB(A), or of a 16-bit PGM, H x W. FileError."""
    tags: Any = getattr(picture, "tag_v2", {})
    if tags.get(284, 1) != 1:  # PlanarConfiguration; OpenCV mixes rows of the planes
        mend = "save it interleaved, or as PNG"
        raise FileError(f"{file}: holds its channels one after the other (planar) in 16 bits; {mend}")
    values = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture.format == "PPM" and values is not None and values.ndim == 2:
        return np.asarray(values)
    if values is None or values.ndim != 3:
        raise FileError(f"{file}: this kind of 16-bit picture cannot be read; save it as 16-bit PNG")
    order = [2, 1, 0, 3][: values.shape[2]]
    return np.ascontiguousarray(values[..., order])


def is_preview(picture: Image.Image) -> bool:
    """Whether a TIFF's first picture is a small one of another that it holds, as in raw files of cameras (NEF, DNG, ARW)."""
    tags: Any = getattr(picture, "tag_v2", {})
    return bool(tags.get(254, 0) & 1) and 330 in tags  # NewSubfileType: of reduced resolution; SubIFDs


def describe_tiff(file: Path) -> str:
    """What numbers a TIFF holds that cannot be opened, and which can be; "" for what is none."""
    with contextlib.suppress(Exception), file.open("rb") as stream:  # a damaged one is no more than that
        tags: Any = TiffImagePlugin.ImageFileDirectory_v2(stream.read(8))
        stream.seek(tags.next)
        tags.load(stream)
        bits, kind = np.atleast_1d(tags[258]), "float" if 3 in np.atleast_1d(tags.get(339, 1)) else "whole"
        return (
            f"; it is a TIFF whose channels ({len(bits)}) are {kind} numbers of {max(bits)} bits: "
            "colours of 8 or 16 bits and depth in one channel of 16 bits or 32-bit floats are read"
        )
    return ""
