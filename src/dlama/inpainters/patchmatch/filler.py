"""`patchmatch`: a view with holes in; the same painted with patches of the known picture, guided by MI-GAN, out.

The network gives the structure, the picture its texture: nothing is painted that the picture does not show somewhere.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.geometry.holes import box_around, shrink_known, smaller_size
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Paint, Painter
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.opencv import telea
from dlama.inpainters.patchmatch.completion import complete_picture
from dlama.inpainters.spreading import spread_by_two, spread_small
from dlama.models.network_file import make_room

GUESS_SIDE = 768
"""Longer side in pixels of the picture that the painter sees: detail comes from patches."""
DIFFERS = 26.0
"""Levels by which patches differ from their guess where the mean of both is taken."""
DISTANCE = 10.0
"""Levels added to the distances from the smooth estimate by which patches and a network's guess are weighed."""
BLEND_PX = 3
"""Sigma in pixels over which differences are averaged: texture of one kind is no difference."""
SPREAD_SIDE = 256
"""Longer side in pixels in which the smooth estimate is made."""


def guess_coarsely(paint: Paint, picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
    """H x W x 3: the picture (H x W x 3 RGB) with its hole (H x W) as painted at GUESS_SIDE pixels at most."""
    height, width = hole.shape
    if max(height, width) <= GUESS_SIDE:
        return paint(picture, hole, seed)
    means, share = shrink_known(picture, ~hole, smaller_size(hole.shape, GUESS_SIDE))
    small = np.clip(np.round(means), 0, 255).astype(np.uint8)
    painted = cv2.resize(paint(small, share < 0.5, seed), (width, height), interpolation=cv2.INTER_CUBIC)
    make_room(hole.size)
    return np.where(hole[..., None], painted, picture)


def blend_with_guess(
    painted: UInt8Array, guess: UInt8Array, hole: BoolArray, unknown: BoolArray | None = None
) -> UInt8Array:
    """H x W x 3: the painted hole, and its mean with the guess where the two differ: each errs elsewhere.

    painted, guess: H x W x 3; hole: H x W; unknown: H x W, the pixels that a network has guessed. Given those, the one of the two
    that is nearer to colours spread from the known pixels weighs more: a network may invent an object. Detail finer than
    GUESS_SIDE pixels stays that of the painted picture.
    """
    box = box_around(hole, 3 * BLEND_PX)
    height, width = hole[box].shape
    by = min(1.0, GUESS_SIDE / max(hole.shape))
    size = max(1, round(width * by)), max(1, round(height * by))
    first, second = (shrink(colors[box], size) for colors in (painted, guess))
    share = np.minimum(blurred_difference(second, first) / DIFFERS, 1)
    if unknown is None:
        share *= 0.5
    else:
        known, part = shrink_known(painted[box], ~unknown[box], size)
        smooth = spread_small(known, part >= 0.5, spread_by_two, SPREAD_SIDE)
        mine, others = (DISTANCE + blurred_difference(colors, smooth) for colors in (first, second))
        share *= mine / (mine + others)
    step = (second - first) * share[..., None]
    out = painted.copy()
    there = hole[box]
    blended = painted[box] + cv2.resize(step, (width, height), interpolation=cv2.INTER_LINEAR)
    out[box][there] = np.clip(np.round(blended[there]), 0, 255)
    return out


def shrink(picture: UInt8Array, wh: tuple[int, int]) -> Float32Array:
    """A picture at a size (width, height) that is no larger than its own."""
    return np.asarray(cv2.resize(picture.astype(np.float32), wh, interpolation=cv2.INTER_AREA), np.float32)


def blurred_difference(first: Float32Array, second: Float32Array) -> Float32Array:
    """H x W: difference of two pictures (H x W x 3), averaged over BLEND_PX, mean over the channels of its size."""
    return np.asarray(np.abs(cv2.GaussianBlur(first - second, (0, 0), BLEND_PX)).mean(2), np.float32)


def patchmatch_filler(model: str | Path) -> Painter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        return Fill(paint(view.color, view.color_hole, seed), telea(view, context, seed).depth, notes=notes())

    def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        if not hole.any():
            return picture
        guess = guess_coarsely(network.paint, picture, hole, seed)
        return blend_with_guess(complete_picture(picture, hole, guess, seed, guided=True), guess, hole)

    def notes() -> dict[str, Any]:
        return {"guess": network.notes()}

    return Painter(fill, paint, notes)
