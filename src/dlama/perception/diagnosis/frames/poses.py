"""Frames of one scene with poses in; the convention of their poses, and changes of exposure, out, by reprojection.

Points of one frame, reprojected to the next, must agree with its depth and colours. That is tested for the poses as read and
for each usual mistake undone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dlama.errors import CameraError
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose, make_pose, quaternion_from_rotation, rotation_from_quaternion
from dlama.perception.diagnosis.finding import Finding, certainty
from dlama.perception.diagnosis.frames.landing import LEAST_FIT, LEAST_LEAD, Landed, SmallFrame, find_landing_points

GL = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL's camera axes (y up, z back) in OpenCV's."""
LEFT_HANDED = np.diag([1.0, -1.0, 1.0, 1.0])
"""Axes with y up and z forward."""
BODY = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""x forward, y left, z up (ROS) to OpenCV's axes."""
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


def _scale_translation(factor: float) -> Undo:
    return lambda pose: make_pose(pose[:3, :3], pose[:3, 3] * factor)


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
                 f"multiply translations by {factor:g}, or divide depth by it", _scale_translation(factor))
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
