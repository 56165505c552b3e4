"""Camera: numbers in, rays and pixels out. The conventions of the whole package are said here, once.

Axes        OpenCV: x right, y down, z forward. Metres. Depth is planar z, not ray length.
Poses       `world_from_cam` is 4x4, camera to world. Transforms are called `<to>_from_<from>`.
Pixels      The centre of the first pixel is at (0.5, 0.5): pixel (row v, column u) is the ray through (u + 0.5, v + 0.5).
            Files that put it at 0.0 are converted where they are read (`dlama.files.cameras`).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlama.errors import CameraError

Float64Array = NDArray[np.float64]

ROTATION_TOLERANCE = 1e-3
"""Largest entry of R^T R - I that still counts as a rotation (7-Scenes' published poses reach 4e-4)."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera without distortion, at a pose.

    Raises CameraError when the size is not positive, a focal length is not positive, any number is not finite,
    or the pose is not a rigid motion.
    """

    width: int
    """Picture width in pixels."""
    height: int
    """Picture height in pixels."""
    fx: float
    """Horizontal focal length in pixels."""
    fy: float
    """Vertical focal length in pixels."""
    cx: float
    """Principal point, x, in pixels; the first pixel's centre is at 0.5."""
    cy: float
    """Principal point, y, in pixels; the first pixel's centre is at 0.5."""
    world_from_cam: Float64Array = field(default_factory=lambda: np.eye(4))
    """4x4 rigid motion, camera to world, metres."""

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise CameraError(f"camera size is {self.width}x{self.height}; width and height must be at least 1")
        for name in ("fx", "fy", "cx", "cy"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise CameraError(f"camera {name} is {value}; a finite number of pixels is wanted")
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if value <= 0:
                raise CameraError(f"camera {name} is {value}; K is singular or negative, a focal length > 0 is wanted")
        object.__setattr__(self, "world_from_cam", checked_pose(self.world_from_cam))

    @classmethod
    def from_fov(cls, width: int, height: int, fov_deg: float, world_from_cam: ArrayLike | None = None) -> Camera:
        """Camera with square pixels, centred, from its horizontal field of view in degrees (0 < fov < 180)."""
        if not 0 < fov_deg < 180:
            raise CameraError(f"field of view is {fov_deg} degrees; a value between 0 and 180 is wanted")
        focal = 0.5 * width / math.tan(math.radians(fov_deg) / 2)
        pose = np.eye(4) if world_from_cam is None else np.asarray(world_from_cam, np.float64)
        return cls(width, height, focal, focal, width / 2, height / 2, pose)

    @property
    def hw(self) -> tuple[int, int]:
        """(height, width), the shape of a picture."""
        return self.height, self.width

    @property
    def wh(self) -> tuple[int, int]:
        """(width, height), as OpenCV and Pillow want sizes."""
        return self.width, self.height

    @property
    def K(self) -> Float64Array:
        """3x3 intrinsic matrix; the first pixel's centre is at (0.5, 0.5)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], np.float64)

    @property
    def cam_from_world(self) -> Float64Array:
        """4x4 rigid motion, world to camera, metres."""
        return inverse_pose(self.world_from_cam)

    @property
    def fov_deg(self) -> float:
        """Horizontal field of view in degrees."""
        return math.degrees(math.atan(self.cx / self.fx) + math.atan((self.width - self.cx) / self.fx))

    def at(self, world_from_cam: ArrayLike) -> Camera:
        """The same camera at another pose."""
        return dataclasses.replace(self, world_from_cam=np.asarray(world_from_cam, np.float64))

    def same_lens_as(self, other: Camera) -> bool:
        """True if size and intrinsics are equal (within 1e-9 px)."""
        mine = (self.fx, self.fy, self.cx, self.cy)
        theirs = (other.fx, other.fy, other.cx, other.cy)
        return self.hw == other.hw and all(abs(a - b) <= 1e-9 for a, b in zip(mine, theirs))

    def same_view_as(self, other: Camera) -> bool:
        """True if a picture of one is a picture of the other: same lens, same pose (within 1e-9)."""
        return self.same_lens_as(other) and float(np.abs(self.world_from_cam - other.world_from_cam).max()) <= 1e-9


def inverse_pose(b_from_a: Float64Array) -> Float64Array:
    """Inverse of a 4x4 rigid motion: R^T and -R^T t, so that there and back is exact to rounding."""
    a_from_b = np.eye(4)
    a_from_b[:3, :3] = b_from_a[:3, :3].T
    a_from_b[:3, 3] = -b_from_a[:3, :3].T @ b_from_a[:3, 3]
    return a_from_b


def checked_pose(pose: ArrayLike) -> Float64Array:
    """A read-only float64 copy of a 4x4 rigid motion; raises CameraError when it is none.

    The rotation is replaced by the nearest exact one, so that published poses rounded to a few digits compose cleanly.
    """
    matrix = np.array(pose, np.float64)
    if matrix.shape != (4, 4):
        raise CameraError(f"world_from_cam has shape {matrix.shape}; a 4x4 matrix is wanted")
    if not np.isfinite(matrix).all():
        raise CameraError("world_from_cam holds NaN or infinity; a finite rigid motion is wanted")
    if not np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-9):
        raise CameraError(f"world_from_cam ends with the row {matrix[3].tolist()}; 0 0 0 1 is wanted")
    rotation = matrix[:3, :3]
    error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if error > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        kind = "a mirroring" if np.linalg.det(rotation) < 0 else f"off by {error:.3g} from orthonormal"
        raise CameraError(f"world_from_cam is not a rigid motion: its 3x3 part is {kind}; a rotation is wanted")
    if error > 1e-12:
        u, _, vt = np.linalg.svd(rotation)
        matrix[:3, :3] = u @ vt
    matrix.flags.writeable = False
    return matrix
