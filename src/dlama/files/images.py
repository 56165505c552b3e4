"""A PNG, JPEG or TIFF file in; its numbers out, exactly as stored, and whole or not at all."""

from __future__ import annotations

import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from dlama.errors import FileError
from dlama.files.atomic_write import PathLike

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
EXIF_ORIENTATION = 0x0112
EXIF_FOLDER = 0x8769
EXIF_FOCAL_35MM = 0xA405


@dataclass(frozen=True, eq=False)
class Stored:
    """The numbers of a picture file, without any reinterpretation but palettes (looked up) and bilevel (0 and 255)."""

    values: np.ndarray
    """H x W or H x W x C; uint8, uint16, int32 or float32, native byte order; colour as RGB(A)."""
    orientation: int
    """EXIF orientation, 1 = as it is."""
    focal_35mm: float | None
    """EXIF focal length in 35 mm film terms, mm; None where unknown."""


def existing(path: PathLike) -> Path:
    """The path, if a readable file is there; raises FileError."""
    file = Path(path)
    if file.is_dir():
        raise FileError(f"{file}: is a directory, a file is wanted")
    if not file.exists():
        raise FileError(f"{file}: no such file")
    if file.stat().st_size == 0:
        raise FileError(f"{file}: is empty (0 bytes)")
    return file


def read_stored(path: PathLike) -> Stored:
    """The numbers of a PNG, JPEG or TIFF file. Raises FileError when it is missing, damaged or of another kind."""
    file = existing(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # Pillow's remarks on damaged tags; pixels raise on their own
            with Image.open(file, formats=("PNG", "JPEG", "TIFF")) as picture:
                if picture.format == "TIFF" and getattr(picture, "n_frames", 1) > 1:
                    raise FileError(f"{file}: holds more than one page; a TIFF with a single picture is wanted")
                picture.load()
                return Stored(_values(picture, file), *_exif(picture))
    except FileError:
        raise
    except Image.UnidentifiedImageError as error:
        raise FileError(f"{file}: is no readable PNG, JPEG or TIFF picture") from error
    except Exception as error:  # decoders raise OSError, SyntaxError, ValueError, struct.error, ... on damaged files
        raise FileError(f"{file}: is damaged or truncated ({str(error) or type(error).__name__})") from error


def picture_hw(path: PathLike) -> tuple[int, int]:
    """(height, width) of a picture file from its header. Raises FileError."""
    file = existing(path)
    try:
        with Image.open(file, formats=("PNG", "JPEG", "TIFF")) as picture:
            return picture.height, picture.width
    except Exception as error:
        raise FileError(f"{file}: is no readable PNG, JPEG or TIFF picture") from error


def _values(picture: Image.Image, file: Path) -> np.ndarray:
    mode = picture.mode
    if mode in ("P", "PA"):
        picture = picture.convert("RGB")
    elif mode == "1":
        picture = picture.convert("L")
    elif mode in ("CMYK", "YCbCr", "LAB", "HSV"):
        picture = picture.convert("RGB")
    elif mode in ("RGB", "RGBA", "LA") and _bits(picture, file) == 16:
        return _values_16bit(file)  # Pillow keeps the high byte only
    values = np.array(picture)
    if mode == "I" and picture.format == "PNG":  # older Pillow's name for 16-bit grey
        values = values.astype(np.uint16)
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _bits(picture: Image.Image, file: Path) -> int:
    """Bits per channel as stored."""
    if picture.format == "PNG":
        with file.open("rb") as stream:
            return struct.unpack(">B", stream.read(25)[24:25])[0]  # IHDR: signature 8, length 4, type 4, size 8, depth
    tags: Any = getattr(picture, "tag_v2", {})
    return int(max(np.atleast_1d(tags.get(258, 8))))  # BitsPerSample


def _values_16bit(file: Path) -> np.ndarray:
    """16-bit colour; Pillow has already read the file to its end, so it is whole."""
    values = cv2.imdecode(np.fromfile(file, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None or values.ndim != 3:
        raise FileError(f"{file}: this kind of 16-bit picture cannot be read; save it as 16-bit PNG")
    order = [2, 1, 0, 3][: values.shape[2]]
    return np.ascontiguousarray(values[..., order])


def _exif(picture: Image.Image) -> tuple[int, float | None]:
    try:
        tags = picture.getexif()
        orientation = tags.get(EXIF_ORIENTATION, 1)
        focal = tags.get_ifd(EXIF_FOLDER).get(EXIF_FOCAL_35MM) or tags.get(EXIF_FOCAL_35MM)
    except Exception:  # unreadable tags say nothing; the pixels are whole
        return 1, None
    focal = float(focal) if isinstance(focal, (int, float)) and focal > 0 else None
    return orientation if orientation in range(2, 9) else 1, focal
