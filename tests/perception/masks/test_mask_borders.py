"""Where a mask ends, against closed forms: colours in a band; masks that colours cut out, and masks in depth that is only
roughly right, against the true pixels of a closed-form world: a red box on a grey ground.

Depth is blurred and bent as networks do it, or uneven as matching leaves it.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama import RGBD, Camera, MaskError, find_mask
from dlama.geometry.holes import iou
from dlama.perception.masks import borders
from dlama.perception.masks.borders import MOST_PX, cut_out_box, decide_by_color, run_grabcut
from dlama.perception.masks.prompt import Prompt
from worlds import Box, Plane, World, innermost_pixel

CAMERA = Camera.from_fov(160, 120, 70)
WORLD = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), Box((-0.6, 0.0, 2.6), (0.2, 1.0, 3.2))))
CLICK = (70, 70)


def test_a_carpet_is_no_part_of_what_stands_on_it() -> None:
    """The true pixels of a box on a layer of 1 cm that continues beyond it."""
    camera = Camera.from_fov(320, 240, 70)
    carpet, box = Box((-1.5, 0.99, 2.0), (0.5, 1.0, 3.6)), Box((-0.3, 0.2, 2.6), (0.1, 0.99, 2.9))
    made = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), carpet, box))
    shown = made.trace(camera)[1] == 3
    found = find_mask(made.rgbd(camera), clicks=[innermost_pixel(shown)]).mask
    assert iou(found, shown) > 0.98


@pytest.mark.parametrize("most", [MOST_PX, 2000])
def test_a_band_round_a_box_is_decided_at_every_size(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Oracle: the box itself; the picture is smaller than MOST_PX, or larger and made smaller."""
    monkeypatch.setattr(borders, "MOST_PX", most)
    truth, inner, outer = np.zeros((3, 80, 100), bool)
    truth[20:60, 30:70], inner[26:54, 36:64], outer[12:68, 22:78] = True, True, True
    color = np.where(truth[..., None], 200, 60) + np.random.default_rng(0).integers(0, 9, (80, 100, 3))
    frame = RGBD(color.astype(np.uint8), np.ones((80, 100), np.float32), Camera.from_fov(100, 80, 60))
    found = decide_by_color(frame, inner | (outer & (np.arange(100) < 50)), outer & ~inner)
    assert (found & truth).sum() > (0.99 if most == MOST_PX else 0.9) * (found | truth).sum()


def test_an_object_that_a_smaller_picture_loses_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Closed form: the object is a pixel in each tenth row and column, and none is left at a sixth of the size, which OpenCV
    refuses."""
    monkeypatch.setattr(borders, "MOST_PX", 400)
    state = np.full((120, 120), cv2.GC_BGD, np.uint8)
    state[1:60:10, 1:50:10] = cv2.GC_FGD
    found = run_grabcut(np.zeros((120, 120, 3), np.uint8), state, 2)
    np.testing.assert_array_equal(found, state == cv2.GC_FGD)


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colours, true depth, and where the box is."""
    shown = WORLD.trace(CAMERA)[1]
    rng = np.random.default_rng(0)
    color = np.array([(120, 120, 118), (150, 160, 170), (190, 40, 30)])[shown] + rng.integers(
        -12, 13, (*shown.shape, 3)
    )
    return np.clip(color, 0, 255).astype(np.uint8), WORLD.rgbd(CAMERA).depth, shown == 2


def bent(depth: np.ndarray) -> np.ndarray:
    """Inverse depth blurred over 5 px and off by up to 6 %, slowly over the picture."""
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    w = cv2.GaussianBlur(1 / depth, (0, 0), 5) * (1 + 0.06 * np.sin(u / 25) * np.cos(v / 20))
    return (1 / w).astype(np.float32)


def uneven(depth: np.ndarray) -> np.ndarray:
    """Inverse depth with noise of 4 % of its median."""
    w = 1 / depth
    return (1 / (w + np.random.default_rng(1).normal(0, 0.04 * np.median(w), w.shape))).astype(np.float32)


def test_a_click_finds_the_box_in_noisy_depth() -> None:
    color, depth, box = scene()
    assert iou(find_mask(RGBD(color, uneven(depth), CAMERA), clicks=[CLICK]).mask, box) > 0.93


def test_colours_of_a_large_picture_are_cut_in_a_smaller_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: no picture that GrabCut sees has more than MOST_PX pixels, the rounding of its sides aside; the box is found all the
    same, but for its rim."""
    sizes, cut = list[int](), cv2.grabCut
    monkeypatch.setattr(borders, "MOST_PX", 4000)
    monkeypatch.setattr(cv2, "grabCut", lambda color, *rest: sizes.append(color[..., 0].size) or cut(color, *rest))
    color, _, box = scene()
    found = cut_out_box(color, Prompt(box.shape, (CLICK,), box=(30.0, 30.0, 80.0, 80.0)))
    assert sizes and max(sizes) < 1.05 * 4000
    assert iou(found, box) > 0.85


def test_sky_alone_is_refused() -> None:
    sky = np.full(CAMERA.hw, np.inf, np.float32)
    with pytest.raises(MaskError, match="missing or far everywhere"):
        find_mask(RGBD(scene()[0], sky, CAMERA, {"estimator": "none"}), clicks=[CLICK])


@pytest.mark.parametrize(
    ("click", "change", "words"),
    [
        ((20, 10), "", "20,10, where nothing stands apart"),
        pytest.param((130, 116), "smooth", "130,116, where nothing stands apart", marks=pytest.mark.slow),
        pytest.param((20, 5), "sky", "20,5, which lies on the sky", marks=pytest.mark.slow),
    ],
    ids=["the wall", "a plain floor", "the sky"],
)
def test_a_click_on_nothing_is_refused(click: tuple[int, int], change: str, words: str) -> None:
    """One line says so: a wall that fills the upper rim, a floor along the lower rim and the sky are no objects."""
    color, depth, _ = scene()
    if change == "smooth":
        color = cv2.GaussianBlur(color, (0, 0), 3)
    seen = bent(depth)
    if change == "sky":
        seen[:30] = np.inf
    with pytest.raises(MaskError, match=f"clicks holds {words}"):
        find_mask(RGBD(color, seen, CAMERA, {"estimator": "none"}), clicks=[click])


@pytest.mark.parametrize("height", [2, 3, 6])
def test_a_strip_of_a_few_rows_is_one_line_or_a_mask(height: int) -> None:
    """Law: a picture of a few rows is no error of the program; a mask holds the click."""
    depth = np.random.default_rng(0).uniform(1, 9, (height, 100)).astype(np.float32)
    rgbd = RGBD(np.zeros((height, 100, 3), np.uint8), depth, Camera.from_fov(100, height, 60), {"estimator": "noise"})
    try:
        assert find_mask(rgbd, clicks=[(50, 1)]).mask[1, 50]
    except MaskError as error:
        assert "clicks holds 50,1" in str(error)
