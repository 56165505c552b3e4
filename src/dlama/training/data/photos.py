"""Folders of pictures in -> the files of photos, and which of them are held out, out."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from dlama.errors import InputError
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import srgb_of
from dlama.geometry.rgbd import UInt8Array

HELD_OUT_ONE_IN = 16
"""One of so many groups of photos, or scenes, is held out."""
FRAME_NUMBER = re.compile(r"[_-][a-z]?\d{5,}$")
"""Ends the name of a video's frame: neighbouring frames look alike, so all frames of a video are in one split."""


def read_photo(path: Path) -> UInt8Array:
    """Any picture as uint8 H x W x 3 RGB: 16 bit keep their high byte, grey is repeated, alpha dropped. FileError.

    EXIF orientation is ignored: a texture has no upright side.
    """
    return srgb_of(read_stored(path), path)


def split_photos(photos: Sequence[Path], split: str) -> tuple[Path, ...]:
    """The photos of one split (`train`, `held_out`), by a hash of their names; a video's frames stay together."""
    groups = {photo.stem: FRAME_NUMBER.sub("", photo.stem) for photo in photos}
    if len(set(groups.values())) < 2:
        groups = {name: name for name in groups}
    held = held_out_names(set(groups.values()), "photos")
    return tuple(photo for photo in photos if (groups[photo.stem] in held) == (split == "held_out"))


def held_out_names(names: set[str], what: str) -> set[str]:
    """Which names are held out: one in HELD_OUT_ONE_IN by a hash, at least one and not all.

    what: plural noun for the message of InputError, which is raised where there are less than two names.
    """
    if len(names) < 2:
        raise InputError(f"{len(names)} different {what}: two or more are expected, so that one can be held out")
    order = sorted(names, key=_hash)
    chosen = {name for name in order if _hash(name) % HELD_OUT_ONE_IN == 0}
    return chosen if 0 < len(chosen) < len(names) else {order[0]}


def square_crop(picture: UInt8Array, size: int, rng: np.random.Generator) -> UInt8Array:
    """size x size x 3: a random square of an H x W x 3 picture, at a random scale, at least `size` px wide if possible."""
    least = min(picture.shape[:2])
    side = round(float(np.exp(rng.uniform(np.log(min(size, least)), np.log(least)))))
    top, left = (int(rng.integers(0, length - side + 1)) for length in picture.shape[:2])
    square = np.ascontiguousarray(picture[top : top + side, left : left + side])
    if side == size:
        return square
    how = cv2.INTER_AREA if side > size else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(square, (size, size), interpolation=how), np.uint8)


def _hash(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
