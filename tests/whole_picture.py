"""The law that a view from where a picture was taken is that picture, and views that are the same."""

from __future__ import annotations

import numpy as np

from dlama.completion.completion import Completion
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View


def check_same(done: Completion, frame: RGBD, clip_m: float = np.inf) -> None:
    """The view is the frame (cut at `clip_m`), measured everywhere but where depth is missing, which alone is filled."""
    known = ~frame.missing
    np.testing.assert_array_equal(done.view.color, frame.color)
    np.testing.assert_array_equal(done.view.depth[known], np.minimum(frame.depth, np.float32(clip_m))[known])
    np.testing.assert_array_equal(done.view.origin, np.where(known, Origin.MEASURED, Origin.DEPTH_FILLED))
    np.testing.assert_array_equal(done.view.confidence == 1, known)
    np.testing.assert_array_equal(done.warped[0].hole, frame.missing)
    assert not done.view.hole.any() and (done.view.depth > 0).all()


def assert_same_view(one: View, other: View) -> None:
    """Every plane, bit for bit."""
    for name in ("color", "depth", "hole", "hole_type", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def counts(origin: np.ndarray) -> dict[Origin, int]:
    """How many of each origin, none left out."""
    return {kind: int((origin == kind).sum()) for kind in Origin}
