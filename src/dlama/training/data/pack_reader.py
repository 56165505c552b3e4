"""A pack in -> its photos and its takes, read on demand, out: the same nouns as those of folders."""

from __future__ import annotations

import functools
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import DlamaError, FileError
from dlama.geometry.rgbd import UInt8Array
from dlama.training.data.cases import WORDS, Take
from dlama.training.data.pack_format import FORMAT, INDEX, VERSION, unpacked
from dlama.training.data.photos import Photo

Places = dict[str, tuple[int, int]]
"""Name of a part -> where its header begins in the file, and its length in bytes."""


def read_pack(path: Path) -> tuple[tuple[Photo, ...], tuple[Take, ...]]:
    """Photos and takes; nothing but the index is read. FileError where the file is none of ours, or damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            index = json.loads(archive.read(INDEX))
            at = {part.filename: (part.header_offset, part.file_size) for part in archive.infolist()}
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: is no pack that `dlama pack` wrote, or is damaged ({error})") from error
    if not isinstance(index, dict) or index.get("format") != FORMAT or index.get("version") not in (1, VERSION):
        raise FileError(f"{path}: its {INDEX} does not say '{FORMAT}', version 1 or {VERSION}")
    try:
        photos = tuple(
            Photo(each["name"], functools.partial(load_photo, path, each["file"], at[each["file"]]))
            for each in index["photos"]
        )
        entries = index["takes"] if index["version"] > 1 else [_first_version(each) for each in index["pairs"]]
        return photos, tuple(_take(path, each, at) for each in entries)
    except (KeyError, TypeError) as error:
        raise FileError(f"{path}: its {INDEX} is incomplete: {error} is missing or of the wrong kind") from error


def _first_version(pair: dict[str, Any]) -> dict[str, Any]:
    """A pair of posed frames of a pack of version 1, as version 2 has it."""
    ends = {end: pair[end] for end in ("source", "target")}
    parts = {f"{end}.{what}": entry[what] for end, entry in ends.items() for what in ("color", "depth")}
    cameras = {end: entry["camera"] for end, entry in ends.items()}
    return {**pair, "kind": "frame", "cameras": cameras, "parts": parts}


def _take(path: Path, entry: dict[str, Any], at: Places) -> Take:
    if entry["kind"] not in WORDS:
        raise FileError(f"{path}: its {INDEX} has a take of kind {entry['kind']!r}; {', '.join(WORDS)} are known")
    places = {part: at[part] for part in entry["parts"].values()}
    load = functools.partial(load_take, path, entry, places)
    return Take(entry["kind"], entry["scene"], entry["name"], frozenset(entry["frames"]), load)


def load_photo(path: Path, name: str, place: tuple[int, int]) -> UInt8Array:
    """H x W x 3 RGB; FileError."""
    picture = _decoded(path, name, place)
    if picture.ndim != 3:
        raise FileError(f"{path}: {name} is grey; colours are wanted")
    return np.ascontiguousarray(picture[..., ::-1])


def load_take(path: Path, entry: dict[str, Any], places: Places) -> Any:
    """What `Take.load` gives of this kind; FileError."""
    parts: dict[str, str] = entry["parts"]

    def read(role: str) -> np.ndarray:
        name = parts[role]
        picture = _decoded(path, name, places[name])
        return np.ascontiguousarray(picture[..., ::-1]) if picture.ndim == 3 else picture

    try:
        return unpacked(entry["kind"], entry, frozenset(parts), read)
    except FileError:
        raise
    except (DlamaError, TypeError, KeyError) as error:
        raise FileError(f"{path}: {entry['scene']} {entry['name']}: {error}") from error


def _decoded(path: Path, name: str, place: tuple[int, int]) -> np.ndarray:
    """The picture of one part, as OpenCV reads it. Parts are not compressed, so they are read without a directory."""
    import cv2

    start, length = place
    try:
        with path.open("rb") as stream:
            stream.seek(start)
            head = stream.read(30)
            stream.seek(start + 30 + int.from_bytes(head[26:28], "little") + int.from_bytes(head[28:30], "little"))
            data = stream.read(length)
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if len(data) == length else None
    if picture is None:
        raise FileError(f"{path}: {name} is damaged or truncated")
    return np.asarray(picture)
