"""Guesses and a verdict on them in; the mixed colours, and the number of the guess whose depth is taken, out.

Colours are mixed in two bands, the base (low frequencies) and the detail (the rest). Where guesses disagree, their mean colour
errs least, and the detail of one of them still shows texture. Depth is never mixed: the mean of two surfaces is none.
`nets.judge` does the same on tensors, for training.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.choice.judge import STRIDE
from dlama.inpainters.networks.view_tensors import levels_of

BASE_KERNEL = (0.054489, 0.244201, 0.402620, 0.244201, 0.054489)
"""A Gaussian of sigma 1 over the means of STRIDE x STRIDE pixels."""
REGION = 4.0
"""Sigma, in pixels of the judge's planes, of the blur that makes the choice of depth regional."""
CONFIDENT = 0.97
"""Weight from which a depth other than the hole's favourite is taken. Without it depth was worse than that of continued
surfaces alone: 2 % on street and 8 % on kitchen_vpi in mean error."""


def mix_colors(
    colors: Sequence[UInt8Array], seen: Float32Array, base: Float32Array, detail: Float32Array, seen_hw: tuple[int, int]
) -> UInt8Array:
    """H x W x 3 colours.

    Args:
        colors: of K guesses, H x W x 3.
        seen: K x 3 x h x w in 0..1, the same as the judge saw them: padded, and smaller where the view is large.
        base, detail: the verdict's logits.
        seen_hw: height and width of what the judge saw, without padding.
    """
    bases = [shrink_to_base(one.transpose(1, 2, 0)) for one in seen]
    weights = softmax(base)
    hw = colors[0].shape[:2]
    mixture = resize_to_view(sum(w[..., None] * one for w, one in zip(weights, bases)), seen_hw, hw)
    for weight, color, one in zip(softmax(enlarge_maps(detail)), colors, bases):
        mixture += crop_and_resize(weight, seen_hw, hw)[..., None] * (
            color / np.float32(255) - resize_to_view(one, seen_hw, hw)
        )
    return levels_of(mixture)


def shrink_to_base(picture: Float32Array) -> Float32Array:
    """h x w x 3 -> h/4 x w/4 x 3: means of STRIDE x STRIDE pixels under BASE_KERNEL."""
    size = picture.shape[1] // STRIDE, picture.shape[0] // STRIDE
    small = cv2.resize(np.ascontiguousarray(picture), size, interpolation=cv2.INTER_AREA)
    kernel = np.array(BASE_KERNEL, np.float32)
    return np.asarray(cv2.sepFilter2D(small, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REPLICATE), np.float32)


def choose_depth(
    depth: Float32Array, inverse_depths: Sequence[Float32Array], hole: BoolArray, seen_hw: tuple[int, int]
) -> NDArray[np.intp]:
    """H x W numbers of the guesses whose depth is taken; depth: the verdict's logits, hole: H x W.

    Guesses of equal depth count together, under the number of the first.
    """
    if not hole.any():
        return np.zeros(hole.shape, np.intp)
    votes = [crop_and_resize(one, seen_hw, hole.shape) for one in softmax(enlarge_maps(depth))]
    first = [
        next(j for j, other in enumerate(inverse_depths) if other is one or np.array_equal(other, one))
        for one in inverse_depths
    ]
    sigma = REGION * max(hole.shape) / max(seen_hw)
    share = np.maximum(cv2.GaussianBlur(hole.astype(np.float32), (0, 0), sigma), 1e-6)
    together = np.zeros((len(votes), *hole.shape), np.float32)
    for vote, number in zip(votes, first):
        together[number] += cv2.GaussianBlur(vote * hole, (0, 0), sigma) / share
    most = int(np.argmax([one[hole].mean() for one in together]))
    return np.where(together.max(0) > CONFIDENT, together.argmax(0), most)


def enlarge_maps(maps: Float32Array) -> Float32Array:
    """K x h/4 x w/4 -> K x h x w, bilinear."""
    size = STRIDE * maps.shape[2], STRIDE * maps.shape[1]
    return np.stack([cv2.resize(one, size, interpolation=cv2.INTER_LINEAR) for one in maps])


def resize_to_view(small: Float32Array, seen_hw: tuple[int, int], hw: tuple[int, int]) -> Float32Array:
    """A map at a STRIDE-th of the padded planes (h/4 x w/4 x 3) in the view's size, H x W x 3."""
    size = STRIDE * small.shape[1], STRIDE * small.shape[0]
    return crop_and_resize(np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_LINEAR)), seen_hw, hw)


def crop_and_resize(seen: Float32Array, seen_hw: tuple[int, int], hw: tuple[int, int]) -> Float32Array:
    """A map in the size of the padded planes (h x w or h x w x 3) in the view's size."""
    inner = seen[: seen_hw[0], : seen_hw[1]]
    if seen_hw == tuple(hw):
        return np.array(inner, np.float32)
    return np.asarray(cv2.resize(inner, (hw[1], hw[0]), interpolation=cv2.INTER_LINEAR), np.float32)


def softmax(logits: Float32Array) -> Float32Array:
    """K x ... -> weights that add up to 1 over K."""
    raised = np.exp(logits - logits.max(0))
    return np.asarray(raised / raised.sum(0), np.float32)
