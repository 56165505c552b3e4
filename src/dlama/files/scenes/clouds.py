"""A point cloud in, a PLY file out, and back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from plyfile import PlyData, PlyElement

from dlama.errors import FileError, any_error
from dlama.files.rasters.images import existing_file
from dlama.geometry.cloud import PointCloud
from dlama.geometry.codes import Origin
from dlama.writing.atomic_write import PathLike, new_file

COLORS = ("red", "green", "blue")


def write_ply(path: PathLike, cloud: PointCloud) -> None:
    """Write a binary little-endian PLY: x y z, red green blue, origin, confidence, all properties of `vertex`.

    Coordinates are world metres in OpenCV axes, float (double where any exceeds 10 km). Raises OutputError.
    """
    reach = float(np.abs(cloud.points).max()) if len(cloud) else 0.0
    real = "<f8" if reach > 1e4 else "<f4"  # beyond 10 km float32 is coarser than 1 mm
    layout = [(axis, real) for axis in "xyz"] + [(name, "u1") for name in (*COLORS, "origin")] + [("confidence", "<f4")]
    vertex = np.empty(len(cloud), layout)
    for i, (axis, name) in enumerate(zip("xyz", COLORS)):
        vertex[axis], vertex[name] = cloud.points[:, i], cloud.color[:, i]
    vertex["origin"], vertex["confidence"] = cloud.origin, cloud.confidence
    codes = ", ".join(f"{one.value} {one.name.lower()}" for one in Origin)
    words = [f"dlama: metres, x right, y down, z forward; origin {codes}"]
    with new_file(path) as draft:
        PlyData([PlyElement.describe(vertex, "vertex")], byte_order="<", comments=words).write(str(draft))


def read_ply(path: PathLike) -> PointCloud:
    """The vertices of a PLY file with x y z and 8-bit red green blue.

    Files of other programs have no `origin` (taken as measured) and no `confidence` (taken as 1), or mean something else by these
    names, in other numbers. Raises FileError.
    """
    file = existing_file(path)
    with any_error(FileError, f"{file}: is damaged, truncated or no PLY file"):
        _check_claims(file)
        data = PlyData.read(str(file))
    if "vertex" not in data:
        raise FileError(f"{file}: has no element 'vertex'")
    vertex = np.asarray(data["vertex"].data)
    with np.errstate(invalid="ignore", over="ignore"):  # signalling NaN of damaged files; reported below
        points = np.stack([_property(file, vertex, axis) for axis in "xyz"], axis=1).astype(np.float64)
    color = np.stack([_property(file, vertex, name) for name in COLORS], axis=1)
    if color.dtype != np.uint8:
        raise FileError(f"{file}: red green blue are {color.dtype}; uchar (0..255) is expected")
    if not np.isfinite(points).all():
        raise FileError(f"{file}: {int((~np.isfinite(points)).any(axis=1).sum())} points are not finite")
    origin = _own_values(vertex, "origin", max(Origin), Origin.MEASURED)
    confidence = _own_values(vertex, "confidence", 1.0, 1.0)
    return PointCloud(points, color, origin.astype(np.uint8), confidence.astype(np.float32))


def _own_values(vertex: np.ndarray, name: str, largest: float, default: float) -> np.ndarray:
    """A property as `write_ply` has it, from 0 to `largest`; where it is not there, or another program's, the default."""
    if name in (vertex.dtype.names or ()):
        values = np.asarray(vertex[name])
        if values.dtype.kind in "iuf" and ((values >= 0) & (values <= largest)).all():
            return values
    return np.full(len(vertex), default)


def _check_claims(file: Path) -> None:
    """Raise FileError where the header says that there is more than the file can hold: memory is taken by what it says."""
    with file.open("rb") as stream:
        head = stream.read(1 << 16).split(b"end_header")[0]
    stated, held = sum(map(int, re.findall(rb"^element \S+ (\d{1,20})", head, re.MULTILINE))), file.stat().st_size
    if stated > held:
        raise FileError(f"{file}: is damaged or truncated (its header states {stated} elements, in {held} bytes)")


def _property(file: PathLike, vertex: Any, name: str) -> np.ndarray:
    if name not in (vertex.dtype.names or ()):
        known = " ".join(vertex.dtype.names or ())
        raise FileError(f"{file}: vertices have no '{name}'; they have {known}")
    values = np.asarray(vertex[name])
    if values.dtype.kind not in "iuf":
        raise FileError(f"{file}: '{name}' of the vertices is a list; a number is expected")
    return values
