"""Colours and the ICC profile of their file in; the same colours in sRGB, as viewers without the profile show them, out."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image, ImageCms

from dlama.errors import warn
from dlama.geometry.rgbd import UInt8Array
from dlama.writing.atomic_write import PathLike

MODES = {"RGB": "RGB", "GRAY": "L", "CMYK": "CMYK"}
"""Colour space of a profile -> Pillow's mode of the pictures it is for."""


def to_srgb(picture: Image.Image, profile: bytes | None, path: PathLike) -> Image.Image:
    """An 8-bit picture (RGB, L or CMYK) in sRGB by its ICC profile; itself where it has none, or one that is sRGB's.

    Warns (UserWarning) of a profile that cannot be read or is for other colours; the values are then taken as sRGB.
    """
    if not profile:
        return picture
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        space = source.profile.xcolor_space.strip()
        if MODES.get(space) != picture.mode:
            raise ValueError(f"it is for {space} and the picture is {picture.mode}")
        srgb = ImageCms.createProfile("sRGB")
        how = ImageCms.Intent.RELATIVE_COLORIMETRIC, ImageCms.Flags.BLACKPOINTCOMPENSATION
        transform = ImageCms.buildTransform(source, srgb, picture.mode, "RGB", *how)
        if picture.mode != "CMYK" and _changes(transform, picture.mode) <= 3:
            return picture  # sRGB, as most are; its profiles differ by as many levels
        converted = ImageCms.applyTransform(picture, transform)
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError) as error:
        warn(f"{path}: its colour profile cannot be used ({error}); its colours are taken as sRGB")
        return picture
    assert converted is not None  # None is for transforms in place
    return converted


def rgb_to_srgb(color: UInt8Array, profile: bytes | None, path: PathLike) -> UInt8Array:
    """The same of an array, H x W x 3; a grey picture's channels are alike."""
    if not profile:
        return color
    grey = profile[16:20] == b"GRAY"  # the header's colour space, ICC.1 7.2.8
    picture = Image.fromarray(np.ascontiguousarray(color[..., 0]) if grey else color)
    converted = to_srgb(picture, profile, path)
    return color if converted is picture else np.asarray(converted)


def _changes(transform: ImageCms.ImageCmsTransform, mode: str) -> int:
    """Largest change of any colour of a grid, in levels."""
    steps = np.linspace(0, 255, 9).astype(np.uint8)
    grid = np.stack(np.meshgrid(steps, steps, steps), -1).reshape(1, -1, 3) if mode == "RGB" else steps[None]
    found = ImageCms.applyTransform(Image.fromarray(grid), transform)
    levels = grid if mode == "RGB" else np.repeat(grid[..., None], 3, 2)
    return int(np.abs(np.asarray(found).astype(np.int16) - levels).max())
