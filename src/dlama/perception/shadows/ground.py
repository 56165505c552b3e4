"""A picture with depth and an object's mask in; the crop of its shadow, the plane it stands on, and its points over that, out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import box_around, dilate_mask, morphological_close, sides_of, square
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.supports import Planes
from dlama.perception.planes import plane_normal, plane_values

EDGE_PX = 2
"""Pixels round the object that are mixes of it and its surroundings."""
GAP_PX = 7
"""Noise of matched depth leaves gaps in the ground: narrower ones that are on no other plane belong to it."""
SIDE = 320
"""Longer side of the crop in its own pixels."""


@dataclass(frozen=True)
class Crop:
    """The part of a picture in which a shadow is searched."""

    rows: slice
    columns: slice
    scale: float
    """Pixels of the crop in one of the picture."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the crop; what lies right of it and below is empty."""
        wide, high = self.columns.stop - self.columns.start, self.rows.stop - self.rows.start
        return min(SIDE, max(1, round(wide * self.scale))), min(SIDE, max(1, round(high * self.scale)))

    def small(self, picture: np.ndarray) -> np.ndarray:
        """The crop of a picture (H x W or H x W x 3) at the crop's size, float32."""
        part = np.ascontiguousarray(picture[self.rows, self.columns]).astype(np.float32)
        how = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_LINEAR
        return cv2.resize(part, self.size, interpolation=how)

    def large(self, plane: Float32Array, hw: tuple[int, int]) -> Float32Array:
        """A plane of the crop at its place in a picture of H x W; 0 outside the crop."""
        wide, high = self.size
        return self.place(plane[:high, :wide], hw)

    def place(self, plane: Float32Array, hw: tuple[int, int]) -> Float32Array:
        """A plane that covers just the crop, of any size, in a picture of H x W; 0 outside the crop."""
        out = np.zeros(hw, np.float32)
        box = out[self.rows, self.columns]
        box[:] = cv2.resize(plane, box.shape[::-1], interpolation=cv2.INTER_LINEAR)
        return out


def crop_around(mask: BoolArray) -> Crop:
    """The crop in which an object's shadow is searched; margins in diagonals of the object: 1.6 aside, 1.2 below, 0.5 above."""
    rows, columns = tight = box_around(mask, 0)
    height, width = mask.shape
    diagonal = float(np.hypot(*sides_of(tight))) + 8
    top, bottom = max(0, int(rows.start - 0.5 * diagonal)), min(height, int(rows.stop + 1.2 * diagonal))
    left, right = max(0, int(columns.start - 1.6 * diagonal)), min(width, int(columns.stop + 1.6 * diagonal))
    scale = min(2.0, SIDE / max(bottom - top, right - left))
    return Crop(slice(top, bottom), slice(left, right), scale)


@dataclass(frozen=True, eq=False)
class Ground:
    """The surface that an object stands on."""

    normal: NDArray[np.float64]
    """n of the plane n . p = 1 over points in camera axes, 1/m; the camera is on its side where n . p < 1."""
    surface: BoolArray
    """H x W, True where it is seen."""

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres over the surface of points (... x 3, camera axes)."""
        return np.asarray((1 - points @ self.normal) / float(np.linalg.norm(self.normal)))


@dataclass(frozen=True, eq=False)
class StandingObject:
    """An object's points over its supporting surface."""

    base: NDArray[np.float64]
    """N x 3 points projected on the surface along its normal, camera axes."""
    rise: NDArray[np.float64]
    """N heights, m."""
    up: NDArray[np.float64]
    """The surface's normal, towards the camera."""


def measure_object(points: NDArray[np.float64], rise: NDArray[np.float64], ground: Ground) -> StandingObject:
    """The object with the given points (N x 3, camera axes) and heights over the surface (N, m)."""
    up = -ground.normal / np.linalg.norm(ground.normal)
    return StandingObject(points - rise[:, None] * up, rise, up)


def surface_axes(up: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit vectors along the surface whose normal is `up`: across the view, and away from the camera."""
    across = np.cross(up, [0.0, 0.0, 1.0])
    across /= max(float(np.linalg.norm(across)), 1e-9)
    return across, np.cross(across, up)


def light_offsets(up: NDArray[np.float64], slopes: np.ndarray, angles: np.ndarray) -> NDArray[np.float64]:
    """K x 3 offset of a point's shadow, metres over the surface for each metre of height, camera axes.

    slopes: K, lengths of the offset; angles: K, its directions, in radians from the first of the `surface_axes` towards the
    second.
    """
    across, behind = surface_axes(up)
    return np.asarray(slopes[:, None] * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), behind)))


def find_ground(rgbd: RGBD, mask: BoolArray, found: Planes) -> Ground | None:
    """The plane with most pixels just below and next to the lower part of the object; None where there is none."""
    rows = np.flatnonzero(mask.any(1))
    if not len(rows) or not len(found.planes):
        return None
    lower = np.zeros(mask.shape, np.bool_)
    lower[int(rows[0] + 0.6 * (rows[-1] - rows[0])) :] = True
    ring = dilate_mask(mask, 6) & ~mask & lower
    counts = np.bincount(found.label[ring & (found.label > 0)], minlength=len(found.planes) + 1)
    number = int(counts.argmax())
    if number < 1 or counts[number] < 10:
        return None
    normal = plane_normal(found.planes[number - 1], rgbd.camera)
    on_plane = found.label == number
    closed = morphological_close(on_plane & rgbd.valid | mask, square(GAP_PX))
    surface = on_plane | (closed & (found.label < 1))
    if rgbd.estimate is not None:  # estimated ground bends
        value = plane_values(found.planes[number - 1 : number], mask.shape)[0]
        surface = np.abs(value - found.inverse_depth) < 0.2 * found.inverse_depth
    return Ground(normal, np.asarray(surface & rgbd.valid & ~mask))


def object_points(rgbd: RGBD, mask: BoolArray, ground: Ground) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """N x 3 points of the object in camera axes, about 8000 at most, and their heights over the surface in metres.

    Estimated depth tilts objects towards the ground: there the object is a vertical plane at its ground contact.
    """
    rows, columns = np.nonzero(mask & rgbd.valid)
    keep = slice(None, None, max(1, len(rows) // 8000))
    directions, depth = rays(rgbd.camera)[rows[keep], columns[keep]], rgbd.depth[rows[keep], columns[keep]]
    if rgbd.estimate is not None and len(rows):
        base = rays(rgbd.camera)[rows[-1], int(np.median(columns[rows > rows[-1] - 3]))]
        depth = np.full_like(depth, 1 / max(float(base @ ground.normal), 1e-6))
    points = directions * depth[:, None]
    return points, np.maximum(ground.heights(points), 0)
