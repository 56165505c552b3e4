"""`patchmatch`: a view with holes in; the same painted with patches of the known picture, guided by MI-GAN, out.

The network gives the structure and most of what is painted, in a picture of GUESS_SIDE pixels at most; finer detail is copied
from the picture.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from dlama.geometry.holes import box_around, gaussian_mean, shrink_known, smaller_size
from dlama.geometry.kernels.enlarging import enlarge_at
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, replace_pixels
from dlama.inpainters.filling import Paint, Painter
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.opencv import spread_small, with_diffused_depth
from dlama.inpainters.patchmatch.completion import complete_picture
from dlama.models.network_file import make_room
from dlama.perception.resampling import shrink_color

GUESS_SIDE = 768
"""Longer side in pixels of the picture that the painter sees: detail comes from patches."""
DIFFERS, NETWORK_DIFFERS = 26.0, 12.0
"""Levels by which patches differ from a smooth guess, and from a network's, where the mean of both is taken."""
AGREE = 3.0
"""Levels by which the patches over a pixel differ from each other where a network's guess weighs half of that: those of a regular
pattern agree, and know more than the network."""
DISTANCE = 10.0
"""Levels added to the distances from the smooth estimate by which patches and a network's guess are weighed."""
BLEND_PX = 3
"""Sigma in pixels over which differences are averaged: texture of one kind is no difference."""


def guess_coarsely(paint: Paint, picture: UInt8Array, hole: BoolArray, seed: int, side: int = GUESS_SIDE) -> UInt8Array:
    """H x W x 3: the picture (H x W x 3 RGB) with its hole (H x W) as painted at `side` pixels at most."""
    height, width = hole.shape
    if max(height, width) <= side:
        return paint(picture, hole, seed)
    means, share = shrink_known(picture, ~hole, smaller_size(hole.shape, side))
    small = np.clip(np.round(means), 0, 255).astype(np.uint8)
    painted = cv2.resize(paint(small, share < 0.5, seed), (width, height), interpolation=cv2.INTER_CUBIC)
    make_room(hole.size)
    return replace_pixels(picture, hole, painted)


def blend_with_guess(
    painted: UInt8Array,
    guess: UInt8Array,
    hole: BoolArray,
    unknown: BoolArray | None = None,
    *,
    spread: Float32Array | None = None,
    guess_share: float | None = None,
) -> UInt8Array:
    """H x W x 3: the painted hole, and its mean with the guess where the two differ: each errs elsewhere.

    painted, guess: H x W x 3; hole: H x W; unknown: H x W, the pixels that a network has guessed. Given those, the guess replaces
    what is painted where the two differ, and weighs less the farther it is from colours spread from the known pixels: a network
    may invent an object. spread: H x W, of `complete_picture`: where patches agree they weigh more. guess_share: the weight of
    the guess, everywhere the same.
    Detail finer than GUESS_SIDE pixels stays that of the painted picture.
    """
    box = box_around(hole, 3 * BLEND_PX)
    there = hole[box]
    height, width = there.shape
    by = min(1.0, GUESS_SIDE / max(hole.shape))
    size = max(1, round(width * by)), max(1, round(height * by))
    first, second = (shrink_color(colors[box], size[::-1]).astype(np.float32) for colors in (painted, guess))
    if guess_share is not None:
        share = np.full(size[::-1], guess_share, np.float32)
    else:
        smooth = None
        if unknown is not None:
            small, known = shrink_known(painted[box], ~unknown[box], size)
            smooth = spread_small(small, known >= 0.5)
        share = weigh_guess(first, second, smooth)
    if spread is not None:
        mean = gaussian_mean(spread[box], there, BLEND_PX, 1e-3) ** 2
        share *= cv2.resize(mean / (mean + AGREE**2), size, interpolation=cv2.INTER_AREA)
    step = enlarge_at(
        (second - first) * share[..., None], np.flatnonzero(there), width, (height / size[1], width / size[0])
    )
    out = painted.copy()
    step += painted[box][there]
    out[box][there] = np.clip(np.rint(step, out=step), 0, 255, out=step)
    return out


def weigh_guess(painted: Float32Array, guess: Float32Array, smooth: Float32Array | None) -> Float32Array:
    """h x w weights of a guess (h x w x 3) in what is painted: half where the two differ; a network's guess replaces what is
    painted there, but for a mean where it is farther from `smooth`, the colours that are spread from the known pixels."""
    if smooth is None:
        return np.float32(0.5) * np.minimum(blurred_difference(guess, painted) / DIFFERS, 1)
    mine, others = (DISTANCE + blurred_difference(colors, smooth) for colors in (painted, guess))
    return np.minimum(blurred_difference(guess, painted) / NETWORK_DIFFERS, 1) * np.minimum(mine / others, 1)


def blurred_difference(first: Float32Array, second: Float32Array) -> Float32Array:
    """H x W: difference of two pictures (H x W x 3), averaged over BLEND_PX, mean over the channels of its size."""
    return np.asarray(np.abs(cv2.GaussianBlur(first - second, (0, 0), BLEND_PX)).mean(2), np.float32)


def patchmatch_filler(model: str | Path) -> Painter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)

    def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        if not hole.any():
            return picture
        guess = guess_coarsely(network.paint, picture, hole, seed)
        painted = complete_picture(guess, hole, seed)[0]
        # against the mean where the two differ, photos seen from another place have LPIPS -4 % at .5 and -5 % at .7
        return blend_with_guess(painted, guess, hole, guess_share=0.6)

    return with_diffused_depth(paint, lambda: {"guess": network.notes()})
