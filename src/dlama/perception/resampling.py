"""A picture with depth, or a depth map smaller than its picture, in; the same at another size out.

Enlarged depth has its edges where the picture has them. After Kopf et al., "Joint Bilateral Upsampling" (2007): near map pixels
of like colour count. But surfaces are never mixed: a pixel lies on the surface of one of the four map pixels round it, and is
interpolated among those of them that lie on it. Map pixels that the sensor mixed of two surfaces are missing depth.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from dlama.geometry.holes import square
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.kernels.joint_filters import upsample_joined

JUMP = 0.1
"""Relative step of inverse depth up to which neighbours of the map lie on one surface,"""
BEND, STEEP = 0.06, 0.35
"""and, on a slanted one, up to which steps differ that follow each other, and the largest of them."""
COLOR_SIGMA = 20.0
"""Levels by which colours differ on one surface (each channel)."""
LEAST_NEAR = 0.15
"""Added to the bilinear weights of the four, so that the farthest may be chosen for its colour."""


def nearest_pixels(values: np.ndarray, hw: tuple[int, ...]) -> np.ndarray:
    """H x W values brought to another size, each from the nearest pixel."""
    rows, columns = (((np.arange(n) + 0.5) * old / n).astype(np.intp) for n, old in zip(hw, values.shape))
    return np.ascontiguousarray(values[rows[:, None], columns])


def interpolate(values: np.ndarray, hw: tuple[int, ...]) -> Float32Array:
    """H x W: a map at another height and width, bilinear between its pixels; itself at its own."""
    values = np.ascontiguousarray(values, np.float32)
    return values if values.shape == tuple(hw[:2]) else np.asarray(cv2.resize(values, (hw[1], hw[0])), np.float32)


def shrink_color(color: UInt8Array, hw: tuple[int, ...]) -> UInt8Array:
    """H x W x 3 at the size hw, by area means."""
    if color.shape[:2] == tuple(hw):
        return color
    return np.asarray(cv2.resize(color, (hw[1], hw[0]), interpolation=cv2.INTER_AREA), np.uint8)


def shrink_rgbd(rgbd: RGBD, wh: tuple[int, int]) -> RGBD:
    """The picture at a smaller size (width, height): area means of its colours; each depth is that of a pixel, never a mean."""
    hw = wh[::-1]
    padding = None if rgbd.padding is None else nearest_pixels(rgbd.padding, hw)
    color, depth = shrink_color(rgbd.color, hw), nearest_pixels(rgbd.depth, hw)
    return dataclasses.replace(rgbd, color=color, depth=depth, camera=rgbd.camera.resized(*wh), padding=padding)


def smooth_quantised(levels: Float32Array) -> Float32Array:
    """H x W 8-bit levels of inverse depth smoothed within half a step, so that slopes are slopes again and edges stay; level 0
    stays 0 (far)."""
    smooth = np.asarray(cv2.GaussianBlur(levels, (0, 0), 3.0), np.float32)
    return np.where(levels > 0, np.clip(smooth, levels - 0.5, levels + 0.5), np.float32(0))


def upsample_depth(depth: Float32Array, color: UInt8Array) -> Float32Array:
    """H x W metres (0 = missing, inf = far): depth at the size of its picture, where that is larger.

    depth: h x w metres; color: H x W x 3 RGB, of the same field of view. What is nearest to a missing or mixed pixel is missing.
    """
    depth = np.where(is_mixed(depth), np.float32(0), depth)
    known, far = depth > 0, depth == np.inf
    w = np.where(known, inverse_depth(depth), np.float32(-1))
    joined = RIGHT * joined_along(w, known, far) + DOWN * joined_along(w.T, known.T, far.T).T
    small = shrink_color(color, depth.shape)
    unlike = np.arange(min(3 * 255**2, 40 * COLOR_SIGMA**2) + 1, dtype=np.float32)
    alike = (np.exp(-unlike / (6 * COLOR_SIGMA**2)) + 1e-3).astype(np.float32)
    out, room = np.empty(color.shape[:2], np.float32), np.empty((len(color), 2, 4), np.float32)
    in_bands(upsample_joined, len(out), w, joined, small, color, alike, LEAST_NEAR, room, out)
    return out


def is_mixed(depth: Float32Array) -> BoolArray:
    """h x w, True in pixels of a map (h x w metres, 0 = missing) between a nearer and a farther neighbour, on neither surface;
    False at its border."""
    known = depth > 0
    w = np.where(known, inverse_depth(depth), np.float32(0))
    nearest, nearest_around = cv2.dilate(w, square(3)), cv2.dilate(w, square(7))
    least = np.where(known, w, nearest_around)
    farthest, around = cv2.erode(least, square(3)), nearest_around - cv2.erode(least, square(7))
    between = (nearest - w > 0.04 * nearest) & (w - farthest > 0.04 * nearest)
    out = np.zeros_like(known)
    inside = np.s_[2:-2, 2:-2]
    # on a slanted surface the change within 7 x 7 pixels is up to three times that within 3 x 3
    out[inside] = (known & between & (around < 2.2 * (nearest - farthest)))[inside]
    return out


def joined_along(w: Float32Array, known: BoolArray, far: BoolArray) -> UInt8Array:
    """h x w, 1 where a map's pixel lies on one surface with the next one of its row. w: h x w inverse depth."""
    step = np.diff(w, axis=1)
    largest = np.maximum(w[:, :-1], w[:, 1:])
    near = known & ~far
    both = near[:, :-1] & near[:, 1:]
    steps, there = np.pad(step, ((0, 0), (1, 1))), np.pad(both, ((0, 0), (1, 1)))
    straight = np.zeros_like(both)
    for neighbour in (np.s_[:, :-2], np.s_[:, 2:]):
        straight |= there[neighbour] & (np.abs(step - steps[neighbour]) <= BEND * largest)
    size = np.abs(step)
    on_surface = both & ((size <= JUMP * largest) | (straight & (size <= STEEP * largest)))
    out = np.zeros(w.shape, np.uint8)
    out[:, :-1] = on_surface | (far[:, :-1] & far[:, 1:])
    return out
