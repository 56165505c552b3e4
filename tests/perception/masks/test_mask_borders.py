"""Where a mask ends: how sharp a depth step is (oracle: steps drawn in closed form)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.perception.masks.borders import edges_are_sharp
from dlama.perception.masks.supports import Planes

SIDE = 60


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize("ramp", [1, 9])
def test_a_step_is_sharp_within_one_pixel_at_any_border_of_the_picture(ramp: int, turn: int) -> None:
    """A thing that reaches to a border of the picture: what lies at the other border is not beside it."""
    columns = np.arange(SIDE) - 30
    share = np.clip((columns + ramp / 2) / ramp, 0, 1) if ramp > 1 else columns >= 0
    w = np.rot90(np.tile((0.2 + 0.3 * share).astype(np.float32), (SIDE, 1)), turn)
    thing = np.rot90(np.tile(columns >= 0, (SIDE, 1)), turn)
    rgbd = RGBD(np.zeros((SIDE, SIDE, 3), np.uint8), 1 / w, Camera.from_fov(SIDE, SIDE, 60))
    found = Planes(w, np.zeros((0, 3)), np.full(w.shape, -1, np.int32), (), 0.0)
    assert edges_are_sharp(rgbd, found, thing) == (ramp == 1)
