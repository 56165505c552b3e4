"""Random numbers in -> random masks of LaMa's kind out: irregular strokes or boxes; H x W bool, True = hole.

After Suvorov et al. 2022 (sec. 2.3 and its supplement): chains of thick segments that turn to and fro, or a few boxes. All
lengths are shares of the picture's smaller side, so that masks look alike at every size. Mean share of the picture (standard
deviation), measured over 4000 masks of 256 x 256: 0.29 (0.16).
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from dlama.errors import InputError, format_size
from dlama.geometry.rgbd import BoolArray

SMALLEST, LARGEST = 0.005, 0.7
"""Share of the picture that a mask covers at least and at most; others are drawn again."""
MOST_DRAWS = 100
MARGIN = 0.04
"""Share of the side that boxes keep from the border."""
MOST_TURN = 4.0
"""Radians by which a segment is turned from the x axis at most (every other one the other way round)."""


CHAINS, SEGMENTS, LENGTH, WIDTH = (1, 4), (2, 5), (0.04, 0.8), (0.02, 0.4)
"""Least and most: strokes of a mask, segments of each, their length and width as shares of the picture's smaller side. These and
those of boxes are the set `wide` of the published evaluation."""
BOXES, SIDE = (1, 3), (0.12, 0.6)
"""Least and most: boxes of a mask, and their height and width."""
STROKES = 0.5
"""Probability of strokes rather than boxes."""


def random_mask(rng: np.random.Generator, hw: tuple[int, int]) -> BoolArray:
    """H x W, True = hole: strokes or boxes; SMALLEST to LARGEST of the picture. InputError where none fits."""
    for _ in range(MOST_DRAWS):
        mask = (strokes if rng.random() < STROKES else boxes)(rng, hw)
        if SMALLEST <= mask.mean() <= LARGEST:
            return mask
    raise InputError(f"no mask fits a picture of {format_size(hw)}")


def strokes(rng: np.random.Generator, hw: tuple[int, int]) -> BoolArray:
    """Chains of thick segments with round ends."""
    canvas, unit = np.zeros(hw, np.uint8), min(hw)
    for _ in range(rng.integers(*CHAINS, endpoint=True)):
        x, y = rng.uniform(0, hw[1]), rng.uniform(0, hw[0])
        width = max(1, round(unit * rng.uniform(*WIDTH)))
        for number in range(rng.integers(*SEGMENTS, endpoint=True)):
            turn = rng.uniform(0, MOST_TURN) * (-1 if number % 2 else 1)
            length = unit * rng.uniform(*LENGTH)
            to_x = float(np.clip(x + length * math.sin(turn), 0, hw[1] - 1))
            to_y = float(np.clip(y + length * math.cos(turn), 0, hw[0] - 1))
            cv2.line(canvas, (int(x), int(y)), (int(to_x), int(to_y)), 1, width)
            x, y = to_x, to_y
    return canvas > 0


def boxes(rng: np.random.Generator, hw: tuple[int, int]) -> BoolArray:
    """Upright boxes, off the border."""
    canvas, unit = np.zeros(hw, np.bool_), min(hw)
    margin = round(MARGIN * unit)
    for _ in range(rng.integers(*BOXES, endpoint=True)):
        high, wide = (max(1, round(unit * rng.uniform(*SIDE))) for _ in range(2))
        top = int(rng.integers(margin, max(margin + 1, hw[0] - margin - high)))
        left = int(rng.integers(margin, max(margin + 1, hw[1] - margin - wide)))
        canvas[top : top + high, left : left + wide] = True
    return canvas
