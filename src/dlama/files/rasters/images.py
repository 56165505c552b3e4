"""A picture file (KINDS) in; its numbers out, as stored and turned as viewers show them, whole or not at all."""

from __future__ import annotations

import contextlib
import io
import os
import re
import stat
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import ExifTags, Image

from dlama.errors import FileError, any_error, import_extra, system_errors
from dlama.files.rasters.color_profiles import to_srgb
from dlama.files.rasters.orientation import (
    BIG_TIFF_HEADS,
    TIFF_HEADS,
    apply_orientation,
    decoder_orientation,
    reset_orientation,
)
from dlama.files.rasters.sixteen_bits import PPM_HEADS, bits_of, decode_16_bits, describe_tiff, is_preview
from dlama.writing.atomic_write import NO_HOME, PathLike, begins_at_home, printable_name

SUFFIXES = (
    ".png", ".jpg", ".jpeg", ".mpo", ".webp", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".avif", ".heic", ".heif",
)  # fmt: skip
KINDS = "PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC"
"""What is read, for messages."""
LARGEST_PIXELS = 2**26
"""Pixels of the largest picture or array that is read (8192 x 8192): bounds the memory that a small file can ask for."""
HEIC = re.compile(rb"....ftyp(hei|mif1)", re.DOTALL)
"""How a HEIC file begins (ISO 23008-12, brands)."""
LINEAR = "convert its linear light to sRGB, and save it as 16-bit PNG"
OTHER_FILES = {
    "OpenEXR": (rb"v/1\x01", LINEAR),
    "Radiance HDR": (rb"#\?", LINEAR),
    "a pointer of Git LFS": (rb"version http", "`git lfs pull` gets the file"),
    "a web page": (rb"(?i:<!doctype|<html)", "what it was to be was not downloaded"),
}
"""What may be given in place of a picture that is read, how such files begin, and what to do; Pillow knows other pictures."""
TAKE_SCENES = "goes into view, remove, mask, photo3d, sequence, video and show (--also scene writes it)"
OF_OTHER_VERBS = {
    **dict.fromkeys(
        (".bag", ".mcap", ".db3", ".mkv", ".r3d"), "a recording goes into sequence, photo3d, show and doctor"
    ),
    **dict.fromkeys((".ply", ".glb"), f"the scene.npz of the result {TAKE_SCENES}"),
    ".npz": f"a scene {TAKE_SCENES}",
    ".json": "a JSON is no picture: save a mask (RLE, polygons) as a black and white PNG, or as NPY",
    ".pcd": "an organised cloud is depth: it goes behind its picture",
}
"""Endings of files that other verbs take -> which these are."""
NO_RGB = ("CMYK", "YCbCr", "LAB", "HSV")
"""Pillow's modes of colours that become RGB when they are read."""
SEVERAL = {"TIFF": "page", "WEBP": "frame", "AVIF": "frame"}
"""Kinds of files that may hold several pictures, and what these are called."""
ADDRESS = re.compile(r"[a-z][a-z0-9+]+:/")
"""How an address begins; a path has one slash of its two."""


@dataclass(frozen=True, eq=False)
class StoredPicture:
    """The numbers of a picture file, without any reinterpretation but palettes (looked up) and bilevel (0 and 255)."""

    values: np.ndarray
    """H x W or H x W x C; uint8, uint16, int32 or float32, native byte order; colour as RGB(A). Turned as viewers show them."""
    orientation: int
    """The file's EXIF (TIFF) orientation, 1 to 8, which `values` no longer need."""
    focal_35mm: float | None
    """EXIF focal length in 35 mm film terms, mm; None where unknown."""
    profile: bytes | None = None
    """The ICC profile of the colours; None: there is none, or `values` no longer need it."""


def existing_file(path: PathLike) -> Path:
    """The path, if a readable file is there; raises FileError."""
    file = Path(path)
    try:
        found = file.stat()
        if stat.S_ISREG(found.st_mode):
            file.open("rb").close()
    except FileNotFoundError:
        why = "; addresses are for `dlama batch` alone" if ADDRESS.match(str(path)) else ""
        why = f"; {NO_HOME}" if begins_at_home(path) else why
        raise FileError(f"{printable_name(path)}: no such file{why}") from None
    except (OSError, ValueError) as error:  # closed, in a closed folder or a circle of links, too long, with NUL
        why = getattr(error, "strerror", "") or str(error)
        raise FileError(f"{printable_name(path)}: cannot be read ({why})") from error
    _check_ordinary(file, found)
    return file


def _check_ordinary(file: Path, found: os.stat_result) -> None:
    """FileError where what lies there is no file with something in it."""
    if stat.S_ISDIR(found.st_mode):
        scene = file / "scene.npz"
        raise FileError(f"{file}: is a directory, a file is expected{f' ({scene}?)' if scene.is_file() else ''}")
    if not stat.S_ISREG(found.st_mode):  # a named pipe would be waited for, /dev/zero never ends
        raise FileError(f"{file}: is a pipe or device, a file on disk is expected")
    if not found.st_size:
        raise FileError(f"{file}: is empty (0 bytes)")


def check_pixels(file: PathLike, width: int, height: int) -> None:
    """Raise FileError where a file says it holds more pixels than are read, before memory is taken for them."""
    if width * height > LARGEST_PIXELS:
        raise _too_many_pixels(file, f"{width}x{height}")


def _too_many_pixels(file: PathLike, pixels: str) -> FileError:
    limit = f"{LARGEST_PIXELS / 1e6:.0f} million"
    return FileError(f"{file}: says it holds {pixels} pixels; at most {limit} are read, scale it down")


def _open_picture(file: PathLike, source: Path | io.BytesIO, formats: tuple[str, ...]) -> Image.Image:
    """Pillow's picture before its pixels are read. FileError where Pillow counts too many: it does not say how wide and high."""
    try:
        return Image.open(source, formats=formats)
    except Image.DecompressionBombError as error:
        raise _too_many_pixels(file, f"more than {2 * (Image.MAX_IMAGE_PIXELS or 0) / 1e6:.0f} million") from error


def read_stored(path: PathLike) -> StoredPicture:
    """The numbers of a picture file (KINDS).

    Raises FileError: missing, damaged, too large or of another kind. MissingExtraError: HEIC, and pillow-heif is not installed.
    """
    file = existing_file(path)
    with any_error(FileError, f"{file}: is damaged or truncated"):  # OSError, SyntaxError, struct.error, ...
        data, tiff_orientation = reset_orientation(file.read_bytes())
        with _open(file, data) as picture:
            if picture.format in SEVERAL and getattr(picture, "n_frames", 1) > 1:
                raise FileError(
                    f"{file}: holds more than one {SEVERAL[picture.format]}; a file with a single picture is expected"
                )
            exif_orientation, focal = _exif(picture)
            orientation = exif_orientation if picture.format != "TIFF" else tiff_orientation
            if picture.format == "PNG":
                with _open(file, data) as unread:
                    unread.verify()  # checksums, which Pillow does not look at as it decodes pixels
            picture.load()
            values, turned = _values(picture, file, data), decoder_orientation(picture)
            profile = None if picture.mode in NO_RGB else picture.info.get("icc_profile")
            turn = orientation if turned == 1 else turned
            return StoredPicture(apply_orientation(values, orientation), turn, focal, profile)


def picture_hw(path: PathLike) -> tuple[int, int]:
    """(height, width) of a picture file as viewers show it, from its header. Raises FileError."""
    return _header(existing_file(path))[0]


def orientation_of(path: PathLike) -> int:
    """How a picture file is turned to be shown, 1 to 8 as in EXIF; 1 for any other kind of file. Raises FileError."""
    return _header(existing_file(path))[1] if Path(path).suffix.lower() in SUFFIXES else 1


@system_errors(FileError)
def has_16_bits(path: PathLike) -> bool:
    """Whether a PNG, TIFF or PPM holds 16 bits a channel, by its header; False for all other files. Raises FileError."""
    file = existing_file(path)
    with file.open("rb") as stream:
        head = stream.read(4)
    if head not in {b"\x89PNG", *TIFF_HEADS, *BIG_TIFF_HEADS} and head[:2] not in PPM_HEADS:
        return False
    with any_error(FileError, f"{file}: is damaged or truncated"), _open(file, b"") as picture:
        return bits_of(picture, file) == 16


def _header(file: Path) -> tuple[tuple[int, int], int]:
    """(height, width) as viewers show it, and the orientation."""
    with any_error(FileError, f"{file}: is damaged or truncated"):
        with file.open("rb") as stream:
            tiff = stream.read(4) in TIFF_HEADS | BIG_TIFF_HEADS
        data, orientation = reset_orientation(file.read_bytes()) if tiff else (b"", 1)
        with _open(file, data) as picture:
            hw, turned = (picture.height, picture.width), decoder_orientation(picture)
            if turned != 1:
                return hw, turned
            orientation = orientation if tiff else _exif(picture)[0]
            return hw if orientation < 5 else (picture.width, picture.height), orientation


@contextlib.contextmanager
def _open(file: Path, data: bytes) -> Iterator[Image.Image]:
    """The picture of a file (of `data`, where there are any) before its pixels are read; FileError where they are too many."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's remarks on damaged tags and large pictures
        with file.open("rb") as stream:
            head = stream.read(12)
        source = io.BytesIO(data) if data else file
        first = "JPEG" if head[:2] == b"\xff\xd8" else "WEBP" if head[8:] == b"WEBP" else "PNG"
        # Pillow loads the forty others where none of the first five is this file's
        formats = (first, "PNG", "JPEG", "BMP", "PPM", "WEBP", "TIFF", "AVIF")
        try:
            opened = _heic(file) if HEIC.match(head) else _open_picture(file, source, formats)
        except Image.UnidentifiedImageError as error:
            raise FileError(f"{file}: is no readable {KINDS} picture{_describe_file(file)}") from error
        with opened as picture:
            if is_preview(picture):
                raise FileError(f"{file}: is a raw file of a camera; develop it, and save it as TIFF or PNG")
            check_pixels(file, picture.width, picture.height)
            yield picture


def _heic(file: Path) -> Image.Image:
    """The main picture of a HEIC file, 8 bits a channel; its decoder turns it as viewers show it."""
    opened = open_heif(file, file)
    check_pixels(file, *opened.size)
    picture: Image.Image = opened.to_pillow()
    return picture


def open_heif(file: Path, source: Path | io.BytesIO, **options: bool) -> Any:
    """A HEIC file, or its bytes, by pillow-heif. MissingExtraError."""
    return import_extra("pillow_heif", f"{file}: a HEIC picture", "pillow-heif", "heic").open_heif(source, **options)


def picture_of_bytes(data: bytes, where: str) -> Image.Image:
    """A JPEG or PNG, decoded. FileError, which begins with `where`: it is damaged, of another kind or too large."""
    with any_error(FileError, f"{where}: is damaged"):
        try:
            picture = _open_picture(where, io.BytesIO(data), ("JPEG", "PNG"))
        except Image.UnidentifiedImageError:  # whose text is an address in memory
            raise FileError(f"{where}: is damaged, or not packed as JPEG or PNG, which are expected") from None
        check_pixels(where, *picture.size)
        picture.load()
        return picture


def _values(picture: Image.Image, file: Path, data: bytes) -> np.ndarray:
    mode = picture.mode
    if mode in ("P", "PA"):
        picture = picture.convert("RGBA" if picture.has_transparency_data else "RGB")
    elif mode == "1":
        picture = picture.convert("L")
    elif mode in NO_RGB:
        converted = to_srgb(picture, picture.info.get("icc_profile"), file) if mode == "CMYK" else picture
        picture = converted.convert("RGB")
    elif (mode in ("RGB", "RGBA", "LA") or picture.format == "PPM") and bits_of(picture, file) == 16:
        return decode_16_bits(picture, file, data)  # Pillow keeps the high byte only, and stretches PGM to its range
    values = np.array(picture)
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _exif(picture: Image.Image) -> tuple[int, float | None]:
    """Orientation and focal length, that of other proportions than the picture's aside: of a crop, which sees less."""
    try:
        tags = picture.getexif()
        orientation, key = tags.get(ExifTags.Base.Orientation, 1), ExifTags.Base.FocalLengthIn35mmFilm
        about = tags.get_ifd(ExifTags.IFD.Exif)
        focal = about.get(key) or tags.get(key)
        sides = about.get(ExifTags.Base.ExifImageWidth), about.get(ExifTags.Base.ExifImageHeight)
        least, most = sorted(int(side or 0) for side in sides)
    except Exception:  # unreadable tags are ignored; the pixels are whole
        return 1, None
    focal = float(focal) if isinstance(focal, (int, float)) and focal > 0 else None
    if least and abs(most / least * min(picture.size) / max(picture.size) - 1) > 0.02:
        focal = None
    return orientation if orientation in range(2, 9) else 1, focal


def _describe_file(file: Path) -> str:
    """What a file is that was given as a picture, and what to do with it; "" for what is not known."""
    with file.open("rb") as stream:
        head = stream.read(12)
    for kind, (begins, advice) in OTHER_FILES.items():
        if re.match(begins, head, re.DOTALL):
            return f", but {kind}: {advice}"
    if head[:4] in TIFF_HEADS:
        return describe_tiff(file)
    if (suffix := file.suffix.lower()) in OF_OTHER_VERBS:
        return f"; {OF_OTHER_VERBS[suffix]}"
    if head.startswith(b"PK"):
        return ", but a ZIP archive: unpack it, and give the folder or the picture in it"
    with contextlib.suppress(Exception), Image.open(file) as picture:
        return f", but {picture.format}: save it as PNG"
    return ""
