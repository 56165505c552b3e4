"""Pictures and data sets in -> one file of a stated size that trains anywhere with no other file, out; and back.

A pack is an uncompressed ZIP: `index.json` first, then photos as WebP and the takes of data sets (pairs of posed frames,
removals, stereo pairs) as `pack_takes` has them, each with the smaller side brought to the pack's size. The same input gives
the same bytes.
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
from dlama.files.atomic_write import new_file
from dlama.geometry.rgbd import UInt8Array
from dlama.training.data.cases import WORDS, Take
from dlama.training.data.crops import resized_color
from dlama.training.data.pack_format import FORMAT, INDEX, VERSION, packed, webp
from dlama.training.data.photos import Photo

LONGEST = 1.5
"""A photo's longer side is cut (about its centre) to so many times the smaller one."""
TAKE_SHARE = 0.5
"""Of the file, where there are photos as well as takes; what one does not need the other gets."""
EPOCH = (1980, 1, 1, 0, 0, 0)
PART_BYTES, END_BYTES = 30 + 46, 22
"""What ZIP adds for each part (plus twice its name) and at the end."""


@dataclass
class Draft:
    """What goes into a pack, while it is collected."""

    room: float
    """Bytes left."""
    parts: list[tuple[str, bytes]] = field(default_factory=list)
    listed: dict[str, list[dict[str, Any]]] = field(default_factory=lambda: {"photos": [], "takes": []})

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
    from dlama.training.data.sources import gathered

    if not data:
        raise InputError("nothing to pack: give folders of pictures or of data sets")
    if size < 16:
        raise InputError(f"size is {size} px; 16 or more is wanted")
    found, rng = gathered(data), np.random.default_rng(seed)
    draft = Draft(megabytes * 1e6 - END_BYTES - 2 * len(INDEX) - PART_BYTES - 200)
    spare = draft.room * (1 - TAKE_SHARE) if found.photos else 0.0
    takes, photos = _shuffled(found.takes, rng), _shuffled(found.photos, rng)
    _fill(draft, "takes", (_packed_take(take, n, size) for n, take in enumerate(takes)), spare)
    _fill(draft, "photos", (_packed_photo(photo, n, size) for n, photo in enumerate(photos)), 0.0)
    if not draft.parts:
        raise InputError(f"{megabytes:g} MB hold not one picture; more is wanted")
    index = {"format": FORMAT, "version": VERSION, "size": size, **draft.listed}
    written = _write(output, json.dumps(index).encode(), draft.parts)
    lines = [f"{output}: {written / 1e6:.2f} MB, sides of {size} px"]
    counts = {"photos": (len(draft.listed["photos"]), len(photos))}
    for kind, words in WORDS.items():
        taken = sum(entry["kind"] == kind for entry in draft.listed["takes"])
        counts[words] = taken, sum(take.kind == kind for take in takes)
    return lines + [f"    {taken} of {given} {words}" for words, (taken, given) in counts.items() if given]


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


def _packed_take(take: Take, number: int, size: int) -> tuple[dict[str, Any], list[tuple[str, bytes]]]:
    about, parts = packed(take.kind, take.load(), size)
    names = {role: f"takes/{number:06d}.{role}.{_suffix(data)}" for role, data in parts.items()}
    entry = {"kind": take.kind, "scene": take.scene, "name": take.name, "frames": sorted(take.frames), **about}
    return entry | {"parts": names}, [(names[role], data) for role, data in parts.items()]


def _suffix(data: bytes) -> str:
    return "png" if data.startswith(b"\x89PNG") else "webp"


def smaller(picture: UInt8Array, size: int) -> UInt8Array:
    """A photo with its smaller side brought down to `size` px and its longer one cut to LONGEST times that."""
    least = min(picture.shape[:2])
    reach = int(LONGEST * least)
    top, left = (max(0, (length - reach) // 2) for length in picture.shape[:2])
    part = picture[top : top + reach, left : left + reach]
    if least <= size:
        return np.ascontiguousarray(part)
    return resized_color(part, (round(part.shape[0] * size / least), round(part.shape[1] * size / least)))


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
