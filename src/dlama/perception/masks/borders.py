"""A mask found in depth in; the same with the foot that its plane took, and its border moved to the picture's edges, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import (
    box_around,
    dilate_mask,
    disc,
    erode_mask,
    larger_box,
    morphological_open,
    nearest_known,
    regions_touching,
    sides_of,
)
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.supports import Planes, height_above
from dlama.perception.planes import tolerance

CONTACT_PX = 12
"""How far from the object its foot may reach over the plane it stands on,"""
CONTACT_GAP = 0.08
"""and by what share its depth may differ from the object's there: a wall far behind is no foot."""
CONTACT_NOISE = 5.0
"""A foot rises over the plane by so many standard deviations of the plane's own unevenness,"""
CONTACT_STEP = 0.0012
"""and by this relative step in inverse depth at least."""
LEAST_UNDER = 10
"""Pixels of a plane that an object touches at least if it stands on it."""
LAYER = 0.5
"""What rises has less than this share of its pixels near the object if it is a layer of its own on the plane."""
SHARP = 0.7
"""Share of a depth step that a sharp edge makes within one pixel."""
WIDE_PX = 4
"""Pixels to either side between which the whole step lies, sharp or not."""
BAND_PX = 3
"""Reach in px of the band in which the picture decides, where depth is noisy, blurred or missing."""
HOLE_PX = 12
"""How far into missing depth a mask may grow."""
MOST_PX = 1_000_000
"""Pixels round an object from which GrabCut learns its colours; it takes seconds for ten times as many."""


def add_ground_contact(found: Planes, support: BoolArray, target: BoolArray) -> BoolArray:
    """The object and the pixels of a supporting plane that are connected with it and rise a little over the plane."""
    near = dilate_mask(target, CONTACT_PX) & support & at_same_depth(found, target)
    if not near.any():
        return target
    step = height_above(found, support)
    around = dilate_mask(target, 4 * CONTACT_PX) & support
    unevenness = 1.4826 * float(np.median(np.abs(step[around])))
    least = max(CONTACT_STEP, CONTACT_NOISE * unevenness)
    rises = near & above_thin_layers(step, support & (step > least), near, least)
    return regions_touching(target | rises, target)


def at_same_depth(found: Planes, target: BoolArray) -> BoolArray:
    """H x W, True where inverse depth differs from that of the nearest pixel of the object by no more than CONTACT_GAP."""
    here, there = found.w, found.w.ravel()[nearest_known(target & (found.w > 0))[1]]
    return np.asarray(np.abs(here - there) <= CONTACT_GAP * np.maximum(here, there))


def above_thin_layers(step: Float32Array, rising: BoolArray, near: BoolArray, least: float) -> BoolArray:
    """H x W, True where pixels rise over the plane, and over a thin layer on it (a carpet) that continues beyond `near`.

    step: H x W relative height. rising: H x W, where that is over `least`. near: H x W, where a foot may be.
    """
    count, layers = cv2.connectedComponents(rising.astype(np.uint8), connectivity=8)
    sizes, held = np.bincount(layers.ravel(), minlength=count), np.bincount(layers[near], minlength=count)
    out = rising.copy()
    layered = (held > 0) & (held < LAYER * sizes)
    for number in np.flatnonzero(layered[1:]) + 1:
        layer = layers == number
        out &= ~layer | (step > float(np.median(step[layer & ~near])) + least)
    return out


def edges_are_sharp(rgbd: RGBD, found: Planes, target: BoolArray) -> bool:
    """True if depth alone says where the object ends: no noise, and steps at its border within one pixel."""
    if found.noise:
        return False
    w, known, steps = found.w, ~rgbd.missing, []
    for axis in (0, 1):
        last = w.shape[axis] - 1
        place = np.arange(last)
        before, after = w.take(place, axis), w.take(place + 1, axis)
        inside, edge_offset = target.take(place, axis), target.take(place + 1, axis)
        border = (inside != edge_offset) & known.take(place, axis) & known.take(place + 1, axis)
        one = np.abs(before - after)[border]
        ends = [w.take(np.clip(place + by, 0, last), axis)[border] for by in (-WIDE_PX, WIDE_PX)]
        wide = np.abs(ends[0] - ends[1])
        steps.append(np.where(wide > 0.1 * np.maximum(before, after)[border], one / np.maximum(wide, 1e-9), np.nan))
    both = np.concatenate(steps)
    both = both[~np.isnan(both)]
    return bool(both.size and np.median(both) > SHARP)


def snap_to_picture_edges(rgbd: RGBD, found: Planes, target: BoolArray) -> BoolArray:
    """The mask with its border moved to the edges of the picture (GrabCut in a band) where depth leaves it open.

    Open is missing depth next to the object, and, where depth is noisy or blurred at edges, a band of BAND_PX. Thin parts, which
    the band would cover whole, keep what depth says.
    """
    missing = rgbd.missing & dilate_mask(target, HOLE_PX)
    band = missing
    if not edges_are_sharp(rgbd, found, target):
        thin = target & ~dilate_mask(morphological_open(target, disc(BAND_PX)), 1)
        band = missing | (dilate_mask(target, BAND_PX) & ~erode_mask(target, BAND_PX) & ~thin)
    band &= ~erode_mask(target, BAND_PX)
    if not band.any() or not (target & ~band).any():
        return target
    return decide_by_color(rgbd, target, band)


def find_lost_contact(found: Planes, target: BoolArray, support: BoolArray, most: float = CONTACT_PX) -> BoolArray:
    """H x W, True where what the object stands on may be its foot, which rises over it by less than planes may err by.

    That is as far along the plane, towards the camera, as inverse depth needs to grow by so much, and no farther than `most` px
    (as far as that, if it is more than CONTACT_PX).
    """
    out = np.zeros_like(target)
    under = support & dilate_mask(target, 3)
    drawn = target.astype(np.uint8)
    for number in np.unique(found.label[under]):
        slope = found.planes[number - 1][:2]
        steep, on_it = float(np.hypot(*slope)), under & (found.label == number)
        if steep <= 0 or on_it.sum() < LEAST_UNDER:
            continue
        middle = np.median(found.w[on_it], keepdims=True)
        length = most if most > CONTACT_PX else min(float(tolerance(middle, found.noise)[0]) / steep, most)
        for step in np.arange(1, length + 1):
            by = np.array([[1, 0, slope[0] / steep * step], [0, 1, slope[1] / steep * step]], np.float32)
            out |= cv2.warpAffine(drawn, by, target.shape[::-1], flags=cv2.INTER_NEAREST) > 0
    return out & ~target & (at_same_depth(found, target) | (found.w <= 0))


def decide_by_color(rgbd: RGBD, target: BoolArray, band: BoolArray, rounds: int = 2) -> BoolArray:
    """The mask with the pixels of `band` decided by GrabCut; all others stay. Colours are learnt in the surroundings only, and
    where those have more than MOST_PX, from a smaller picture of them."""
    tight = box_around(target | band, 0)
    box = larger_box(tight, 12 + (max(sides_of(tight)) - 1) // 4, target.shape)
    prior, open_ = target[box], band[box]
    state = np.where(prior, cv2.GC_FGD, cv2.GC_BGD).astype(np.uint8)
    state[open_] = np.where(prior, cv2.GC_PR_FGD, cv2.GC_PR_BGD)[open_]
    if (state == cv2.GC_BGD).sum() < 20 or (state == cv2.GC_FGD).sum() < 20:
        return target
    cv2.setRNGSeed(0)
    picture, wh = np.ascontiguousarray(rgbd.color[box]), state.shape[::-1]
    by = np.sqrt(MOST_PX / state.size)
    if by < 1:
        smaller = max(1, round(by * wh[0])), max(1, round(by * wh[1]))
        picture = np.asarray(cv2.resize(picture, smaller, interpolation=cv2.INTER_AREA), np.uint8)
        state = np.asarray(cv2.resize(state, smaller, interpolation=cv2.INTER_NEAREST), np.uint8)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(picture, state, (0, 0, 1, 1), *models, rounds, cv2.GC_INIT_WITH_MASK)
    inside = ((state == cv2.GC_FGD) | (state == cv2.GC_PR_FGD)).astype(np.float32)
    if by < 1:
        inside = np.asarray(cv2.resize(inside, wh, interpolation=cv2.INTER_LINEAR), np.float32)
    out = target.copy()
    out[box] = np.where(open_, inside > 0.5, prior)
    return out
