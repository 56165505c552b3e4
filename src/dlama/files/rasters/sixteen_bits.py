"""A picture file in; how many bits a channel it holds, and colours of 16, which Pillow would shorten to 8, out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from dlama.errors import FileError


def bits_of(picture: Image.Image, data: bytes) -> int:
    """Bits per channel as stored; data: of a PNG, its first 25 bytes or more."""
    if picture.format == "PNG":
        return bits_of_png(data)
    tags: Any = getattr(picture, "tag_v2", {})
    return int(max(np.atleast_1d(tags.get(258, 8))))  # BitsPerSample


def bits_of_png(data: bytes) -> int:
    """Bits per channel of a PNG that begins so, with 25 bytes or more."""
    return data[24]  # IHDR: signature 8, length 4, type 4, size 8, depth


def decode_16_bits(file: Path, data: bytes) -> np.ndarray:
    """uint16 H x W x C of a whole PNG or TIFF with 16-bit colours, RGB(A). FileError."""
    values = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None or values.ndim != 3:
        raise FileError(f"{file}: this kind of 16-bit picture cannot be read; save it as 16-bit PNG")
    order = [2, 1, 0, 3][: values.shape[2]]
    return np.ascontiguousarray(values[..., order])
