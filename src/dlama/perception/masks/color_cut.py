"""A picture and a box in; what GrabCut cuts out along its colours out. No depth is used."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import larger_box, sides_of
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.perception.masks.borders import run_grabcut
from dlama.perception.masks.prompt import Prompt

SURROUNDINGS = 0.6
"""Margin beyond the box, over its longer side, in which background colours are learnt."""
ROUNDS = 5
"""Of GrabCut."""


def cut_out_box(color: UInt8Array, prompt: Prompt) -> BoolArray:
    """H x W, True on the object in a box. MaskError where there is none."""
    tight = prompt.box_slices
    box = larger_box(tight, int(SURROUNDINGS * (max(sides_of(tight)) - 1)) + 10, prompt.hw)
    state = np.where(prompt.inside[box], cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    out = np.zeros(prompt.hw, np.bool_)
    out[box] = run_grabcut(np.ascontiguousarray(color[box]), state, ROUNDS)
    if not out.any():
        raise MaskError("box holds nothing that stands apart in colour; a box round an object is expected")
    return out
