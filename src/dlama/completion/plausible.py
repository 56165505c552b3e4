"""What a job was given, and what came of it, in; one-line warnings (UserWarning) of the likeliest mistakes out."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.projection import px_from_px
from dlama.geometry.rgbd import PLAUSIBLE_M, RGBD, BoolArray, Float32Array, is_valid
from dlama.geometry.view import View
from dlama.perception.diagnosis.masks import looks_inverted

MOST_UNKNOWN = 0.5
"""Share of a view: where more is unknown, depth and the camera's move do not fit together."""
BEYOND_TURN = 0.1
"""Share of a view that may be unknown beyond what the camera's turn alone shows anew (measured: right depth stays 0.05 below)."""
EVERY = 4
"""Rows and columns between the pixels of which a median is taken."""


def warn_of_scale(depth: Float32Array) -> None:
    """Depth (H x W) that can hardly be metres, or that is missing everywhere."""
    median = median_depth(depth)
    if not (depth > 0).any():
        _warn(
            "no pixel has a depth (0 and NaN are missing): nothing is known from elsewhere, and filled depth is a guess"
        )
    elif median > PLAUSIBLE_M[1]:
        _warn(
            f"the median depth is {median:.4g} m: metres are expected; divide millimetres by 1000 (`depth_scale=1000` of a file)"
        )
    elif 0 < median < PLAUSIBLE_M[0]:
        _warn(
            f"the median depth is {median:.4g} m: metres are expected; check the clip, the known depth of an estimate, or the "
            "baseline of a stereo pair"
        )


def warn_of_disparity(rgbd: RGBD) -> None:
    """A pair of which all is as far as the sky."""
    if rgbd.far.any() and not rgbd.valid.any():
        _warn(
            "all of the pair is far: its disparities are next to nothing; check their unit (`disparity_scale` of a file), the "
            "order of the pictures and the calibration"
        )


def warn_of_mask(mask: BoolArray | Mapping[int, BoolArray]) -> None:
    """A mask, or one of several frames, that removes most of the picture."""
    for one in map(np.asarray, mask.values() if isinstance(mask, Mapping) else (mask,)):
        if looks_inverted(one):
            _warn(
                f"the mask removes {100 * float(one.mean()):.0f} % of the picture: if it marks what stays, it is inverted "
                "(`mask_polarity` turns it round)"
            )


def warn_of_unknown(rgbd: RGBD | View, warped: Sequence[View]) -> None:
    """A view of which hardly anything is known, although the camera has hardly turned away from what the picture shows."""
    shares = [float(view.color_hole.mean()) for view in warped]
    odd = [
        share
        for share, view in zip(shares, warped)
        if MOST_UNKNOWN < share < 1 and share > share_out_of_view(rgbd.camera, view.camera) + BEYOND_TURN
    ]
    if not odd:  # of nothing at all meta.json speaks
        return
    median = median_depth(rgbd.depth)
    _warn(
        f"{100 * max(odd):.0f} % of the view is unknown, with a median depth of {median:.3g} m: if the scene is not that "
        "near or far, its scale is wrong (see `depth_scale`: TUM 5000, KITTI 256, millimetres 1000); else move the camera less"
    )


def share_out_of_view(source: Camera, target: Camera) -> float:
    """Share of the target's pixels (0..1) whose direction the source's picture does not hold: unknown by its turn alone."""
    columns, rows = np.meshgrid(np.arange(0, target.width, EVERY) + 0.5, np.arange(0, target.height, EVERY) + 0.5)
    x, y, ahead = px_from_px(source, target)[0] @ np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
    front = ahead > 0
    x, y = x[front] / ahead[front], y[front] / ahead[front]
    inside = (x >= 0) & (x < source.width) & (y >= 0) & (y < source.height)
    return 1 - float(inside.sum()) / columns.size


def median_depth(depth: Float32Array) -> float:
    """Metres, of some of the valid pixels (depth: H x W); 0 where there are none."""
    some = depth[::EVERY, ::EVERY]
    valid = some[is_valid(some)]
    return float(np.median(valid)) if valid.size else 0.0


def _warn(message: str) -> None:
    warnings.warn(message, UserWarning, stacklevel=4)
