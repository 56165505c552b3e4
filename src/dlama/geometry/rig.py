"""StereoRig: two rectified cameras side by side."""

from __future__ import annotations

from dataclasses import dataclass

from dlama.errors import CameraError
from dlama.geometry.camera import Camera, Float64Array


@dataclass(frozen=True, eq=False)
class StereoRig:
    """A rectified pair: same size, focal length, rows and orientation; the right camera sits on the left one's x axis.

    Raises CameraError when the two are no such pair.
    """

    left: Camera
    right: Camera

    def __post_init__(self) -> None:
        left, right = self.left, self.right
        if left.hw != right.hw:
            raise CameraError(
                f"the left camera is {left.width}x{left.height}, the right {right.width}x{right.height}; one size is wanted"
            )
        for name in ("fx", "fy", "cy"):
            mine, theirs = getattr(left, name), getattr(right, name)
            if abs(mine - theirs) > 0.01:
                raise CameraError(f"{name} is {mine} left and {theirs} right; a rectified pair has one {name}")
        across = self._offset
        if not across[0] > 0 or abs(across[1]) > 1e-3 * across[0] or abs(across[2]) > 1e-3 * across[0]:
            raise CameraError(
                f"the right camera lies at {across.round(6).tolist()} m of the left; (baseline > 0, 0, 0) is wanted"
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
