"""A mask, or a box, and the picture in; the mask with its border on the picture's edges, or what is cut out along them, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import (
    box_around,
    dilate_mask,
    disc,
    erode_mask,
    larger_box,
    morphological_open,
    nearest_known,
    sides_of,
)
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.perception.masks.prompt import Prompt
from dlama.perception.masks.supports import Planes

MOST_PX = 200_000
"""Most pixels in which GrabCut runs, for its time is proportional to them (with twice as many a click in photos of 1.7 MP takes
21 % more, for an IoU larger by .0002, 24 clicks)."""
LEAST_SAMPLES = 20
"""Least pixels of an object and of what is not from which their colours are learnt."""


def at_same_depth(found: Planes, target: BoolArray, gap: float) -> BoolArray:
    """H x W, True where inverse depth differs from that of the nearest pixel of the object by no more than `gap`, relative."""
    here = found.inverse_depth
    there = here.ravel()[nearest_known(target & (here > 0))[1]]
    return np.asarray(np.abs(here - there) <= gap * np.maximum(here, there))


def snap_to_picture_edges(rgbd: RGBD, target: BoolArray, reach: int, unknown: BoolArray) -> BoolArray:
    """The mask with its border on the picture's edges (GrabCut in a band) where depth is ambiguous.

    reach: half width in px of the ambiguous band; parts thinner than it keep their depth border. 0: depth fits the picture.
    unknown: H x W, pixels next to the object that have no depth.
    """
    inner = erode_mask(target, max(reach, 3))  # missing depth next to the mask takes no more px from it
    band = unknown & ~inner
    if reach:
        thin = target & ~dilate_mask(morphological_open(target, disc(reach)), 1)
        band |= dilate_mask(target, reach) & ~inner & ~thin
    return decide_by_color(rgbd, target, band)


def decide_by_color(rgbd: RGBD, target: BoolArray, band: BoolArray) -> BoolArray:
    """The mask with the pixels of `band` decided by GrabCut; all others stay. Colours are learnt in the surroundings only."""
    if not band.any():
        return target
    tight = box_around(target | band, 0)
    box = larger_box(tight, 12 + (max(sides_of(tight)) - 1) // 4, target.shape)
    prior, open_ = target[box], band[box]
    state = np.where(prior, cv2.GC_FGD, cv2.GC_BGD).astype(np.uint8)
    state[open_] = np.where(prior, cv2.GC_PR_FGD, cv2.GC_PR_BGD)[open_]
    if min((state == cv2.GC_BGD).sum(), (state == cv2.GC_FGD).sum()) < LEAST_SAMPLES:
        return target
    out = target.copy()
    out[box] = np.where(open_, run_grabcut(np.ascontiguousarray(rgbd.color[box]), state, 2), prior)
    return out


def run_grabcut(color: UInt8Array, state: UInt8Array, rounds: int) -> BoolArray:
    """H x W, True on the object, by GrabCut (Rother et al. 2004) from its codes (state, uint8 H x W); above MOST_PX pixels in a
    smaller picture. As the codes say where there are fewer than LEAST_SAMPLES pixels of either."""
    by, wh, small = max(np.sqrt(MOST_PX / state.size), 1 / 6), state.shape[::-1], state.copy()
    if by < 1:  # not so small that a click's disc (7 px) would keep no pixel
        smaller = max(1, round(by * wh[0])), max(1, round(by * wh[1]))
        color = np.asarray(cv2.resize(color, smaller, interpolation=cv2.INTER_AREA), np.uint8)
        small = np.asarray(cv2.resize(state, smaller, interpolation=cv2.INTER_NEAREST), np.uint8)
    if min(is_object(small).sum(), (~is_object(small)).sum()) < LEAST_SAMPLES:
        return is_object(state)
    cv2.setRNGSeed(0)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(color, small, (0, 0, 1, 1), *models, rounds, cv2.GC_INIT_WITH_MASK)
    inside = is_object(small).astype(np.float32)
    if by < 1:
        inside = np.asarray(cv2.resize(inside, wh, interpolation=cv2.INTER_LINEAR), np.float32)
    return np.asarray(inside > 0.5)


def is_object(state: UInt8Array) -> BoolArray:
    """H x W, True where GrabCut's code is of the object."""
    return (state == cv2.GC_FGD) | (state == cv2.GC_PR_FGD)


def cut_out_box(color: UInt8Array, prompt: Prompt) -> BoolArray:
    """H x W, True on the object in a box. MaskError where there is none."""
    tight = prompt.box_slices
    # colours of the background are learnt as far beyond the box
    box = larger_box(tight, int(0.6 * (max(sides_of(tight)) - 1)) + 10, prompt.hw)
    state = np.where(prompt.inside[box], cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    out = np.zeros(prompt.hw, np.bool_)
    out[box] = run_grabcut(np.ascontiguousarray(color[box]), state, 5)
    if not out.any():
        raise MaskError("box holds nothing that stands apart in colour; a box round an object is expected")
    return out
