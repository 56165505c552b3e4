"""Pictures and data sets in -> one file of a stated size that trains anywhere with no other file, out; and back.

A pack is an uncompressed ZIP: `index.json` first, then photos as WebP, pairs of posed frames as WebP and 16-bit PNG
(millimetres, 0 = missing, 65535 = far), each with the smaller side brought to the pack's size. The same input gives the same
bytes.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import InputError
from dlama.files.placement import new_file
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, Float32Array, UInt8Array
from dlama.training.frame_samples import Pair, resized
from dlama.training.photos import Photo

FORMAT, VERSION, INDEX = "dlama pack", 1, "index.json"
QUALITY = 88
"""Of WebP; the pictures of a pair are to agree with their depth, photos are usually JPEG already."""
LONGEST = 1.5
"""A photo's longer side is cut (about its centre) to so many times the smaller one."""
PAIR_SHARE = 0.5
"""Of the file, where there are photos as well as pairs; what one does not need the other gets."""
MILLIMETRES, FAR_CODE = 1000.0, 65535
EPOCH = (1980, 1, 1, 0, 0, 0)
PART_BYTES, END_BYTES = 30 + 46, 22
"""What ZIP adds for each part (plus twice its name) and at the end."""


@dataclass
class Draft:
    """What goes into a pack, while it is collected."""

    room: float
    """Bytes left."""
    parts: list[tuple[str, bytes]] = field(default_factory=list)
    listed: dict[str, list[dict[str, Any]]] = field(default_factory=lambda: {"photos": [], "pairs": []})

    def add(self, kind: str, entry: dict[str, Any], parts: Sequence[tuple[str, bytes]], least: float) -> bool:
        """Take an entry and its parts in, if at least `least` bytes stay free."""
        cost = len(json.dumps(entry)) + 2 + sum(len(data) + PART_BYTES + 2 * len(name) for name, data in parts)
        if self.room - cost < least:
            return False
        self.room -= cost
        self.parts += parts
        self.listed[kind].append(entry)
        return True


def pack(data: Sequence[Path], output: Path, megabytes: float = 45.0, size: int = 256, seed: int = 0) -> list[str]:
    """Write a pack of `megabytes` (millions of bytes) at most; returns lines that say what is in it.

    data: folders of pictures, folders of data sets, other packs; where not all fits, `seed` says what is taken.
    Raises InputError, OutputError; an older file of that name stays until the new one is whole.
    """
    from dlama.training.sources import gathered

    if not data:
        raise InputError("nothing to pack: give folders of pictures or of data sets")
    if size < 16:
        raise InputError(f"size is {size} px; 16 or more is wanted")
    found, rng = gathered(data), np.random.default_rng(seed)
    draft = Draft(megabytes * 1e6 - END_BYTES - 2 * len(INDEX) - PART_BYTES - 200)
    spare = draft.room * (1 - PAIR_SHARE) if found.photos else 0.0
    pairs, photos = _shuffled(found.pairs, rng), _shuffled(found.photos, rng)
    _fill(draft, "pairs", (_packed_pair(pair, n, size) for n, pair in enumerate(pairs)), spare)
    _fill(draft, "photos", (_packed_photo(photo, n, size) for n, photo in enumerate(photos)), 0.0)
    if not draft.parts:
        raise InputError(f"{megabytes:g} MB hold not one picture; more is wanted")
    index = {"format": FORMAT, "version": VERSION, "size": size, **draft.listed}
    written = _write(output, json.dumps(index).encode(), draft.parts)
    return [
        f"{output}: {written / 1e6:.2f} MB, sides of {size} px",
        f"    {len(draft.listed['photos'])} of {len(photos)} photos",
        f"    {len(draft.listed['pairs'])} of {len(pairs)} pairs of posed frames",
    ]


def _fill(
    draft: Draft, kind: str, entries: Iterable[tuple[dict[str, Any], list[tuple[str, bytes]]]], least: float
) -> None:
    """Take entries in until one does not fit."""
    for entry, parts in entries:
        if not draft.add(kind, entry, parts, least):
            return


def _packed_photo(photo: Photo, number: int, size: int) -> tuple[dict[str, Any], list[tuple[str, bytes]]]:
    name = f"photos/{number:06d}.webp"
    return {"name": photo.name, "file": name}, [(name, webp(smaller(photo.load(), size)))]


def _packed_pair(pair: Pair, number: int, size: int) -> tuple[dict[str, Any], list[tuple[str, bytes]]]:
    truth = pair.load()
    entry: dict[str, Any] = {
        "scene": pair.scene,
        "name": pair.name,
        "frames": sorted(pair.frames),
        "exposure_varies": truth.exposure_varies,
    }
    parts = []
    for end, rgbd in (("source", truth.source), ("target", truth.target)):
        small = resized(rgbd, min(1.0, size / min(rgbd.camera.hw)))
        names = f"pairs/{number:06d}.{end}.webp", f"pairs/{number:06d}.{end}.png"
        parts += [(names[0], webp(small.color)), (names[1], png(small.depth))]
        entry[end] = {"color": names[0], "depth": names[1], "camera": _camera_entry(small)}
    return entry, parts


def _camera_entry(rgbd: RGBD) -> dict[str, Any]:
    camera = rgbd.camera
    numbers = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    return numbers | {"world_from_cam": camera.world_from_cam.tolist()}


def camera_of(entry: dict[str, Any]) -> Camera:
    """The camera that a pack's index tells of."""
    return Camera(**{**entry, "world_from_cam": np.array(entry["world_from_cam"])})


def smaller(picture: UInt8Array, size: int) -> UInt8Array:
    """A photo with its smaller side brought down to `size` px and its longer one cut to LONGEST times that."""
    import cv2

    least = min(picture.shape[:2])
    reach = int(LONGEST * least)
    top, left = (max(0, (length - reach) // 2) for length in picture.shape[:2])
    part = picture[top : top + reach, left : left + reach]
    if least <= size:
        return np.ascontiguousarray(part)
    wh = round(part.shape[1] * size / least), round(part.shape[0] * size / least)
    return np.asarray(cv2.resize(part, wh, interpolation=cv2.INTER_AREA), np.uint8)


def webp(color: UInt8Array) -> bytes:
    """H x W x 3 RGB as a WebP file."""
    import cv2

    bgr = np.ascontiguousarray(color[..., ::-1])
    return bytes(cv2.imencode(".webp", bgr, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1])


def png(depth: Float32Array) -> bytes:
    """H x W metres as a 16-bit PNG file of millimetres."""
    import cv2

    valid = (depth > 0) & (depth < np.inf)
    codes = np.clip(np.rint(np.where(valid, depth, 0) * MILLIMETRES), 1, FAR_CODE - 1)
    codes = np.where(valid, codes, np.where(np.isposinf(depth), FAR_CODE, 0)).astype(np.uint16)
    return bytes(cv2.imencode(".png", codes, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])


def _shuffled(things: Sequence[Any], rng: np.random.Generator) -> list[Any]:
    return [things[i] for i in rng.permutation(len(things))]


def _write(output: Path, index: bytes, parts: list[tuple[str, bytes]]) -> int:
    """The file, whole or not at all; its size in bytes."""
    with new_file(output) as draft:
        with zipfile.ZipFile(draft, "w", zipfile.ZIP_STORED) as archive:
            for name, data in _all(index, parts):
                archive.writestr(zipfile.ZipInfo(name, EPOCH), data)
        return draft.stat().st_size


def _all(index: bytes, parts: list[tuple[str, bytes]]) -> Iterator[tuple[str, bytes]]:
    yield INDEX, index
    yield from parts
