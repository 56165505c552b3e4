"""Borders out of view. Oracle: closed forms (what must stay as it is; a step that is blurred runs through its middle)."""

import numpy as np

from dlama.inpainters.layered.softening import REACH, SHARP, WIDTH, softened

HEIGHT, WIDTH_PX, RIM, BORDER = 120, 240, 40, 60


def stepped() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two surfaces, 60 and 200, that meet at a row; known left of RIM, a hole right of it."""
    label = np.repeat((np.arange(HEIGHT) >= BORDER).astype(np.int32)[:, None] + 1, WIDTH_PX, 1)
    color = np.repeat(np.where(label == 1, 60, 200).astype(np.uint8)[..., None], 3, 2)
    hole = np.zeros(label.shape, np.bool_)
    hole[:, RIM:] = True
    return color, hole, label


def test_borders_are_softer_the_farther_from_what_is_known() -> None:
    """Known pixels and those beside them keep their bits; the steepest step falls with the distance, its middle stays."""
    color, hole, label = stepped()
    out = softened(color, hole, hole, label).astype(int)
    sharp_px = RIM + int(SHARP * WIDTH_PX)
    np.testing.assert_array_equal(out[:, :sharp_px], color[:, :sharp_px])
    steps = [np.abs(np.diff(out[:, column, 0])).max() for column in (sharp_px - 1, 120, 200)]
    assert steps[0] == 140 and steps[1] < 0.6 * steps[0] and steps[2] < 0.8 * steps[1]
    middle = out[BORDER - 1 : BORDER + 1, 200, 0].mean()
    assert abs(middle - 130) < 15


def test_what_is_far_from_a_border_or_was_seen_stays() -> None:
    """Beyond REACH sigmas of the widest blur, and where the hole is in view, nothing changes; nor without a border."""
    color, hole, label = stepped()
    noisy = (color.astype(int) + np.random.default_rng(0).integers(-9, 10, color.shape)).clip(0, 255).astype(np.uint8)
    out = softened(noisy, hole, hole, label)
    away = int(np.ceil(REACH * WIDTH * WIDTH_PX)) + 1
    np.testing.assert_array_equal(out[: BORDER - away], noisy[: BORDER - away])
    np.testing.assert_array_equal(softened(noisy, hole, np.zeros_like(hole), label), noisy)
    np.testing.assert_array_equal(softened(noisy, hole, hole, np.ones_like(label)), noisy)
