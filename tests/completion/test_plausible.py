"""Likely mistakes are reported in one line that names what mends them (oracle: the mistakes themselves, made to a good input)."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from box_frame import CAMERA, WORLD
from dlama.completion.report import share_out_of_view
from dlama.completion.verbs import remove, view
from dlama.errors import InputTypeError
from dlama.files.cameras import camera_for
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from worlds import moved

GOOD = WORLD.rgbd(CAMERA)
MASK = WORLD.trace(CAMERA)[1] == 1


def scaled(factor: float) -> RGBD:
    """The same picture, its depth read with a wrong scale."""
    return RGBD(GOOD.color, GOOD.depth * np.float32(factor), CAMERA)


def test_good_input_gets_no_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        view(GOOD, yaw=20, filler="telea")
        remove(GOOD, MASK, yaw=10, filler="telea")
        camera_for((48, 64), fov=5)


def test_a_large_removed_object_is_no_wrong_scale() -> None:
    """Law: what the user removed is no reason to doubt depth or pose, however much of a view it leaves unknown."""
    most = np.broadcast_to(np.arange(64) < 40, (48, 64))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        done = view(remove(GOOD, most, filler="telea").scene, yaw=5, filler="telea")
    assert done.warped[0].color_hole.mean() > 0.6


def test_an_inverted_mask() -> None:
    with pytest.warns(UserWarning, match=r"the mask removes 80 % of the picture.*`mask_polarity` turns it round"):
        remove(GOOD, ~MASK, filler="telea", dilate=0)


@pytest.mark.parametrize(("factor", "yaw"), [(1 / 5, 20), (1 / 10, 10)])
def test_a_depth_scale_that_leaves_most_unknown(factor: float, yaw: float) -> None:
    """TUM's 5000 taken for 1000 the wrong way round, and ten times too near."""
    with pytest.warns(
        UserWarning,
        match=r"% of the view is unknown.*median depth of 0\.\d+ m.*depth_scale.*move the camera less; `world_from_cam`",
    ):
        view(scaled(factor), yaw=yaw, pivot=2.5, filler="telea")


@pytest.mark.parametrize(
    ("factor", "clip", "message"),
    [
        (1000, None, r"median depth is \d+ m: metres are expected; divide millimetres by 1000"),
        (0, None, "no pixel has a depth"),
        (1, 0.01, r"the median depth is 0.01 m: metres are expected; check the clip"),
    ],
)
def test_depth_that_is_hardly_in_metres(factor: float, clip: float | None, message: str) -> None:
    """Millimetres, nothing, and a clip, a known depth or a baseline that is a thousand times too small."""
    with pytest.warns(UserWarning, match=message):
        view(scaled(factor), yaw=1, clip=clip, filler="telea")


@pytest.mark.parametrize("yaw", [45, 80])
def test_a_wide_turn_with_right_depth_gets_no_warning(yaw: float) -> None:
    """Most of the view is unknown, as the camera has turned away."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        done = view(GOOD, yaw=yaw, pivot=2.5, filler="telea")
    assert done.warped[0].color_hole.mean() > 0.5 or yaw < 60


@pytest.mark.parametrize("degrees", [0, 20, 50, 180])
def test_what_a_turn_alone_leaves_unknown(degrees: float) -> None:
    """Closed form: of one row of pixels through the middle, those whose angle to the source's axis is beyond half its field."""
    row = Camera(400, 1, 300, 300, 200, 0.5)
    angles = np.degrees(np.arctan((np.arange(0, 400, 4) + 0.5 - 200) / 300))
    beyond = np.abs(angles - degrees) > np.degrees(np.arctan(200 / 300))
    assert share_out_of_view(row, moved(row, (0, -degrees, 0))) == pytest.approx(beyond.mean(), abs=0.02)


def test_no_mask_removes_nothing_and_is_refused() -> None:
    """Law: a mask that a search did not find is no removal in silence."""
    with pytest.raises(InputTypeError, match="mask is None; a bool array H x W is expected"):
        remove(GOOD, None)  # type: ignore[arg-type]


def test_a_field_of_view_in_radians() -> None:
    """1.0472 radians are 60 degrees."""
    with pytest.warns(UserWarning, match=r"`fov` is 1\.0472 degrees.*radians, give `fov=60`"):
        camera_for((48, 64), fov=1.0472)
