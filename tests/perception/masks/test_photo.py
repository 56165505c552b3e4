"""What is salient, and clicks and boxes in a picture whose depth is estimated, against the true pixels of drawn scenes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dlama import RGBD, Camera, MaskError, MaskSession, find_mask
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.perception.masks import photo, salient
from dlama.perception.masks.borders import cut_out_box
from dlama.perception.masks.click_network import first_window, salient_about
from dlama.perception.masks.prompt import Prompt
from worlds import box_round

SIDE = 192
BAND = (96, 132)
"""x, y on a white band of the post."""


def striped_post() -> tuple[UInt8Array, BoolArray]:
    """An orange post with white bands on grey ground before a pale wall, and where it is."""
    rng = np.random.default_rng(0)
    color = np.full((SIDE, SIDE, 3), (205, 210, 215), np.uint8)
    color[90:] = (110, 110, 112)
    post = np.zeros((SIDE, SIDE), np.uint8)
    cv2.fillPoly(post, [np.array([(84, 70), (108, 70), (116, 160), (76, 160)])], 1)
    color[post > 0] = (225, 95, 20)
    for top in (84, 120):
        rows = slice(top, top + 20)
        color[rows][post[rows] > 0] = (240, 240, 235)
    noisy = color.astype(np.int16) + rng.integers(-6, 7, color.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), post > 0


def without_the_object() -> RGBD:
    """The picture with a depth that shows the ground and the wall alone, as networks miss what is thin."""
    rows = np.arange(SIDE)[:, None] + np.zeros((1, SIDE))
    depth = np.where(rows < 90, 8.0, 8.0 / (1 + np.maximum(rows - 90, 0) / 25)).astype(np.float32)
    return RGBD(striped_post()[0], depth, Camera.from_fov(SIDE, SIDE, 60), {"estimator": "none"})


@pytest.fixture(scope="module")
def session() -> MaskSession:
    """Of that picture; the network runs once for each window that several tests ask for."""
    return MaskSession(without_the_object())


def test_a_click_on_a_band_finds_the_whole_object_that_depth_does_not_show(session: MaskSession) -> None:
    """The true pixels of the post; what stands out is one object, whatever its colours."""
    found = session.find(clicks=[BAND])
    assert iou(found.mask, striped_post()[1]) > 0.9
    assert "found in estimated depth" in found.notes[0]


@pytest.mark.slow
def test_a_box_finds_the_object_in_it() -> None:
    true = striped_post()[1]
    found = find_mask(without_the_object(), box=box_round(true, 2)).mask
    assert iou(found, true) > 0.9


def test_what_stands_out_and_fills_a_box_is_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bright pixels stand out, which are the post and, outside the box, a lamp: to the pixel, without the lamp."""
    color, true = striped_post()
    color[:90][~true[:90]] = 60
    color[20:30, 20:30] = 250
    monkeypatch.setattr(salient, "small_saliency", lambda window: (window[..., 0] > 170).astype(np.float32))
    picture = RGBD(color, without_the_object().depth, Camera.from_fov(SIDE, SIDE, 60), {"estimator": "none"})
    np.testing.assert_array_equal(find_mask(picture, box=box_round(true, 2)).mask, true)


def test_what_fills_little_of_a_box_is_not_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thin line stands out: the mask is what colours cut out, as without the network."""
    monkeypatch.setattr(salient, "small_saliency", lambda color: np.eye(len(color), dtype=np.float32))
    box = box_round(striped_post()[1], 2)
    picture = without_the_object()
    prompt = Prompt(picture.depth.shape, box=box)
    masker = photo.PhotoMasker(picture)
    assert masker.salient_in_box(prompt.box_slices) is None
    np.testing.assert_array_equal(masker.candidates(prompt)[0], cut_out_box(picture.color, prompt))


def test_clicks_next_to_the_object_are_none_of_it(session: MaskSession) -> None:
    """The corrected mask holds the click, and not what a click next to it takes away."""
    mask = session.find(clicks=[BAND], not_clicks=[(96, 78)]).mask
    assert mask[132, 96] and not mask[78, 96] and (mask & ~striped_post()[1]).sum() < 0.1 * mask.sum()


def test_the_network_runs_once_for_each_window_of_a_click(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two windows for a click; the same click with another next to it asks for none, nor does the network of clicks at first."""
    runs: list[tuple[int, ...]] = []

    def orange_or_white(color: UInt8Array) -> np.ndarray:
        runs.append(color.shape[:2])
        return ((color[..., 2] < 60) | (color.min(-1) > 225)).astype(np.float32)

    monkeypatch.setattr(salient, "small_saliency", orange_or_white)
    masker, hw = photo.PhotoMasker(without_the_object()), (SIDE, SIDE)
    masker.candidates(Prompt(hw, (BAND,)))
    masker.candidates(Prompt(hw, (BAND,), ((10, 10),)))
    salient_about(masker.seen, (BAND[1], BAND[0]), first_window(hw))
    assert runs == [(144, 144), (96, 96)]


def test_a_window_without_contrast_shows_nothing() -> None:
    """The network stretches what it says to 0..1: in a window of one colour it would find something in nothing."""
    color, rgbd = striped_post()[0], without_the_object()
    color[:] = 128
    with pytest.raises(MaskError, match="clicks holds 96,132"):
        find_mask(RGBD(color, rgbd.depth, rgbd.camera, rgbd.estimate), clicks=[BAND])


def test_an_object_that_the_windows_cut_off_is_found_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a network that finds all that is red, the red bar across the picture comes back, not what a window shows of it."""
    monkeypatch.setattr(salient, "small_saliency", lambda color: (color[..., 0] > 200).astype(np.float32))
    color, rgbd = np.full((SIDE, SIDE, 3), 90, np.uint8), without_the_object()
    color[80:120, 8:184] = (220, 30, 30)
    masker = photo.PhotoMasker(RGBD(color, rgbd.depth, rgbd.camera, rgbd.estimate))
    found = masker.candidates(Prompt((SIDE, SIDE), ((96, 100),)))[0]
    assert (found == (color[..., 0] > 200)).all()


def two_balls() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture with a red and a yellow ball on a lawn, and where each is."""
    rng = np.random.default_rng(0)
    v, u = np.mgrid[:200, :300]
    red, yellow = ((u - middle) ** 2 + (v - 110) ** 2 < 35**2 for middle in (80, 220))
    color = np.where(red[..., None], (210, 40, 30), (90, 150, 70))
    color = np.where(yellow[..., None], (240, 220, 40), color) + rng.integers(-8, 9, (200, 300, 3))
    return np.clip(color, 0, 255).astype(np.uint8), red, yellow


def test_clicks_choose_among_what_stands_out() -> None:
    """The clicked ball alone; without the ball that a pixel next to the object lies on; on the lawn nothing stands out."""
    color, red, yellow = two_balls()
    session = MaskSession(color, masker="salient")
    assert iou(session.find().mask, red | yellow) > 0.85 and session.find().masker == "salient"
    assert iou(session.find(clicks=[(80, 110)]).mask, red) > 0.85
    assert iou(session.find(not_clicks=[(80, 110)]).mask, yellow) > 0.85
    with pytest.raises(MaskError, match="clicks holds 150,20, where there is no salient object"):
        session.find(clicks=[(150, 20)])


def test_a_picture_of_one_colour_is_refused() -> None:
    """The network stretches what it says to 0..1, and would find something in nothing."""
    with pytest.raises(MaskError, match="nearly one colour"):
        find_mask(np.full((60, 80, 3), 90, np.uint8), masker="salient")
