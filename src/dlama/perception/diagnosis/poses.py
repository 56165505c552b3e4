"""Frames of one scene with poses in; the convention of their poses out, by reprojection from frame to frame.

Points of one frame, reprojected to the next, must agree with its depth and colours. That is tested for the poses as read and
for each usual mistake undone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dlama.errors import CameraError
from dlama.geometry.camera import Float64Array
from dlama.geometry.poses import invert_pose, quaternion_from_rotation, rotation_from_quaternion
from dlama.geometry.rgbd import RGBD
from dlama.perception.diagnosis.finding import Finding, certainty
from dlama.perception.diagnosis.landing import Landed, SmallFrame, find_landing_points, shrink

LEAST_LEAD = 1.3
"""Least gain of another convention,"""
LEAST_FIT = 0.12
"""and its least agreement (1: every point lands, colours agree fully)."""
EXPOSURE = 1.25
"""Least ratio of brightness between frames that is reported as exposure."""
GL = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL's camera axes (y up, z back) in OpenCV's."""
LEFT_HANDED = np.diag([1.0, -1.0, 1.0, 1.0])
"""Axes with y up and z forward."""
BODY = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""x forward, y left, z up (ROS) to OpenCV's axes."""
Undo = Callable[[Float64Array], Float64Array]


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
    out = pose.copy()
    out[:3, :3] = rotation_from_quaternion([read[place] for place in order])
    return out


def _transpose(pose: Float64Array) -> Float64Array:
    out = pose.copy()
    out[:3, :3] = pose[:3, :3].T
    return out


def _scale_translation(factor: float) -> Undo:
    def undo(pose: Float64Array) -> Float64Array:
        out = pose.copy()
        out[:3, 3] *= factor
        return out

    return undo


AXES = "have other camera axes"
INVERSE = "go from world to camera, not from camera to world"
FLIP = "multiply each from the right by diag(1, -1, -1, 1)"
MIRROR = "multiply each from both sides by diag(1, -1, 1, 1)"
BODY_AXES = f"{AXES} (x forward, y left, z up, as robots have them)"
CONVENTIONS: dict[str, Convention] = {
    "opengl": Convention("pose-axes", f"{AXES} (y and z the other way round)", FLIP, lambda p: p @ GL),
    "inverse": Convention("pose-direction", INVERSE, "invert them", invert_pose),
    "inverse opengl": Convention(
        "pose-direction", f"{INVERSE}, and {AXES}", f"invert them, then {FLIP}", lambda p: invert_pose(p) @ GL
    ),
    "opengl inverse": Convention("pose-direction", INVERSE, "invert them", lambda p: invert_pose(p @ GL)),
    "opengl inverse opengl": Convention("pose-direction", INVERSE, "invert them", lambda p: invert_pose(p @ GL) @ GL),
    "left-handed": Convention(
        "pose-handedness", "are left-handed (y up)", MIRROR, lambda p: LEFT_HANDED @ p @ LEFT_HANDED
    ),
    "left-handed opengl": Convention(
        "pose-handedness", "are left-handed (y up)", MIRROR, lambda p: LEFT_HANDED @ p @ GL @ LEFT_HANDED
    ),
    "body": Convention("pose-axes", BODY_AXES, "turn the axes to x right, y down, z forward", lambda p: p @ invert_pose(BODY)),
    "transposed": Convention("pose-rotation", "have their rotations transposed", "transpose the 3x3 part", _transpose),
    "wxyz": Convention(
        "quaternion-order", "have quaternions in the order w x y z", "write them as x y z w",
        lambda p: reorder_quaternion(p, (1, 2, 3, 0)),
    ),
    "xyzw": Convention(
        "quaternion-order", "have quaternions in the order x y z w", "write them as w x y z",
        lambda p: reorder_quaternion(p, (3, 0, 1, 2)),
    ),
    **{f"scale {factor:g}": Convention(
        "pose-scale", f"move {max(factor, 1 / factor):g} times too {'little' if factor > 1 else 'far'} for the depth",
        f"multiply translations by {factor:g}, or divide depth by it", _scale_translation(factor))
       for factor in (0.001, 0.01, 0.1, 0.2, 5.0, 10.0, 100.0, 1000.0)},
}  # fmt: skip
"""The usual mistakes."""


def check_poses(frames: Sequence[RGBD], name: str) -> list[Finding]:
    """Findings on frames in a row (each overlapping the next), called `name` in messages."""
    small = [shrink(frame) for frame in frames]
    if len(small) < 2:
        return []
    as_read = [find_landing_points(*pair) for pair in pairwise(small)]
    fit = float(np.mean([each.fit for each in as_read]))
    fits = {key: mean_fit(small, way.undo) for key, way in CONVENTIONS.items()}
    best = max(fits, key=lambda key: fits[key])
    lead = fits[best] / max(fit, 1e-3)
    if lead > LEAST_LEAD and fits[best] > LEAST_FIT:
        way = CONVENTIONS[best]
        shares = f"{_format_share(fits[best])} of a frame's points fit the next one, {_format_share(fit)} as read"
        what = f"{name}: poses {way.what}; so {shares}"
        return [Finding(way.check, "fault", certainty(lead - 1, 0.5), what, way.mend)]
    found = []
    if fit < LEAST_FIT:
        what = f"{name}: frames in a row hardly fit each other ({_format_share(fit)} of the points); no usual convention mends it"
        found.append(Finding("poses", "note", 0.6, what, "check that poses, depth and camera belong to these frames"))
    gains = [gain(each) for each in as_read if each.fit > LEAST_FIT]
    most = max((max(each, 1 / each) for each in gains), default=1.0)
    if most > EXPOSURE:
        what = f"{name}: exposure changes from frame to frame, up to {most:.2f} times as bright"
        found.append(
            Finding("exposure", "note", 0.85, what, "undo the gain before colours of frames are compared or mixed")
        )
    return found


def gain(landed: Landed) -> float:
    """Brightness of the other frame over this one's, at landed points."""
    return float((np.median(landed.second) + 1) / (np.median(landed.first) + 1))


def mean_fit(frames: Sequence[SmallFrame], undo: Undo) -> float:
    """Mean agreement of successive frames, each pose changed by `undo`."""
    try:
        moved = [
            frame._replace(camera=frame.camera.at(undo(np.array(frame.camera.world_from_cam)))) for frame in frames
        ]
    except CameraError:  # far from the world's origin already, and scaled: no camera stands there
        return 0.0
    return float(np.mean([find_landing_points(*pair).fit for pair in pairwise(moved)]))


def _format_share(share: float) -> str:
    return f"{100 * share:.0f} %"
