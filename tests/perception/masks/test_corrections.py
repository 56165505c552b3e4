"""Masks corrected at clicks, against true masks of closed forms, and laws of every correction."""

from __future__ import annotations

import numpy as np
import pytest

from dlama import RGBD, Camera
from dlama.geometry.holes import iou
from dlama.perception.masks.corrections import correct_mask
from dlama.perception.masks.prompt import Prompt

HW = 120, 160
FIRST, SECOND = np.zeros((2, *HW), np.bool_)
FIRST[40:80, 30:70], SECOND[40:80, 70:110] = True, True


def two_squares(depth: np.ndarray | None = None) -> RGBD:
    """Two squares side by side, of two colours, before a third."""
    color = np.select([FIRST[..., None], SECOND[..., None]], [200, 120], 40)
    color = color + np.random.default_rng(0).integers(0, 9, (*HW, 3))
    depth = np.ones(HW, np.float32) if depth is None else depth
    return RGBD(color.astype(np.uint8), depth, Camera.from_fov(HW[1], HW[0], 60))


def nothing_alone(prompt: Prompt) -> dict[tuple[int, int], np.ndarray]:
    """No object is found at any click alone."""
    return dict.fromkeys(prompt.on, np.zeros(HW, np.bool_))


@pytest.mark.parametrize("belongs", [False, True])
def test_a_click_corrects_the_region_of_its_colour(belongs: bool) -> None:
    """Oracle: the second square is taken away from both, or added to the first."""
    before, true = (FIRST, FIRST | SECOND) if belongs else (FIRST | SECOND, FIRST)
    second, clicks = (90.0, 60.0), ((50.0, 60.0),)
    prompt = Prompt(HW, (*clicks, second)) if belongs else Prompt(HW, clicks, (second,))
    found = correct_mask(two_squares(), before, prompt, nothing_alone(prompt))
    assert found[60, 90] == belongs
    assert iou(found, true) > 0.95


@pytest.mark.parametrize("kind", ["object", "empty", "full", "one"])
@pytest.mark.parametrize("known", [True, False])
def test_every_click_is_right_whatever_the_mask(kind: str, known: bool) -> None:
    """Law, at random clicks, also at the picture's rim: pixels of clicks are as they say."""
    rng = np.random.default_rng(3)
    masks = {"object": FIRST, "empty": np.zeros(HW, np.bool_), "full": np.ones(HW, np.bool_)}
    masks["one"] = np.zeros(HW, np.bool_)
    masks["one"][7, 9] = True
    frame = two_squares(np.full(HW, 1 if known else np.inf, np.float32))
    for number in range(3):
        places = [(0.0, 0.0), *((float(x), float(y)) for x, y in rng.integers(0, (HW[1], HW[0]), (3, 2)))]
        clicks, away = tuple(places[: number + 1]), tuple(places[number + 1 :])
        prompt = Prompt(HW, clicks, away)
        found = correct_mask(frame, masks[kind], prompt, nothing_alone(prompt))
        assert not any(found[pixel] for pixel in prompt.away)
        assert len(clicks) > 1 or all(found[pixel] for pixel in prompt.on)


def test_what_the_clicks_agree_with_stays() -> None:
    """Law: a mask with which all clicks agree comes back, and a correction changes the region about its click alone."""
    frame = two_squares()
    prompt = Prompt(HW, ((50.0, 60.0),), ((90.0, 60.0),))
    np.testing.assert_array_equal(correct_mask(frame, FIRST, prompt, nothing_alone(prompt)), FIRST)
    apart = np.zeros(HW, np.bool_)
    apart[5:20, 5:20] = True
    found = correct_mask(frame, FIRST | SECOND | apart, prompt, nothing_alone(prompt))
    np.testing.assert_array_equal(found[:25], apart[:25])


def test_another_object_is_added_whole() -> None:
    """What a further click finds alone is added as it is, unless the mask has a part of it or a negative click is on it."""
    other = np.zeros(HW, np.bool_)
    other[90:118, 120:150:2] = True
    pixel, on = (100, 130), ((50.0, 60.0), (130.0, 100.0))
    found = correct_mask(two_squares(), FIRST, Prompt(HW, on), {pixel: other})
    np.testing.assert_array_equal(found, FIRST | other)
    for mask, away in (
        (FIRST | np.roll(other, 1, 1) | (other & ~np.eye(*HW, 30, bool)), ()),
        (FIRST, ((130.0, 110.0),)),
    ):
        mask = mask.copy()
        mask[pixel] = False
        assert (correct_mask(two_squares(), mask, Prompt(HW, on, away), {pixel: other}) != (mask | other)).any()
