"""Candidate pixels of an object in a frame in; those in front of the background, grown into one object, out."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.holes import box_around, dilate_mask, nearest_known, shrink_known, square
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.view import View


def find_foreground(frame: View, candidates: BoolArray) -> BoolArray:
    """The candidates (H x W) nearer than the background, which is interpolated from the other pixels around them.

    Planes are linear in inverse depth, so the background is harmonic in it. What is in front of the nearest candidate
    is no background.
    """
    out = np.zeros_like(candidates)
    if not candidates.any():
        return out
    part = box_around(candidates, 12)  # the surroundings define the background
    inverse = inverse_depth(frame.known_depth)[part]
    known = (frame.valid | frame.far)[part] & ~dilate_mask(candidates[part], 1)
    _, nearest = nearest_known(candidates[part])
    known &= inverse <= (1 + AGREES) * inverse.ravel()[nearest]
    out[part] = candidates[part] & (inverse > 1.02 * interpolate_harmonic(inverse, known))
    return out


def interpolate_harmonic(values: Float32Array, known: BoolArray) -> Float32Array:
    """H x W, the known values and their harmonic interpolation: relaxation after a coarse-to-fine start."""
    found = fill_from_coarse(values, known)
    for _ in range(300):
        edged = cv2.copyMakeBorder(found, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
        around = edged[:-2, 1:-1] + edged[2:, 1:-1] + edged[1:-1, :-2] + edged[1:-1, 2:]
        found = np.where(known, values, around / 4)
    return found


def fill_from_coarse(values: Float32Array, known: BoolArray) -> Float32Array:
    """The known values; elsewhere means of known ones over the smallest neighbourhood that has any."""
    if known.all() or min(values.shape) <= 2:
        mean = values[known].mean() if known.any() else 0.0
        return np.where(known, values, np.float32(mean))
    height, width = values.shape
    size = (width + 1) // 2, (height + 1) // 2
    means, share = shrink_known(values, known, size)
    coarse = fill_from_coarse(means[..., 0], share > 0)
    return np.where(known, values, cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR))


def grow_region(seeds: BoolArray, allowed: BoolArray, depth: Float32Array) -> BoolArray:
    """The seeds and all allowed pixels that are one object with them: from each to the next 2 px and 5 % of the depth."""
    found, kernel = seeds.copy(), square(5)
    while True:
        nearest = cv2.erode(np.where(found, depth, np.float32(np.inf)), kernel)
        farthest = cv2.dilate(np.where(found, depth, np.float32(0)), kernel)
        new = allowed & ~found & (depth >= nearest * 0.95) & (depth <= farthest * 1.05)
        if not new.any():
            return found
        found |= new
