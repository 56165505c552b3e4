"""Pictures and datasets in -> one pack file of a stated size that trains without any other file, out.

A pack is an uncompressed ZIP: `index.json` first, then photos as WebP and the cases of datasets (pairs of posed frames, removals,
stereo pairs) as `pack_format` encodes them, each with the smaller side brought to the pack's size. The same input gives the same
bytes.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dlama.completion.recipes import check_seed
from dlama.errors import FileError, InputError, system_errors
from dlama.files.atomic_write import new_file
from dlama.geometry.rgbd import UInt8Array
from dlama.training.data.cases import KIND_NAMES, TrainingCase
from dlama.training.data.crops import resize_color
from dlama.training.data.pack_format import CASES, ENCODERS, FORMAT, INDEX, PHOTOS, VERSION, webp
from dlama.training.data.photos import Photo
from dlama.training.data.sources import find_training_data

LONGEST = 1.5
"""A photo's longer side is cut (about its centre) to so many times the smaller one."""
CASE_SHARE = 0.5
"""Of the file, where there are photos and cases; what one of them leaves free the other gets."""
EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of all parts, ZIP's earliest."""
PART_BYTES, END_BYTES = 30 + 46, 22
"""What ZIP adds for each part (plus twice its name) and at the end."""

Entry = tuple[dict[str, Any], list[tuple[str, bytes]]]
"""What the index says of a photo or case, and its parts: name in the archive, bytes."""


@dataclass
class PackContents:
    """What goes into a pack, while it is collected."""

    bytes_left: float
    parts: list[tuple[str, bytes]] = field(default_factory=list)
    """Name in the archive, bytes."""
    listed: dict[str, list[dict[str, Any]]] = field(default_factory=lambda: {PHOTOS: [], CASES: []})
    """Tables of the index."""

    def add(self, table: str, entry: Entry, reserve: float) -> bool:
        """Add an entry with its parts if `reserve` bytes stay free; whether it was added."""
        about, parts = entry
        cost = len(json.dumps(about)) + 2 + sum(len(data) + PART_BYTES + 2 * len(name) for name, data in parts)
        if self.bytes_left - cost < reserve:
            return False
        self.bytes_left -= cost
        self.parts += parts
        self.listed[table].append(about)
        return True

    def fill(self, table: str, entries: Iterable[Entry], reserve: float) -> None:
        """Add entries until one does not fit."""
        for entry in entries:
            if not self.add(table, entry, reserve):
                return


@system_errors(FileError)
def pack(data: Sequence[Path], output: Path, megabytes: float = 45.0, size: int = 256, seed: int = 0) -> list[str]:
    """Write a pack; returns lines that say what is in it.

    Args:
        data: folders of pictures, datasets, other packs.
        output: the file; an older one of that name stays until the new one is whole.
        megabytes: millions of bytes that it has at most.
        size: pixels that the smaller side of larger pictures is brought down to; 16 or more.
        seed: of the random choice, where not everything fits.
    Raises:
        InputError: `data` is empty or has no picture that fits, `size` is too small, or memory cannot hold the pack.
        FileError: a file of `data` cannot be read.
        OutputError: `output` cannot be written, or the disk cannot hold it.
    """
    if not data:
        raise InputError("nothing to pack: give folders of pictures or of data sets")
    if size < 16:
        raise InputError(f"`size` is {size} px; 16 or more is expected")
    if not megabytes > 0:
        raise InputError(f"`megabytes` is {megabytes}; more than 0 is expected")
    found, rng = find_training_data(data), np.random.default_rng(check_seed(seed))
    contents = PackContents(megabytes * 1e6 - END_BYTES - 2 * len(INDEX) - PART_BYTES - 200)
    reserve = contents.bytes_left * (1 - CASE_SHARE) if found.photos else 0.0
    cases, photos = _shuffle(found.cases, rng), _shuffle(found.photos, rng)
    contents.fill(CASES, (_case_entry(case, n, size) for n, case in enumerate(cases)), reserve)
    contents.fill(PHOTOS, (_photo_entry(photo, n, size) for n, photo in enumerate(photos)), 0.0)
    if not contents.parts:
        raise InputError(f"{megabytes:g} MB hold not one picture; more is expected")
    index = {"format": FORMAT, "version": VERSION, "size": size, **contents.listed}
    written = _write(output, json.dumps(index).encode(), contents.parts)
    return [f"{output}: {written / 1e6:.2f} MB, sides of {size} px", *_summary(contents, len(photos), cases)]


def _summary(contents: PackContents, photos: int, cases: Sequence[TrainingCase]) -> list[str]:
    """Lines: how many of the photos and of each kind of case are in the pack."""
    counts = {"photos": (len(contents.listed[PHOTOS]), photos)}
    for kind, words in KIND_NAMES.items():
        packed = sum(entry["kind"] == kind for entry in contents.listed[CASES])
        counts[words] = packed, sum(case.kind == kind for case in cases)
    return [f"    {packed} of {given} {words}" for words, (packed, given) in counts.items() if given]


def _photo_entry(photo: Photo, number: int, size: int) -> Entry:
    name = f"photos/{number:06d}.webp"
    return {"name": photo.name, "file": name}, [(name, webp(shrink_photo(photo.load(), size)))]


def _case_entry(case: TrainingCase, number: int, size: int) -> Entry:
    about, parts = ENCODERS[case.kind](case.load(), size)
    kinds = {role: "png" if data.startswith(b"\x89PNG") else "webp" for role, data in parts.items()}
    names = {role: f"takes/{number:06d}.{role}.{kind}" for role, kind in kinds.items()}
    entry = {"kind": case.kind, "scene": case.scene, "name": case.name, "frames": sorted(case.frames), **about}
    return entry | {"parts": names}, [(names[role], data) for role, data in parts.items()]


def shrink_photo(picture: UInt8Array, size: int) -> UInt8Array:
    """H x W x 3 with its smaller side brought down to `size` px and its longer one cut to LONGEST times that."""
    least = min(picture.shape[:2])
    longest = int(LONGEST * least)
    top, left = (max(0, (length - longest) // 2) for length in picture.shape[:2])
    part = picture[top : top + longest, left : left + longest]
    if least <= size:
        return np.ascontiguousarray(part)
    return resize_color(part, (round(part.shape[0] * size / least), round(part.shape[1] * size / least)))


def _shuffle(items: Sequence[Any], rng: np.random.Generator) -> list[Any]:
    return [items[i] for i in rng.permutation(len(items))]


def _write(output: Path, index: bytes, parts: list[tuple[str, bytes]]) -> int:
    """Write the file, whole or not at all; its size in bytes."""
    with new_file(output) as draft:
        with zipfile.ZipFile(draft, "w", zipfile.ZIP_STORED) as archive:
            for name, data in ((INDEX, index), *parts):
                archive.writestr(zipfile.ZipInfo(name, EPOCH), data)
        return draft.stat().st_size
