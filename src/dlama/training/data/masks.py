"""Random numbers in -> random masks of LaMa's kind out: irregular strokes or boxes; H x W bool, True = hole.

After Suvorov et al. 2022 (sec. 2.3 and its supplement): chains of thick segments that turn to and fro, or a few boxes. All
lengths are shares of the picture's smaller side, so that masks look alike at every size. Mean share of the picture (standard
deviation), measured over 4000 masks of 256 x 256: 0.29 (0.16).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.errors import InputError
from dlama.geometry.rgbd import BoolArray

SMALLEST, LARGEST = 0.005, 0.7
"""Share of the picture that a mask covers at least and at most; others are drawn again."""
MOST_DRAWS = 100
MARGIN = 0.04
"""Share of the side that boxes keep from the border."""
MOST_TURN = 4.0
"""Radians by which a segment is turned from the x axis at most (every other one the other way round)."""


@dataclass(frozen=True)
class MaskSet:
    """Ranges (least, most) that strokes and boxes are drawn from; lengths as shares of the picture's smaller side."""

    chains: tuple[int, int]
    """Number of strokes."""
    segments: tuple[int, int]
    """Number of segments of each stroke."""
    length: tuple[float, float]
    width: tuple[float, float]
    boxes: tuple[int, int]
    side: tuple[float, float]
    """Height and width of a box."""
    strokes: float = 0.5
    """Probability of strokes rather than boxes."""


WIDE = MaskSet((1, 4), (2, 5), (0.04, 0.8), (0.02, 0.4), (1, 3), (0.12, 0.6))
"""The set `wide` of the published evaluation."""


def random_mask(rng: np.random.Generator, hw: tuple[int, int]) -> BoolArray:
    """H x W, True = hole: strokes or boxes; SMALLEST to LARGEST of the picture. InputError where none fits."""
    for _ in range(MOST_DRAWS):
        mask = strokes(rng, hw, WIDE) if rng.random() < WIDE.strokes else boxes(rng, hw, WIDE)
        if SMALLEST <= mask.mean() <= LARGEST:
            return mask
    raise InputError(f"no mask fits a picture of {hw[1]}x{hw[0]}")


def strokes(rng: np.random.Generator, hw: tuple[int, int], of: MaskSet) -> BoolArray:
    """Chains of thick segments with round ends."""
    canvas, unit = np.zeros(hw, np.uint8), min(hw)
    for _ in range(_count(rng, of.chains)):
        x, y = rng.uniform(0, hw[1]), rng.uniform(0, hw[0])
        width = max(1, round(unit * rng.uniform(*of.width)))
        for number in range(_count(rng, of.segments)):
            turn = rng.uniform(0, MOST_TURN) * (-1 if number % 2 else 1)
            length = unit * rng.uniform(*of.length)
            to_x = float(np.clip(x + length * math.sin(turn), 0, hw[1] - 1))
            to_y = float(np.clip(y + length * math.cos(turn), 0, hw[0] - 1))
            cv2.line(canvas, (int(x), int(y)), (int(to_x), int(to_y)), 1, width)
            x, y = to_x, to_y
    return canvas > 0


def boxes(rng: np.random.Generator, hw: tuple[int, int], of: MaskSet) -> BoolArray:
    """Upright boxes, off the border."""
    canvas, unit = np.zeros(hw, np.bool_), min(hw)
    margin = round(MARGIN * unit)
    for _ in range(_count(rng, of.boxes)):
        high, wide = (max(1, round(unit * rng.uniform(*of.side))) for _ in range(2))
        top = int(rng.integers(margin, max(margin + 1, hw[0] - margin - high)))
        left = int(rng.integers(margin, max(margin + 1, hw[1] - margin - wide)))
        canvas[top : top + high, left : left + wide] = True
    return canvas


def _count(rng: np.random.Generator, span: tuple[int, int]) -> int:
    return int(rng.integers(span[0], span[1] + 1))
