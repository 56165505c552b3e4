"""Trajectories: a camera and a move (orbit, dolly) in, the moved camera out (paper, eq. 1). Same lens, new pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dlama.arguments import check_arguments, is_finite
from dlama.errors import DepthError, InputError
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.motion.poses import FARTHEST_M, make_pose, slerp
from dlama.geometry.rgbd import RGBD, is_valid
from dlama.geometry.view import View

PIVOT_M = 2.5
"""Metres ahead on the optical axis, of the point that a camera orbits about where no depth is known (the paper's centroid,
sec. 4)."""


def orbit(
    camera: Camera | RGBD | View, yaw: float, pitch: float = 0.0, pivot: float | Literal["auto"] = "auto"
) -> Camera:
    """The camera, or that of a picture, turned by degrees about the point `pivot` metres ahead on its optical axis, at which it
    keeps looking. auto: at the picture's median depth, as the verbs have it; a camera alone has none: 2.5 m.

    Positive yaw: the camera moves to its right around the pivot and turns left. Positive pitch: it moves up and looks
    down. The yaw goes first, about the source camera's y axis; then the pitch, about the x axis of the camera that the
    yaw has turned (both axes shifted into the pivot). Seen from a fixed camera the scene turns the other way:
    p' = C + R_x(pitch) R_y(yaw) (p - C) with C = (0, 0, pivot).
    With pivot = 0 the camera turns in place.
    Raises InputError on angles of more than 360 degrees or pivot < 0.

    Examples:
        >>> import dlama
        >>> camera = dlama.Camera.from_fov(640, 480, fov=60)
        >>> dlama.orbit(camera, yaw=90, pivot=2.0).world_from_cam[:3, 3].round(6).tolist()  # to the right of the pivot
        [2.0, 0.0, 2.0]
    """
    check_arguments(orbit, locals())
    for name, value in (("yaw", yaw), ("pitch", pitch)):
        if not is_finite(value) or not abs(value) <= 360:  # 700 would mean -20
            raise InputError(f"`{name}` is {value!r}; an angle of -360 to 360 degrees is expected")
    source = camera if isinstance(camera, Camera) else camera.camera
    metres = auto_pivot(camera) if pivot == "auto" else pivot
    if not is_finite(metres) or not 0 <= metres <= FARTHEST_M:
        raise InputError(f"`pivot` is {pivot!r}; a distance >= 0 in metres, ahead of the camera, is expected")
    center = np.array([0.0, 0.0, metres])
    turned_from_source = _rotation(yaw, pitch)
    source_from_turned = make_pose(turned_from_source.T, center - turned_from_source.T @ center)
    return source.at(source.world_from_cam @ source_from_turned)


def auto_pivot(picture: Camera | RGBD | View) -> float:
    """Metres to the median depth of a picture; PIVOT_M of one that shows nothing near, as sky looks the same about all, and of a
    camera alone."""
    if isinstance(picture, Camera) or not is_valid(picture.depth).any():
        return PIVOT_M
    return median_pivot(picture.depth)


def dolly(camera: Camera, metres: float) -> Camera:
    """The camera moved along its optical axis: positive forward, negative back (the paper's zoom-out).

    Raises InputError when `metres` is not finite.
    """
    if not is_finite(metres) or not abs(metres) <= FARTHEST_M:
        raise InputError(f"`dolly` is {metres!r}; a finite distance in metres, at most {FARTHEST_M:g}, is expected")
    pose = camera.world_from_cam.copy()
    pose[:3, 3] += metres * pose[:3, 2]
    return camera.at(pose)


def move_sideways(camera: Camera, metres: float) -> Camera:
    """The camera moved to its right (negative: left)."""
    pose = camera.world_from_cam.copy()
    pose[:3, 3] += metres * pose[:3, 0]
    return camera.at(pose)


def orbit_path(camera: Camera, count: int, pivot: float = PIVOT_M, degrees: float = 15.0) -> list[Camera]:
    """A swing to the right, to the left and back, `degrees` to either side; it ends where it begins and can be repeated."""
    return [orbit(camera, degrees * math.sin(turn), 0.0, pivot) for turn in _turns(count)]


def spiral_path(camera: Camera, count: int, pivot: float = PIVOT_M, degrees: float = 8.0) -> list[Camera]:
    """A circle round the camera, `degrees` in yaw and half of that in pitch, and a little forward and back meanwhile."""
    return [
        dolly(
            orbit(camera, degrees * math.sin(turn), degrees / 2 * (1 - math.cos(turn)) / 2, pivot),
            0.1 * pivot * math.sin(2 * turn) / 2,
        )
        for turn in _turns(count)
    ]


def dolly_path(camera: Camera, count: int, pivot: float = PIVOT_M, share: float = 0.25) -> list[Camera]:
    """Forward by a share of the way to the pivot, and back."""
    return [dolly(camera, share * pivot * (1 - math.cos(turn)) / 2) for turn in _turns(count)]


PATHS = {"orbit": orbit_path, "spiral": spiral_path, "dolly": dolly_path}
"""Camera paths by name: (camera, count, pivot) -> cameras, the first of which is that camera."""


def interpolate_cameras(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """`count` cameras evenly on the way from the first to the last, through all of them: positions on straight lines, rotations
    along the shortest turn; the lens is the first one's."""
    places = np.linspace(0, len(cameras) - 1, count) if count > 1 else np.zeros(1)
    found = []
    for place in places:
        left = min(int(place), max(0, len(cameras) - 2))
        one, other = cameras[left].world_from_cam, cameras[min(left + 1, len(cameras) - 1)].world_from_cam
        share = float(place) - left
        turn = slerp(one[:3, :3], other[:3, :3], share)
        found.append(cameras[0].at(make_pose(turn, (1 - share) * one[:3, 3] + share * other[:3, 3])))
    return found


def _turns(count: int) -> list[float]:
    return [2 * math.pi * number / count for number in range(count)]


def median_pivot(depth: ArrayLike) -> float:
    """The median in metres of the valid depths (finite, > 0) of an H x W map: the pivot that the verbs call "auto".

    Raises DepthError when no depth is valid.
    """
    metres = np.asarray(depth)
    valid = metres[np.isfinite(metres) & (metres > 0)]
    if not len(valid):
        raise DepthError("depth has no valid value (finite, > 0), so a median pivot cannot be taken; give it in metres")
    return float(np.median(valid))


def _rotation(yaw: float, pitch: float) -> Float64Array:
    """3x3: about y, then about x; a whole turn is none, to the last bit."""
    turns = (math.radians(math.remainder(degrees, 360)) for degrees in (yaw, pitch))
    (c, s), (d, t) = ((math.cos(radians), math.sin(radians)) for radians in turns)
    return np.array([[1, 0, 0], [0, d, -t], [0, t, d]]) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
