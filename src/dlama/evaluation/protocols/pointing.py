"""A frame and the true mask of an object in; the masks that clicks, boxes and GrabCut find out.

One click at the true mask's innermost pixel, then up to three corrections, each at the innermost pixel of the largest wrong
region; the box of the true mask, 5 % larger; both where depth is estimated from the picture. Compared with OpenCV's GrabCut
alone, with the same box, and with a box of a quarter of the picture round the first click.
"""

from __future__ import annotations

import time
import warnings
from functools import lru_cache

import cv2
import numpy as np

from dlama.datasets.frames import RemovalTruth
from dlama.errors import MaskError
from dlama.evaluation.metrics.masks import box_of, innermost_pixel, largest_region
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.perception.masks.borders import is_object
from dlama.perception.masks.prompt import Box, Point
from dlama.perception.monocular import estimate_depth
from dlama.perception.object_masks import MaskSession

CLICKS = ("click", "clicks-2", "clicks-3", "clicks-4")
"""One click, and with one to three corrections."""
BOX_LARGER = 0.05
GRABCUT_ROUNDS = 5


@lru_cache(maxsize=1)
def find_masks(truth: RemovalTruth) -> tuple[dict[str, BoolArray], float]:
    """The masks by what was given, and processor seconds of the first click; made once for all methods of a case."""
    color, true = truth.source.color, truth.mask
    session = MaskSession(truth.source)
    started = time.process_time()
    first = find_or_empty(session, true, clicks=[innermost_pixel(true)])
    seconds = time.process_time() - started
    masks = dict(zip(CLICKS, correct_mask(session, true, first)))
    masks["box"] = find_or_empty(session, true, box=box_of(true, BOX_LARGER))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a scale that is assumed: it does not matter here
        photo = MaskSession(estimate_depth(color, truth.source.camera).rgbd)
    masks["click-estimated-depth"] = find_or_empty(photo, true, clicks=[innermost_pixel(true)])
    masks["box-estimated-depth"] = find_or_empty(photo, true, box=box_of(true, BOX_LARGER))
    (x, y), (height, width) = innermost_pixel(true), true.shape
    masks["grabcut-box"] = grabcut(color, box_of(true, BOX_LARGER))
    masks["grabcut-click"] = grabcut(color, (x - width / 4, y - height / 4, width / 2, height / 2))
    return masks, seconds


def correct_mask(session: MaskSession, true: BoolArray, first: BoolArray) -> list[BoolArray]:
    """The masks after one click (`first`), and after each correction."""
    clicks: list[Point] = [innermost_pixel(true)]
    away: list[Point] = []
    masks = [first]
    while len(masks) < len(CLICKS):
        wrong = masks[-1] ^ true
        if not wrong.any():
            return masks + [masks[-1]] * (len(CLICKS) - len(masks))
        x, y = innermost_pixel(largest_region(wrong))
        (clicks if true[y, x] else away).append((x, y))
        masks.append(find_or_empty(session, true, clicks=clicks, not_clicks=away))
    return masks


def find_or_empty(
    session: MaskSession,
    true: BoolArray,
    clicks: list[Point] | None = None,
    not_clicks: list[Point] | None = None,
    box: Box | None = None,
) -> BoolArray:
    """The mask that a session finds; nothing where it finds none."""
    try:
        return session.find(clicks=clicks or (), not_clicks=not_clicks or (), box=box).mask
    except MaskError:
        return np.zeros(true.shape, np.bool_)


def grabcut(color: UInt8Array, box: Box) -> BoolArray:
    """OpenCV's GrabCut alone from a box, clipped to the picture (H x W x 3)."""
    height, width = color.shape[:2]
    x, y = max(0, round(box[0])), max(0, round(box[1]))
    clipped = (x, y, max(1, min(width, round(box[0] + box[2])) - x), max(1, min(height, round(box[1] + box[3])) - y))
    if clipped == (0, 0, width, height):
        return np.ones((height, width), np.bool_)
    state = np.zeros((height, width), np.uint8)
    cv2.setRNGSeed(0)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(np.ascontiguousarray(color), state, clipped, *models, GRABCUT_ROUNDS, cv2.GC_INIT_WITH_RECT)
    return is_object(state)
