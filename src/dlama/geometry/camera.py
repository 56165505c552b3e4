"""Camera: intrinsics and a pose in; the camera, parts and other sizes of it, and a rectified pair of two out.

The conventions of the whole package are defined here, once.

Axes        OpenCV: x right, y down, z forward. Metres. Depth is planar z, not ray length.
Poses       `world_from_cam` is 4x4, camera to world. Transforms are called `<to>_from_<from>`.
Pixels      The centre of the first pixel is at (0.5, 0.5): pixel (row v, column u) is the ray through (u + 0.5, v + 0.5).
            Intrinsics that put it at 0.0 (OpenCV, TUM, Open3D, Middlebury) are converted by `Camera.from_K`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from dlama.arguments import check, format_value, is_finite
from dlama.errors import CameraError, check_same_size
from dlama.geometry.motion.poses import FARTHEST_M as FARTHEST_M
from dlama.geometry.motion.poses import Float64Array as Float64Array
from dlama.geometry.motion.poses import as_matrix, check_pose, invert_pose

LARGEST_PX = 1e7
"""Pixels: no focal length or principal point lies beyond (a telescope's is some 1e6)."""
SMALLEST_FOCAL_PX = 1e-3
"""Pixels: any shorter focal length sees a half space."""


def _check_size(width: int, height: int) -> None:
    for name, value in (("width", width), ("height", height)):
        if not is_finite(value) or value % 1:
            raise CameraError(f"camera `{name}` is {format_value(value)}; a whole number of pixels is expected")
    if width < 1 or height < 1:
        raise CameraError(f"camera size is {width}x{height}; width and height must be at least 1")


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera without distortion, at a pose.

    Raises CameraError when the size is not positive, a focal length is not positive, any number is not finite,
    beyond what arithmetic bears (focal lengths 0.001 to 1e7 px, positions 1e9 m), or the pose is not a rigid motion.
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
        _check_size(self.width, self.height)
        for name in ("width", "height"):  # 64.0 and NumPy's numbers of 16 bits would fail in what is made of them
            object.__setattr__(self, name, int(getattr(self, name)))
        for name in ("fx", "fy", "cx", "cy"):
            value = getattr(self, name)
            if not is_finite(value):
                raise CameraError(f"camera `{name}` is {format_value(value)}; a finite number of pixels is expected")
            value = float(value)  # kernels take no numbers of torch, nor of 16 bits
            if abs(value) > LARGEST_PX:
                raise CameraError(f"camera `{name}` is {value:g} px; at most {LARGEST_PX:g} px is expected")
            object.__setattr__(self, name, value)
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if value < SMALLEST_FOCAL_PX:
                raise CameraError(
                    f"camera `{name}` is {value}; K is singular or negative, at least {SMALLEST_FOCAL_PX:g} px is expected"
                )
        object.__setattr__(self, "world_from_cam", check_pose(self.world_from_cam))

    @classmethod
    def from_fov(cls, width: int, height: int, fov: float, world_from_cam: ArrayLike | None = None) -> Camera:
        """Camera with square pixels, centred, from its horizontal field of view in degrees (0 < fov < 180).

        Examples:
            >>> import dlama
            >>> camera = dlama.Camera.from_fov(640, 480, fov=90)
            >>> round(camera.fx, 6), camera.cx, camera.cy
            (320.0, 320.0, 240.0)
        """
        if not is_finite(fov) or not 0 < fov < 180:
            raise CameraError(f"`fov` is {format_value(fov)} degrees; a field of view between 0 and 180 is expected")
        _check_size(width, height)
        focal = 0.5 * width / math.tan(math.radians(fov) / 2)
        if not SMALLEST_FOCAL_PX <= focal <= LARGEST_PX:
            size = "wide" if focal < 1 else "narrow"
            raise CameraError(f"`fov` is {format_value(fov)} degrees; no lens is as {size} as that")
        pose = np.eye(4) if world_from_cam is None else check_pose(world_from_cam)
        return cls(width, height, focal, focal, width / 2, height / 2, pose)

    @classmethod
    def from_K(
        cls,
        K: ArrayLike,
        width: int,
        height: int,
        pixel_center: float = 0.5,
        world_from_cam: ArrayLike | None = None,
    ) -> Camera:
        """Camera from its intrinsic matrix and the size of its picture.

        Args:
            K: 3x3 in pixels, fx 0 cx / 0 fy cy / 0 0 1.
            width: of the picture, pixels.
            height: of the picture, pixels.
            pixel_center: where K puts the centre of the first pixel: 0.5 (COLMAP, EasySynth) or 0.0 (OpenCV, TUM, Open3D,
                Middlebury: cx = 319.5 for 640 pixels).
            world_from_cam: 4x4, camera to world, metres; the identity by default.
        Raises:
            CameraError: K is of another form, pixel_center another number, or the camera is none (see the class).
        """
        check_pixel_center(pixel_center)
        fx, fy, cx, cy = intrinsics_of(K)
        border = 0.5 - pixel_center
        pose = np.eye(4) if world_from_cam is None else check_pose(world_from_cam)
        return cls(width, height, fx, fy, cx + border, cy + border, pose)

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
        return invert_pose(self.world_from_cam)

    @property
    def fov(self) -> float:
        """Horizontal field of view in degrees."""
        return math.degrees(math.atan(self.cx / self.fx) + math.atan((self.width - self.cx) / self.fx))

    def __repr__(self) -> str:
        centre = ", ".join(f"{metres:.3g}" for metres in self.world_from_cam[:3, 3] + 0.0)
        return f"Camera({self.width}x{self.height}, {self.fov:.3g} degrees wide, at ({centre}) m)"

    def at(self, world_from_cam: ArrayLike) -> Camera:
        """The same camera at another pose."""
        return dataclasses.replace(self, world_from_cam=check_pose(world_from_cam))

    def cropped(self, x: int, y: int, width: int, height: int) -> Camera:
        """The camera of a part of the picture: `width` x `height` pixels, the upper left one being column x, row y.

        The part may reach beyond the picture. Raises CameraError when the part is empty.
        """
        for name, value in (("x", x), ("y", y)):
            if not is_finite(value):
                raise CameraError(f"`{name}` is {format_value(value)}; a number of pixels is expected")
        return dataclasses.replace(self, width=width, height=height, cx=self.cx - x, cy=self.cy - y)

    def cropped_to(self, rows: slice, columns: slice) -> Camera:
        """The camera of these rows and columns of the picture (both ends given)."""
        return self.cropped(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)

    def resized(self, width: int, height: int) -> Camera:
        """The camera of the same picture at another size in pixels; what it sees stays the same, up to its borders.

        Raises CameraError when the size is not positive.
        """
        _check_size(width, height)
        across, down = width / self.width, height / self.height
        focal, centre = (self.fx * across, self.fy * down), (self.cx * across, self.cy * down)
        return Camera(width, height, *focal, *centre, self.world_from_cam)

    def with_larger_pixels(self, step: float, whole: Callable[[float], int] = round) -> Camera:
        """The camera with pixels exactly `step` times as large, a whole number of them, so its border may differ."""
        width, height = (max(1, whole(size / step)) for size in self.wh)
        smaller = {name: getattr(self, name) / step for name in ("fx", "fy", "cx", "cy")}
        return dataclasses.replace(self, width=width, height=height, **smaller)

    def same_lens_as(self, other: Camera) -> bool:
        """True if size and intrinsics are equal (within 1e-9 px)."""
        mine = (self.fx, self.fy, self.cx, self.cy)
        theirs = (other.fx, other.fy, other.cx, other.cy)
        return self.hw == other.hw and all(abs(a - b) <= 1e-9 for a, b in zip(mine, theirs))

    def same_view_as(self, other: Camera) -> bool:
        """True if a picture of one is a picture of the other: same lens, same pose (within 1e-9)."""
        return self.same_lens_as(other) and float(np.abs(self.world_from_cam - other.world_from_cam).max()) <= 1e-9


def check_pixel_center(value: object) -> None:
    """Raise CameraError unless it is 0.5 or 0.0, the two places where files put the first pixel's centre."""
    if not isinstance(value, Real) or value not in (0.0, 0.5):
        raise CameraError(f"`pixel_center` is {format_value(value)}; 0.5 or 0.0 is expected")


@dataclass(frozen=True, eq=False)
class StereoRig:
    """A rectified pair: same size, focal length, rows and orientation; the right camera sits on the left one's x axis.

    Raises CameraError when the two are no such pair.
    """

    left: Camera
    """The left camera, at any pose."""
    right: Camera
    """The right camera; only its position and its cx differ from the left one's."""

    def __post_init__(self) -> None:
        left, right = self.left, self.right
        check(left, Camera, "left")
        check(right, Camera, "right")
        check_same_size("the left camera", left.hw, "the right", right.hw, CameraError)
        for name in ("fx", "fy", "cy"):
            mine, theirs = getattr(left, name), getattr(right, name)
            if abs(mine - theirs) > 0.01:
                raise CameraError(f"{name} is {mine} left and {theirs} right; a rectified pair has one {name}")
        across = self._offset
        if not across[0] > 0 or abs(across[1]) > 1e-3 * across[0] or abs(across[2]) > 1e-3 * across[0]:
            raise CameraError(
                f"the right camera lies at {across.round(6).tolist()} m of the left; (baseline > 0, 0, 0) is expected"
            )

    @property
    def _offset(self) -> Float64Array:
        return (self.left.cam_from_world @ self.right.world_from_cam)[:3, 3]

    @property
    def baseline_m(self) -> float:
        """Metres from the left to the right camera."""
        return float(self._offset[0])

    @property
    def doffs(self) -> float:
        """cx of the right minus cx of the left camera, px: Z = fx baseline / (disparity + doffs) (Middlebury 2014)."""
        return self.right.cx - self.left.cx

    def __repr__(self) -> str:
        left = self.left
        return f"StereoRig({left.width}x{left.height}, {left.fov:.3g} degrees wide, baseline {self.baseline_m:.3g} m)"


def intrinsics_of(K: ArrayLike, called: str = "K") -> tuple[float, float, float, float]:
    """fx, fy, cx, cy in pixels of an intrinsic matrix fx 0 cx / 0 fy cy / 0 0 1.

    Raises CameraError for a matrix of any other form; the message begins with `called`.
    """
    matrix = as_matrix(K, called, (3, 3))
    (fx, skew, cx), (zero, fy, cy), last = matrix.tolist()
    if not np.abs([skew, zero, last[0], last[1], last[2] - 1]).max() <= 1e-6:
        rows = "rows (focal 0 centre), (0 focal centre), (0 0 1) are expected (no skew)"
        raise CameraError(f"{called} is {matrix.tolist()}; {rows}")
    return fx, fy, cx, cy
