"""MASK, an object pointed at: a frame with it and its true mask in; how well masks are found, and its removal with them, out.

One click at the true mask's innermost pixel, then up to three corrections, each at the innermost pixel of the largest wrong
region; the box of the true mask, 5 % larger; one click where depth is estimated from the picture. Compared with OpenCV's GrabCut
alone, with the same box, and with a box of a quarter of the picture round the first click. Each is a region with `iou` and
`border_f` of modality `mask`.

The method removes the object with the mask of one click; variant `clicks-2` with that of one click and one correction,
`true-mask` with the true one, `with-shadow` with its shadow too. Errors are taken in ORI's regions, `mask` being the true one.
Region `shadow`, modality `mask`: which pixels that the object darkens by a tenth or more (`darkened_by_shadow`) are found with
the true mask; `false_alarm`: % of the picture found where there is none. The contact line, within 2 px of the object, is not
scored.
"""

from __future__ import annotations

import time
import warnings
from functools import lru_cache

import cv2
import numpy as np

from dlama.datasets.frames import RemovalTruth, Truth
from dlama.errors import InputError, MaskError
from dlama.evaluation.metrics.masks import (
    border_f,
    box_of,
    darkened_by_shadow,
    innermost_pixel,
    iou,
    largest_region,
    outside_contact_band,
)
from dlama.evaluation.protocols.methods import Measure, Method, ProtocolSettings, Scored, run_method
from dlama.evaluation.protocols.ori import reference_of
from dlama.evaluation.protocols.scores import picture_panel
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.perception.masks.prompt import Box, Point
from dlama.perception.monocular import estimate_depth
from dlama.perception.object_masks import MaskSession
from dlama.perception.shadows.find import find_shadow

CLICKS = ("click", "clicks-2", "clicks-3", "clicks-4")
"""Regions: one click, and with one to three corrections."""
BOX_LARGER = 0.05
SMALLEST_SHADOW_PX = 60
"""A smaller one counts as none."""
GRABCUT_ROUNDS = 5


def score(truth: Truth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """The masks, and the removal with that of one click; then after a correction, with the true mask, and with the shadow.

    Raises:
        InputError: not a RemovalTruth, an empty mask, or what the completion raises.
    """
    if not isinstance(truth, RemovalTruth) or not truth.mask.any():
        raise InputError(f"mask: the case holds a {type(truth).__name__}; a RemovalTruth with a mask is expected")
    masks, seconds = find_masks(truth)
    measures = [
        Measure(name, "mask", metric, value)
        for name, mask in masks.items()
        for metric, value in (("iou", iou(mask, truth.mask)), ("border_f", border_f(mask, truth.mask)))
    ]
    measures += [*shadow_measures(truth), Measure("click", "time", "seconds", seconds)]
    found, shadow = masks["click"], detect_shadow(truth)
    removals = {"": found, CLICKS[1]: masks[CLICKS[1]], "true-mask": truth.mask, "with-shadow": found | shadow}
    if not settings.mask_changes:
        removals = {"": found}
    scored = []
    for variant, mask in removals.items():
        scored.append(score_removal_with(truth, method, settings, mask, variant, measures if not variant else []))
    return scored


def score_removal_with(
    truth: RemovalTruth, method: Method, settings: ProtocolSettings, mask: BoolArray, variant: str, more: list[Measure]
) -> Scored:
    """The object removed by a mask (nothing is removed where that is empty or full), measured in the true regions."""
    usable = mask if mask.any() and not mask.all() else None
    run = run_method(method, truth.source, truth.source.camera, usable)
    reference, view = reference_of(truth, settings), run.view()
    measures = [
        *more,
        *reference.color_measures(view.color),
        *reference.depth_measures(view.depth),
        *reference.metre_measures(view.depth, run.without_depth()),
        *reference.shares(),
        run.timing(),
    ]
    panel = None if variant else picture_panel(run, reference, truth.source, truth.without)
    return Scored(tuple(measures), variant, panel, run.completion.meta)


@lru_cache(maxsize=1)
def find_masks(truth: RemovalTruth) -> tuple[dict[str, BoolArray], float]:
    """The masks by region, and processor seconds of the first click; made once for all methods of a case."""
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
    return np.asarray((state == cv2.GC_FGD) | (state == cv2.GC_PR_FGD))


@lru_cache(maxsize=1)
def detect_shadow(truth: RemovalTruth) -> BoolArray:
    """The shadow of the object under the true mask, as `with_shadow` finds it."""
    return find_shadow(truth.source, truth.mask)


def shadow_measures(truth: RemovalTruth) -> list[Measure]:
    """Recall and precision in pixels; where there is no shadow the share of the picture that is taken for one, in percent."""
    found = detect_shadow(truth) & outside_contact_band(truth.mask)
    true = darkened_by_shadow(truth.source.color, truth.without.color, truth.mask)
    if truth.compare is not None:
        found, true = found & truth.compare, true & truth.compare
    if true.sum() < SMALLEST_SHADOW_PX:
        return [Measure("shadow", "mask", "false_alarm", 100 * float(found.mean()))]
    both = float((found & true).sum())
    measures = [Measure("shadow", "mask", "recall", both / float(true.sum()))]
    if found.any():
        measures.append(Measure("shadow", "mask", "precision", both / float(found.sum())))
    return measures
