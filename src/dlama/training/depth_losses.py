"""Normalised inverse depth (B x 1 x H x W, 0 = infinity) in -> the depth terms of the loss, out; float32.

Each term is a mean over the pixels of one sample that count, then over the batch, so that a batch cut in two gives the same.
A plane in the world is affine in inverse depth, whatever the camera: so its gradients and normals are compared there.
"""

from __future__ import annotations

from torch import Tensor
from torch.nn.functional import avg_pool2d

SCALES = 4
TOLERANCE = 1e-3
"""Of the visibility law, relative: as the geometry's."""


def depth_l1(output: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Mean absolute difference where the truth is known (`known` is 1 there, 0 elsewhere)."""
    return _mean((output - truth).abs(), known)


def gradient_matching(output: Tensor, truth: Tensor, known: Tensor, scales: int = SCALES) -> Tensor:
    """Mean absolute gradient of the difference, on `scales` scales (Li and Snavely 2018, MegaDepth): edges stay sharp.

    A coarser scale averages 2 x 2 pixels and counts those of which all four are known.
    """
    difference, total = (output - truth) * known, output.new_zeros(())
    for scale in range(scales):
        if scale:
            difference, known = avg_pool2d(difference, 2), (avg_pool2d(known, 2) == 1).to(known.dtype)
            difference = difference * known
        if min(difference.shape[-2:]) < 2:
            break
        for axis in (-1, -2):
            total = total + _mean(difference.diff(dim=axis).abs(), _both(known, axis))
    return total / scales


def normal_consistency(output: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """1 - cosine between the normals of both as surfaces over the picture, which is one unit wide and high."""
    (along, down), (true_along, true_down) = _slopes(output), _slopes(truth)
    dot = along * true_along + down * true_down + 1
    lengths = (along.square() + down.square() + 1) * (true_along.square() + true_down.square() + 1)
    counted = _both(known, -1)[..., :-1, :] * _both(known, -2)[..., :, :-1]
    return _mean(1 - dot / lengths.sqrt(), counted)


def law_penalty(output: Tensor, limit: Tensor, hole: Tensor) -> Tensor:
    """Mean over the hole of how much nearer (in inverse depth) the output is than the visibility law allows."""
    allowed = limit.clamp(max=1e6) * (1 + TOLERANCE)  # no infinity near a gradient
    return _mean((output - allowed).relu(), hole)


def _mean(values: Tensor, weight: Tensor) -> Tensor:
    """B x 1 x H x W -> mean over pixels by weight, then over the batch; 0 for a sample without any weight."""
    counts = weight.flatten(1).sum(1)
    return ((values * weight).flatten(1).sum(1) / counts.clamp(min=1)).mean()


def _both(known: Tensor, axis: int) -> Tensor:
    """1 where a pixel and its next neighbour along the axis both count."""
    size = known.shape[axis]
    return known.narrow(axis, 0, size - 1) * known.narrow(axis, 1, size - 1)


def _slopes(depth: Tensor) -> tuple[Tensor, Tensor]:
    """B x 1 x H x W -> the two slopes, per picture's width and height, where both exist; the normal is (-a, -b, 1)."""
    height, width = depth.shape[-2:]
    return depth.diff(dim=-1)[..., :-1, :] * width, depth.diff(dim=-2)[..., :, :-1] * height
