"""Planes of output and truth, B x P x H x W in 0..1, in -> the loss terms that need no network, out; float32 or better.

Depth is normalised inverse depth (0 = infinity). Its terms are means over the pixels of one sample that count, then over the
batch, so that the two halves of a batch give the mean of the whole. A plane in the world is affine in inverse depth, for every
camera: so gradients and normals are compared there.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, l1_loss

SCALES = 4
"""Of gradient matching; each has half the resolution of the one before."""
TOLERANCE = 1e-3
"""Relative tolerance of the visibility law, that of `geometry.kernels.visibility.tolerance` beyond 1 m."""


def widen_half(x: Tensor) -> Tensor:
    """Half precision widened to float32; float32 and float64 as they are. Differences and sums are not taken in bfloat16."""
    return x.float() if x.dtype in (torch.bfloat16, torch.float16) else x


def masked_l1(output: Tensor, truth: Tensor, weight: Tensor) -> Tensor:
    """Mean over all pixels of weight x |output - truth|, as published: the sum of weights is not divided out."""
    return (weight * l1_loss(output, truth, reduction="none")).mean()


def depth_l1(output: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Mean absolute difference where the truth is known (`known` is 1 there, 0 elsewhere)."""
    return _mean((output - truth).abs(), known)


def gradient_matching(output: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Mean absolute gradient of the difference, on SCALES scales (Li and Snavely 2018, MegaDepth): edges stay sharp.

    A coarser scale averages 2 x 2 pixels and counts those of which all four are known.
    """
    difference, total = (output - truth) * known, output.new_zeros(())
    for scale in range(SCALES):
        if scale:
            difference, known = avg_pool2d(difference, 2), (avg_pool2d(known, 2) == 1).to(known.dtype)
            difference = difference * known
        if min(difference.shape[-2:]) < 2:
            break
        for axis in (-1, -2):
            total = total + _mean(difference.diff(dim=axis).abs(), _both_known(known, axis))
    return total / SCALES


def normal_consistency(output: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Mean of 1 - cosine between the normals of both as surfaces over the picture, which is one unit wide and high."""
    (along, down), (true_along, true_down) = _slopes(output), _slopes(truth)
    dot = along * true_along + down * true_down + 1
    lengths = (along.square() + down.square() + 1) * (true_along.square() + true_down.square() + 1)
    counted = _both_known(known, -1)[..., :-1, :] * _both_known(known, -2)[..., :, :-1]
    return _mean(1 - dot / lengths.sqrt(), counted)


def law_penalty(output: Tensor, limit: Tensor, hole: Tensor) -> Tensor:
    """Mean over the hole of the inverse depth by which the output is nearer than the visibility law allows.

    limit: largest lawful inverse depth, inf where anything is lawful; hole: 1 = filled. B x 1 x H x W all.
    """
    allowed = limit.clamp(max=1e6) * (1 + TOLERANCE)  # no infinity near a gradient
    return _mean((output - allowed).relu(), hole)


def _mean(values: Tensor, weight: Tensor) -> Tensor:
    """B x 1 x H x W -> mean over pixels by weight, then over the batch; 0 for a sample without any weight."""
    counts = weight.flatten(1).sum(1)
    return ((values * weight).flatten(1).sum(1) / counts.clamp(min=1)).mean()


def _both_known(known: Tensor, axis: int) -> Tensor:
    """1 where a pixel and its next neighbour along the axis both count."""
    size = known.shape[axis]
    return known.narrow(axis, 0, size - 1) * known.narrow(axis, 1, size - 1)


def _slopes(depth: Tensor) -> tuple[Tensor, Tensor]:
    """B x 1 x H x W -> the two slopes, per picture's width and height, where both exist; the normal is (-a, -b, 1)."""
    height, width = depth.shape[-2:]
    return depth.diff(dim=-1)[..., :-1, :] * width, depth.diff(dim=-2)[..., :, :-1] * height
