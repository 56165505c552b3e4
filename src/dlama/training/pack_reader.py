"""A pack in -> its photos and its pairs of frames, read on demand, out: the same nouns as those of folders."""

from __future__ import annotations

import functools
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.frames import ViewTruth
from dlama.errors import FileError, InputError
from dlama.geometry.rgbd import RGBD, Float32Array, UInt8Array
from dlama.training.frame_samples import Pair
from dlama.training.pack import FAR_CODE, FORMAT, INDEX, MILLIMETRES, VERSION, camera_of
from dlama.training.photos import Photo


def read_pack(path: Path) -> tuple[tuple[Photo, ...], tuple[Pair, ...]]:
    """Photos and pairs; nothing but the index is read. FileError where the file is none of ours, or damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            index = json.loads(archive.read(INDEX))
            at = {part.filename: (part.header_offset, part.file_size) for part in archive.infolist()}
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: is no pack that `dlama pack` wrote, or is damaged ({error})") from error
    if not isinstance(index, dict) or index.get("format") != FORMAT or index.get("version") != VERSION:
        raise FileError(f"{path}: its {INDEX} does not say '{FORMAT}', version {VERSION}")
    try:
        photos = tuple(
            Photo(each["name"], functools.partial(load_photo, path, each["file"], at[each["file"]]))
            for each in index["photos"]
        )
        return photos, tuple(_pair(path, each, at) for each in index["pairs"])
    except (KeyError, TypeError) as error:
        raise FileError(f"{path}: its {INDEX} is incomplete: {error} is missing or of the wrong kind") from error


def _pair(path: Path, entry: dict[str, Any], at: dict[str, tuple[int, int]]) -> Pair:
    places = {part: at[part] for end in ("source", "target") for part in (entry[end]["color"], entry[end]["depth"])}
    load = functools.partial(load_pair, path, entry, places)
    return Pair(entry["scene"], entry["name"], frozenset(entry["frames"]), load)


def load_photo(path: Path, name: str, place: tuple[int, int]) -> UInt8Array:
    """H x W x 3 RGB; FileError."""
    return np.ascontiguousarray(_decoded(path, name, place, 3)[..., ::-1])


def load_pair(path: Path, entry: dict[str, Any], places: dict[str, tuple[int, int]]) -> ViewTruth:
    """Both frames of a pair; FileError, CameraError."""
    ends = []
    for end in ("source", "target"):
        about = entry[end]
        color = load_photo(path, about["color"], places[about["color"]])
        depth = _metres(_decoded(path, about["depth"], places[about["depth"]], 2))
        try:
            ends.append(RGBD(color, depth, camera_of(about["camera"])))
        except (InputError, TypeError, KeyError) as error:
            raise FileError(f"{path}: {about['color']}: {error}") from error
    return ViewTruth(ends[0], ends[1], exposure_varies=bool(entry["exposure_varies"]))


def _metres(codes: np.ndarray) -> Float32Array:
    return np.where(codes == FAR_CODE, np.float32(np.inf), (codes / MILLIMETRES).astype(np.float32)).astype(np.float32)


def _decoded(path: Path, name: str, place: tuple[int, int], axes: int) -> np.ndarray:
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
    if picture is None or picture.ndim != axes:
        raise FileError(f"{path}: {name} is damaged or truncated")
    return np.asarray(picture)
