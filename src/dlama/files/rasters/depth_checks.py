"""Depth as read in; one-line warnings where it looks like something else than metric depth out."""

from __future__ import annotations

import warnings

import numpy as np

from dlama.files.atomic_write import PathLike
from dlama.geometry.rgbd import Float32Array
from dlama.perception.diagnosis.depth_scale import find_far_plane

FEWEST_VOTES = 500
"""Small pictures, which one curved object can fill, are not judged by fewer."""
STEP = 8
"""Pixels between the three samples of which two differences are taken."""
SLOPE, EDGE = 0.1, 0.6
"""Relative difference of the outer two samples: at least this for a slanted surface, at most that within one surface."""
FEWEST, SHARE = 0.005, 0.8
"""Votes per pixel of the picture below which nothing is reported, and the share of them that must agree: of 200 depth maps of a
Kinect and of a renderer none is taken for inverse depth, and 152 of them are found when they are."""
CLOSE_RANGE = 50.0, 5.0
"""Least median depth in metres, and largest ratio of far to near, of what may be a close-range scanner's millimetres."""
CLEARER = 0.5
"""How much straighter one reading must be than the other to be a vote."""


def warn_of_inverse(path: PathLike, depth: Float32Array) -> None:
    """Warn (UserWarning) where the values (H x W, 0 = missing, inf = far) are inverse depth rather than depth.

    Of a plane inverse depth is linear in the picture and depth is not (it bends, the more the steeper): where the values
    themselves run straight over most slanted surfaces, they are inverse.
    """
    straight, votes = straighter_share(depth)
    if votes >= max(FEWEST_VOTES, FEWEST * depth.size) and straight >= SHARE:
        warnings.warn(
            f"{path}: looks like inverse depth or disparity ({100 * straight:.0f} % of {votes} slanted places run straight, "
            "where depth bends): metric depth is expected, such as depth = scale / value",
            UserWarning,
            stacklevel=4,
        )


def warn_of_millimetres(path: PathLike, depth: Float32Array, median: float) -> None:
    """Warn (UserWarning) of floats read as metres that begin far away and end not much farther, as a close-range scanner's
    millimetres do."""
    if median < CLOSE_RANGE[0] or np.isposinf(depth).any():
        return
    near, far = np.percentile(depth[depth > 0], (2, 98))
    if far < CLOSE_RANGE[1] * near:
        warnings.warn(
            f"{path}: nearly all of the depth is {near:.3g} to {far:.3g} m: if these are millimetres, give `depth_scale=1000`, "
            "if centimetres `depth_scale=100`; `depth_scale=1` says that they are metres",
            UserWarning,
            stacklevel=4,
        )


def warn_of_far_plane(path: PathLike, depth: Float32Array) -> None:
    """Warn (UserWarning) where a renderer wrote sky at its camera's far plane (depth: H x W metres): it would be a wall."""
    found = find_far_plane(depth)
    if found is not None:
        warnings.warn(
            f"{path}: {found[1]:.1%} of the depth is exactly {found[0]:.9g} m, far behind all else; if that is sky, give "
            f"`far={found[0]:.9g}`",
            UserWarning,
            stacklevel=4,
        )


def straighter_share(depth: Float32Array) -> tuple[float, int]:
    """Share of the slanted places where the values run straighter than their inverses; and how many places voted."""
    inside = np.where((depth > 0) & (depth < np.inf), depth, np.nan).astype(np.float64)
    found = []
    for across in (inside[:: STEP // 2], inside[:, :: STEP // 2].T):
        before, here, after = across[:, : -2 * STEP], across[:, STEP:-STEP], across[:, 2 * STEP :]
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.abs(after - before) / here
            slanted = (slope > SLOPE) & (slope < EDGE)
            bend = np.abs(before + after - 2 * here)[slanted] / here[slanted]
            inverse_bend = np.abs(1 / before + 1 / after - 2 / here)[slanted] * here[slanted]
        found.append(np.stack([bend, inverse_bend]))
    bend, inverse_bend = np.concatenate(found, axis=1)
    straight, bent = int((bend < CLEARER * inverse_bend).sum()), int((inverse_bend < CLEARER * bend).sum())
    return straight / max(1, straight + bent), straight + bent
