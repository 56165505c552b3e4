"""A mask found in depth in; out comes the mask with its ground contact, which plane fitting removed, and a border on picture
edges."""

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

CONTACT_PX = 12
"""How far from the object its ground contact may reach over the supporting plane."""
CONTACT_GAP = 0.08
"""Largest relative difference from the object's depth there: a wall far behind is no ground contact."""
CONTACT_NOISE = 5.0
"""Least height of a ground contact over the plane, in standard deviations of the plane's unevenness,"""
CONTACT_STEP = 0.0012
"""and as a relative step in inverse depth."""
LAYER = 0.5
"""Raised pixels are a layer on the plane (a carpet) if less than this share of them is near the object."""
SHARP = 0.7
"""Least share of a depth step that lies within one pixel at a sharp edge."""
WIDE_PX = 4
"""Pixels to either side of an edge that contain the whole step."""
BAND_PX = 3
"""Half width in px of the band in which colour decides, where depth is noisy, blurred or missing."""
HOLE_PX = 12
"""Pixels by which a mask may grow into missing depth."""
MOST_PX = 1_000_000
"""Most pixels from which GrabCut learns colours; its time is proportional to them."""


def add_ground_contact(found: Planes, support: BoolArray, target: BoolArray) -> BoolArray:
    """The object and its ground contact: connected pixels of the supporting plane that rise a little over it."""
    near = dilate_mask(target, CONTACT_PX) & support & at_same_depth(found, target)
    if not near.any():
        return target
    step = height_above(found, support)
    around = dilate_mask(target, 4 * CONTACT_PX) & support
    unevenness = 1.4826 * float(np.median(np.abs(step[around])))
    least = max(CONTACT_STEP, CONTACT_NOISE * unevenness)
    rises = near & above_thin_layers(step, support & (step > least), near, least)
    return regions_touching(target | rises, target)


def at_same_depth(found: Planes, target: BoolArray, gap: float = CONTACT_GAP) -> BoolArray:
    """H x W, True where inverse depth differs from that of the nearest pixel of the object by no more than `gap`, relative."""
    here, there = found.w, found.w.ravel()[nearest_known(target & (found.w > 0))[1]]
    return np.asarray(np.abs(here - there) <= gap * np.maximum(here, there))


def above_thin_layers(step: Float32Array, rising: BoolArray, near: BoolArray, least: float) -> BoolArray:
    """H x W, True where pixels rise over the plane and over any thin layer (a carpet) that extends beyond `near`.

    step: H x W relative height. rising: H x W, height above `least`. near: H x W, possible ground contact.
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
    """True if depth alone defines the object's border: no noise, and depth steps within one pixel."""
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
    """The mask with its border on the picture's edges (GrabCut in a band) where depth is ambiguous.

    Ambiguous are missing depth next to the object and, where depth is noisy or blurred, a band of BAND_PX. Parts thinner than
    the band keep their depth border.
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


def decide_by_color(rgbd: RGBD, target: BoolArray, band: BoolArray, rounds: int = 2) -> BoolArray:
    """The mask with the pixels of `band` decided by GrabCut; all others stay. Colours are learnt in the surroundings only, and
    above MOST_PX pixels from a smaller picture."""
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
