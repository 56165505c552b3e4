"""PointCloud: unordered coloured points in the world, each with origin and confidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dlama.errors import format_count
from dlama.geometry.camera import Float64Array
from dlama.geometry.figures.points import point_viewer
from dlama.geometry.rgbd import Float32Array, UInt8Array, check_fields, row_count


@dataclass(frozen=True, eq=False)
class PointCloud:
    """N points. Raises ShapeError when the fields do not have the same length, or dtypes are off."""

    points: Float64Array
    """N x 3, world coordinates in metres (float64, so that geo-referenced scenes keep their millimetres)."""
    color: UInt8Array
    """N x 3, RGB."""
    origin: UInt8Array
    """N, Origin codes (`dlama.geometry.codes.Origin`)."""
    confidence: Float32Array
    """N, in 0..1."""

    def __post_init__(self) -> None:
        count = row_count(self.points)
        fields: dict[str, tuple[tuple[int, ...], type]] = {
            "points": ((count, 3), np.float64),
            "color": ((count, 3), np.uint8),
            "origin": ((count,), np.uint8),
            "confidence": ((count,), np.float32),
        }
        check_fields(self, "cloud", fields)

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        points = format_count(len(self), "point")
        return f"PointCloud({points}, {describe_extent(self.points)})"

    def _repr_html_(self) -> str:
        return point_viewer(repr(self), self.points, self.color, self.origin, self.confidence)


def describe_extent(points: Float64Array) -> str:
    """Size of the box that holds N x 3 points (metres, along x, y and z), for people: `4 x 2.5 x 10 m`, `empty`."""
    return " x ".join(f"{size:.3g}" for size in np.ptp(points, axis=0)) + " m" if len(points) else "empty"


def concatenate(clouds: Sequence[PointCloud]) -> PointCloud:
    """One cloud of all points, in order; no clouds give an empty one."""
    if not clouds:
        return PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0, np.uint8), np.zeros(0, np.float32))
    return PointCloud(
        np.concatenate([c.points for c in clouds]),
        np.concatenate([c.color for c in clouds]),
        np.concatenate([c.origin for c in clouds]),
        np.concatenate([c.confidence for c in clouds]),
    )
