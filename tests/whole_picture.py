"""The law that a view from where a picture was taken is that picture."""

from __future__ import annotations

import numpy as np

from dlama.completion.completion import Completion
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import RGBD


def check_same(done: Completion, frame: RGBD) -> None:
    """The view is the frame, measured everywhere but where depth is missing, which alone is filled."""
    known = ~frame.missing
    np.testing.assert_array_equal(done.view.color, frame.color)
    np.testing.assert_array_equal(done.view.depth[known], frame.depth[known])
    assert (done.view.origin[known] == Origin.MEASURED).all() and (done.view.confidence[known] == 1).all()
    np.testing.assert_array_equal(done.warped[0].hole, frame.missing)
    assert not done.view.hole.any()
