"""`RGBD.padding` against frames that were drawn; what a view and a removal make of such a picture."""

from dataclasses import replace

import numpy as np
import pytest

import dlama
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View

HW, NO_DEPTH = (192, 256), 20
TOP, BOTTOM, LEFT, RIGHT = 3, 2, 4, 3


def drawn_frame(mixed: int = 0) -> BoolArray:
    """The pixels of the frame, with so many pixels inside it."""
    inside = np.zeros(HW, np.bool_)
    inside[TOP + mixed : HW[0] - BOTTOM - mixed, LEFT + mixed : HW[1] - RIGHT - mixed] = True
    return ~inside


def picture(level: int = 255, where: BoolArray | None = None, no_depth: int = NO_DEPTH) -> RGBD:
    """A wall 2 m away in noisy grey, as a Kinect gives it: a frame round the colours and a wider border without depth."""
    color = np.random.default_rng(0).integers(90, 110, (*HW, 3)).astype(np.uint8)
    color[drawn_frame() if where is None else where] = level
    depth = np.zeros(HW, np.float32)
    depth[no_depth : HW[0] - no_depth, no_depth : HW[1] - no_depth] = 2
    return RGBD(color, depth, dlama.Camera.from_fov(*HW[::-1], 60))


@pytest.mark.parametrize("level", [0, 2, 253, 255])
def test_a_frame_without_depth_is_padding_with_the_pixel_inside_it(level: int) -> None:
    np.testing.assert_array_equal(picture(level).padding, drawn_frame(mixed=1))


def test_white_next_to_the_frame_is_padding_up_to_twice_its_usual_width() -> None:
    where = drawn_frame()
    where[:8, 50:60] = True  # a white ceiling
    found = picture(where=where).padding
    assert found is not None
    assert found[: 2 * TOP + 1, 50:60].all()
    assert not found[2 * TOP + 1 : 20, 50:60].any()


@pytest.mark.parametrize(
    "given",
    [
        picture(where=np.zeros(HW, np.bool_)),
        picture(no_depth=0),
        picture(where=drawn_frame() & (np.arange(HW[1]) > 20)),
        picture(where=drawn_frame(mixed=12), no_depth=24),
        picture(level=200),
    ],
    ids=["no frame", "depth in the frame", "open on the left", "too wide", "grey"],
)
def test_what_is_no_padding(given: RGBD) -> None:
    assert given.padding is None


def test_the_source_view_does_not_know_it() -> None:
    given = picture()
    view = View.from_rgbd(given)
    padding = drawn_frame(mixed=1)
    np.testing.assert_array_equal(view.color_hole, padding)
    assert (view.hole_type[padding] == HoleType.OUT_OF_VIEW).all()
    np.testing.assert_array_equal(view.color[~padding], given.color[~padding])


def test_a_padding_that_is_given_is_the_one() -> None:
    """Law: it is kept as given, depth in it is dropped, and it stays where a frame is given other depth; others are refused."""
    where = np.zeros(HW, np.bool_)
    where[40:50, 60:90] = True
    given = replace(picture(no_depth=0), padding=where)
    assert given.padding is not None and not given.depth[where].any() and (given.depth[~where] == 2).all()
    np.testing.assert_array_equal(View.from_rgbd(given.clip_depth(1.0)).color_hole, where)
    for wrong in (where[1:], where.astype(np.uint8)):
        with pytest.raises(dlama.ShapeError, match=r"padding is .*bool H x W"):
            replace(given, padding=wrong)


def test_no_completion_shows_it() -> None:
    given = picture()
    mask = np.zeros(HW, np.bool_)
    mask[80:100, 120:140] = True
    for done in (dlama.view(given, yaw=8), dlama.remove(given, mask)):
        view = done.view
        assert not view.hole.any()
        assert view.color.max() < 200
        assert done.meta["decisions"]["padding"]["pixels"] == drawn_frame(mixed=1).sum()
    kept = (view.origin == Origin.MEASURED) & ~mask
    np.testing.assert_array_equal(view.color[kept], given.color[kept])
