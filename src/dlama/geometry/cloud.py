"""PointCloud and Mesh: coloured points in the world, each with origin and confidence; loose, or joined by triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from dlama.errors import ShapeError, format_count
from dlama.geometry.camera import Float64Array
from dlama.geometry.figures.points import point_viewer
from dlama.geometry.rgbd import Float32Array, UInt8Array, check_fields, freeze, row_count


@dataclass(frozen=True, eq=False)
class PointCloud:
    """N points of the world, in metres and in no order; `lift` of a View has them in the order of its valid pixels.

    Raises ShapeError when the fields do not have the same length, or dtypes are off."""

    points: Float64Array
    """N x 3, world coordinates in metres (float64, so that geo-referenced scenes keep their millimetres)."""
    color: UInt8Array
    """N x 3, RGB."""
    origin: UInt8Array
    """N, Origin codes (`dlama.geometry.codes.Origin`)."""
    confidence: Float32Array
    """N, in 0..1."""

    def __post_init__(self) -> None:
        vars(self).update(check_fields(vars(self), "cloud", _fields_of("points", row_count(self.points))))

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        points = format_count(len(self), "point")
        return f"PointCloud({points}, {describe_extent(self.points)})"

    def _repr_html_(self) -> str:
        return point_viewer(repr(self), self)


def _fields_of(places: str, count: int) -> dict[str, tuple[tuple[int, ...], type]]:
    """Shapes and types of the arrays of N points or vertices, whose `places` have that name."""
    return {
        places: ((count, 3), np.float64),
        "color": ((count, 3), np.uint8),
        "origin": ((count,), np.uint8),
        "confidence": ((count,), np.float32),
    }


def describe_extent(points: Float64Array) -> str:
    """Size of the box that holds N x 3 points (metres, along x, y and z), for people: `4 x 2.5 x 10 m`, `empty`."""
    return " x ".join(f"{size:.3g}" for size in np.ptp(points, axis=0)) + " m" if len(points) else "empty"


def concatenate(clouds: Sequence[PointCloud]) -> PointCloud:
    """One cloud of all points, in order; no clouds give an empty one."""
    if not clouds:
        return PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0, np.uint8), np.zeros(0, np.float32))
    return PointCloud(
        *(np.concatenate([getattr(cloud, field.name) for cloud in clouds]) for field in fields(PointCloud))
    )


@dataclass(frozen=True, eq=False)
class Mesh:
    """N vertices in the world, in metres, and M triangles, whose normals point to where they were seen from.

    Raises ShapeError when lengths, dtypes or vertex numbers do not fit."""

    vertices: Float64Array
    """N x 3, world coordinates in metres, OpenCV axes."""
    triangles: NDArray[np.int32]
    """M x 3, vertex numbers; counter-clockwise as seen: normals by the right-hand rule point to the camera."""
    color: UInt8Array
    """N x 3, RGB, sRGB-encoded."""
    origin: UInt8Array
    """N, Origin codes."""
    confidence: Float32Array
    """N, in 0..1."""

    def __post_init__(self) -> None:
        count, faces = row_count(self.vertices), row_count(self.triangles)
        fields = {**_fields_of("vertices", count), "triangles": ((faces, 3), np.int32)}
        vars(self).update(check_fields(vars(self), "mesh", fields))
        if faces and not 0 <= int(self.triangles.min()) <= int(self.triangles.max()) < count:
            raise ShapeError(f"mesh.triangles name vertices outside 0..{count - 1}")

    def __repr__(self) -> str:
        triangles = format_count(len(self.triangles), "triangle")
        return f"Mesh({len(self.vertices)} vertices, {triangles}, {describe_extent(self.vertices)})"


def join_meshes(parts: Sequence[Mesh]) -> Mesh:
    """One mesh of several, at least one."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts], dtype=np.int32)
    triangles = np.concatenate([part.triangles + start for part, start in zip(parts, starts)])
    planes = ([getattr(part, name) for part in parts] for name in ("vertices", "color", "origin", "confidence"))
    vertices, *others = (freeze(np.concatenate(each)) for each in planes)
    return Mesh(vertices, freeze(triangles), *others)
