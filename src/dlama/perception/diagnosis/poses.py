"""Posed frames of one scene in; the convention of their poses, and changes of exposure, out, by reprojection.

Points of one frame, reprojected to the next, must agree with its depth and colours. That is tested for the poses as read and
for each usual mistake undone. Frames are made small first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.errors import CameraError
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.motion.poses import (
    invert_pose,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
    transform_points,
)
from dlama.geometry.projection import project_to_pixels, rays
from dlama.geometry.rgbd import RGBD, Float32Array, is_valid
from dlama.perception.diagnosis.finding import Finding, certainty

LANDS_WITHIN = 0.04
"""Largest relative difference of depth of a point that lands."""
FEWEST = 25
"""Least number of landed points."""
LEAST_FIT = 0.12
"""Least agreement (1: every point lands, colours agree fully) of two frames with a fault mended,"""
LEAST_LEAD = 1.3
"""and least gain over the frames as read. Of an odd frame without a fault at most 1.05 (89 real frames, 52 of streets, 60 of
worlds); with one 1.48."""
GL = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL's camera axes (y up, z back) in OpenCV's."""
LEFT_HANDED = np.diag([1.0, -1.0, 1.0, 1.0])
"""Axes with y up and z forward."""
BODY = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""x forward, y left, z up (ROS) to OpenCV's axes."""


class SmallFrame(NamedTuple):
    """A frame made small, and some of its points."""

    points: Float64Array
    """N x 3 m, camera axes."""
    brightness: Float64Array
    """N grey levels of the points."""
    depth: Float32Array
    """h x w m."""
    grey: Float32Array
    """h x w grey levels."""
    camera: Camera
    """Of the small pictures."""


class Landed(NamedTuple):
    """Points of one frame that reproject to another at its measured depth."""

    share: float
    """Of all points."""
    first: Float64Array
    """Their grey levels,"""
    second: Float64Array
    """and those measured where they land."""

    @property
    def gain(self) -> float:
        """Brightness of the second over the first."""
        return brightness_ratio(self.first, self.second)

    @property
    def fit(self) -> float:
        """The share, times the correlation of the grey levels (0 where negative)."""
        if len(self.first) < FEWEST or min(self.first.std(), self.second.std()) == 0:
            return 0.0
        return self.share * max(float(np.corrcoef(self.first, self.second)[0, 1]), 0.0)


def brightness_ratio(first: NDArray[Any], second: NDArray[Any]) -> float:
    """How many times as bright the second grey levels are."""
    return float((np.median(second) + 1) / (np.median(first) + 1))


def shrink(frame: RGBD) -> SmallFrame:
    """Every n-th depth, and the mean grey around it, in about 240 pixels across; at most 2000 points."""
    hw = frame.depth.shape
    step = max(1, min(round(max(hw) / 240), *hw))
    h, w = (n // step for n in hw)
    depth = np.array(frame.depth[step // 2 :: step, step // 2 :: step][:h, :w])
    grey = cv2.cvtColor(np.ascontiguousarray(frame.color[: h * step, : w * step]), cv2.COLOR_RGB2GRAY)
    means = np.asarray(cv2.resize(grey.astype(np.float32), (w, h), interpolation=cv2.INTER_AREA), np.float32)
    camera = frame.camera.cropped(0, 0, w * step, h * step).resized(w, h)
    known = np.flatnonzero(is_valid(depth))
    chosen = known[np.linspace(0, len(known) - 1, min(len(known), 2000)).astype(np.intp)]
    points = rays(camera).reshape(-1, 3)[chosen] * depth.ravel()[chosen, None]
    return SmallFrame(points, means.ravel()[chosen].astype(np.float64), depth, means, camera)


def find_landing_points(one: SmallFrame, other: SmallFrame) -> Landed:
    """Points of one frame that land in the other."""
    z, depth, first, second = reproject(one, other)
    lands = np.abs(depth - z) < LANDS_WITHIN * z
    return Landed(float(lands.sum() / max(len(one.points), 1)), first[lands], second[lands])


def reproject(one: SmallFrame, other: SmallFrame) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """Depth and grey level of one frame's points that reproject to a pixel of the other with depth: (own, measured there) of
    each."""
    points = transform_points(one.camera.world_from_cam, one.points)
    rows, columns, z, inside = project_to_pixels(points, other.camera)
    depth, grey = (plane[rows, columns].astype(np.float64) for plane in (other.depth, other.grey))
    known = inside & is_valid(depth)
    return z[known], depth[known], one.brightness[known], grey[known]


Undo = Callable[[Float64Array], Float64Array]
Pair = tuple[SmallFrame, SmallFrame]
"""A frame, and the next in a row."""


class Convention(NamedTuple):
    """A convention that the poses of a file may have."""

    check: str
    what: str
    mend: str
    undo: Undo
    """Maps the pose as read to the right one."""


def reorder_quaternion(pose: Float64Array, order: tuple[int, int, int, int]) -> Float64Array:
    """The pose with the numbers of its quaternion reordered (indices into x y z w as read)."""
    read = quaternion_from_rotation(pose[:3, :3])
    return make_pose(rotation_from_quaternion([read[place] for place in order]), pose[:3, 3])


def _inverse_after(before: Float64Array, after: Float64Array) -> Undo:
    return lambda pose: invert_pose(pose @ before) @ after


SAME = np.eye(4)
INVERSE = "go from world to camera, not from camera to world"
CONVENTIONS: list[Convention] = [
    Convention("pose-axes", "have other camera axes (y and z the other way round)",
               "multiply each from the right by diag(1, -1, -1, 1)", lambda p: p @ GL),
    Convention("pose-axes", "have other camera axes (x forward, y left, z up, as robots have them)",
               "turn the axes to x right, y down, z forward", lambda p: p @ invert_pose(BODY)),
    Convention("pose-direction", f"{INVERSE}, and have other camera axes",
               "invert them, then multiply each from the right by diag(1, -1, -1, 1)", _inverse_after(SAME, GL)),
    *(Convention("pose-direction", INVERSE, "invert them", _inverse_after(*turns))
      for turns in ((SAME, SAME), (GL, SAME), (GL, GL))),
    *(Convention("pose-handedness", "are left-handed (y up)", "multiply each from both sides by diag(1, -1, 1, 1)", undo)
      for undo in (lambda p: LEFT_HANDED @ p @ LEFT_HANDED, lambda p: LEFT_HANDED @ p @ GL @ LEFT_HANDED)),
    Convention("pose-rotation", "have their rotations transposed", "transpose the 3x3 part",
               lambda p: make_pose(p[:3, :3].T, p[:3, 3])),
    Convention("quaternion-order", "have quaternions in the order w x y z", "write them as x y z w",
               lambda p: reorder_quaternion(p, (1, 2, 3, 0))),
    Convention("quaternion-order", "have quaternions in the order x y z w", "write them as w x y z",
               lambda p: reorder_quaternion(p, (3, 0, 1, 2))),
    *(Convention("pose-scale", f"move {max(factor, 1 / factor):g} times too {'little' if factor > 1 else 'far'} for the depth",
                 f"multiply translations by {factor:g}, or divide depth by it",
                 lambda p, factor=factor: make_pose(p[:3, :3], p[:3, 3] * factor))  # type: ignore[misc]
      for factor in (0.001, 0.01, 0.1, 0.2, 5.0, 10.0, 100.0, 1000.0)),
]  # fmt: skip
"""The usual mistakes."""


def check_poses(pairs: Sequence[Pair], name: str) -> list[Finding]:
    """Findings on frames and the next in a row (each overlapping the next), called `name` in messages."""
    if not pairs:
        return []
    as_read = [find_landing_points(*pair) for pair in pairs]
    fit = float(np.mean([each.fit for each in as_read]))
    if mistaken := check_convention(pairs, fit, name):
        return [mistaken]
    found = check_exposure([each for each in as_read if each.fit > LEAST_FIT], name)
    if fit >= LEAST_FIT:
        return found
    what = f"{name}: frames in a row hardly fit each other ({fit:.0%} of the points); no usual convention mends it"
    return [Finding("poses", "note", 0.6, what, "check that poses, depth and camera belong to these frames"), *found]


def check_convention(pairs: Sequence[Pair], fit: float, name: str) -> Finding | None:
    """Reports the usual mistake without which the poses of frames, called `name`, fit far better than as read (`fit`)."""
    fits = [mean_fit(pairs, way.undo) for way in CONVENTIONS]
    best, way = max(fits), CONVENTIONS[int(np.argmax(fits))]
    lead = best / max(fit, 1e-3)
    if lead <= LEAST_LEAD or best <= LEAST_FIT or (way.check == "pose-scale" and is_chance(pairs, best)):
        return None
    what = f"{name}: poses {way.what}; so {best:.0%} of a frame's points fit the next one, {fit:.0%} as read"
    return Finding(way.check, "fault", certainty(lead - 1, 0.5), what, way.mend)


def is_chance(pairs: Sequence[Pair], fit: float) -> bool:
    """Whether two frames fit as well from one place: a scale that moves them together shows no more than that they look alike."""
    return len(pairs) == 1 and fit < LEAST_LEAD * mean_fit(pairs, lambda pose: make_pose(pose[:3, :3], (0, 0, 0)))


def check_exposure(landed: Sequence[Landed], name: str) -> list[Finding]:
    """Reports frames in a row, called `name`, that are not equally bright where they show the same points."""
    most = max((max(each.gain, 1 / each.gain) for each in landed), default=1.0)
    if most <= 1.25:
        return []
    what = f"{name}: exposure changes from frame to frame, up to {most:.2f} times as bright"
    return [Finding("exposure", "note", 0.85, what, "undo the gain before colours of frames are compared or mixed")]


def mean_fit(pairs: Sequence[Pair], undo: Undo) -> float:
    """Mean agreement of pairs, each pose changed by `undo`."""
    try:
        moved = [
            [frame._replace(camera=frame.camera.at(undo(np.array(frame.camera.world_from_cam)))) for frame in pair]
            for pair in pairs
        ]
    except CameraError:  # far from the world's origin already, and scaled: no camera stands there
        return 0.0
    return float(np.mean([find_landing_points(*pair).fit for pair in moved]))
