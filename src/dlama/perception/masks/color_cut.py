"""A picture and a box, with or without clicks, in; what GrabCut cuts out along its colours out. No depth is used."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import box_around, larger_box, morphological_close, sides_of, square
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.perception.masks.borders import run_grabcut
from dlama.perception.masks.prompt import Pixel, Prompt

SEED_PX = 3
"""Radius of a click."""
SURROUNDINGS = 0.6
"""Margin beyond what may be the object, over its longer side, in which background colours are learnt."""
ROUNDS = 5
"""Of GrabCut."""


def cut_out_box(color: UInt8Array, prompt: Prompt) -> BoolArray:
    """H x W, True on the object in a box; where there are clicks the parts with one. MaskError where there is none."""
    state = np.where(prompt.inside, cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    for pixel in prompt.on:
        cv2.circle(state, pixel[::-1], SEED_PX, cv2.GC_FGD, -1)
    mask = cut_along_colors(color, state)
    if not mask.any():
        raise MaskError(
            "box holds nothing that stands apart in colour; a box round an object is expected, or clicks on it"
        )
    return keep_clicked_parts(mask, prompt.on) if prompt.clicks else mask


def cut_along_colors(color: UInt8Array, state: UInt8Array) -> BoolArray:
    """H x W, True on the object, by GrabCut from its codes (state, uint8 H x W); colours are learnt in the surroundings only."""
    asked = state != cv2.GC_BGD
    tight = box_around(asked, 0)
    box = larger_box(tight, int(SURROUNDINGS * (max(sides_of(tight)) - 1)) + 10, asked.shape)
    out = np.zeros(state.shape, np.bool_)
    out[box] = run_grabcut(np.ascontiguousarray(color[box]), np.ascontiguousarray(state[box]), ROUNDS)
    return out


def keep_clicked_parts(mask: BoolArray, clicks: list[Pixel]) -> BoolArray:
    """The pieces of the mask that contain a click, with gaps of a pixel closed."""
    _, labels = cv2.connectedComponents(morphological_close(mask, square(3)).astype(np.uint8), connectivity=8)
    numbers = {int(labels[pixel]) for pixel in clicks} - {0}
    return np.isin(labels, list(numbers))
