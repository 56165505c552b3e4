"""An output and its batch in -> how good the hole is, as numbers, out: the learning curve.

Means over the hole of each sample, then over the samples. Colour is 0..1; depth is normalised inverse depth (see `batches`).
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, pad

from dlama.training.data.batches import Batch, composited, hole_planes
from dlama.training.depth_losses import TOLERANCE
from dlama.training.settings import NetworkSettings

SSIM_WINDOW = 7
TELEA_RADIUS = 3


def metric_names(network: NetworkSettings) -> list[str]:
    """What `hole_metrics` gives for such a network."""
    return ["color_l1", "color_psnr", "color_ssim", *(["depth_l1", "law_broken"] if network.has_depth else [])]


@torch.no_grad()
def hole_metrics(output: Tensor, batch: Batch, network: NetworkSettings) -> dict[str, float]:
    """color_l1; color_psnr (dB, of the hole's mean squared error); color_ssim (uniform 7 x 7 windows); for depth:
    depth_l1 where the truth is known, law_broken: share of the hole that is nearer than allowed."""
    filled, colors = composited(output.float(), batch), 3 * network.views
    mine, true, hole = filled[:, :colors], batch["target"][:, :colors], hole_planes(batch["mask"], colors)
    squared = _in(hole, (mine - true).square())
    found = {
        "color_l1": _in(hole, (mine - true).abs()),
        "color_psnr": -10 * squared.clamp(min=1e-10).log10(),
        "color_ssim": _in(hole, ssim_map(mine, true)),
    }
    if network.has_depth:
        depth, truth = filled[:, -1:], batch["target"][:, -1:]
        found["depth_l1"] = _in(batch["mask"] * batch["known_depth"], (depth - truth).abs())
        nearer = (depth > batch["limit"] * (1 + TOLERANCE)).float()
        found["law_broken"] = _in(batch["mask"], nearer)
    return {name: float(values.mean()) for name, values in found.items()}


def ssim_map(a: Tensor, b: Tensor) -> Tensor:
    """SSIM of each pixel's window (Wang et al. 2004, uniform weights, data range 1); B x P x H x W, borders reflected."""
    reach = SSIM_WINDOW // 2
    both = [pad(one, (reach,) * 4, mode="reflect") for one in (a, b)]

    def mean(x: Tensor) -> Tensor:
        return avg_pool2d(x, SSIM_WINDOW, 1)

    mean_a, mean_b = (mean(one) for one in both)
    var_a, var_b = (mean(one * one) - m * m for one, m in zip(both, (mean_a, mean_b)))
    shared = mean(both[0] * both[1]) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    top = (2 * mean_a * mean_b + c1) * (2 * shared + c2)
    return top / ((mean_a.square() + mean_b.square() + c1) * (var_a + var_b + c2))


def telea(batch: Batch) -> Tensor:
    """What OpenCV's Telea makes of the same input (colour in 8 bit, depth in 16), B x P x H x W: something to beat."""
    import cv2

    planes = batch["target"].shape[1]
    known = (batch["target"] * (1 - hole_planes(batch["mask"], planes))).cpu().numpy()
    holes = hole_planes(batch["mask"], planes).cpu().numpy().astype(np.uint8)
    filled = np.empty_like(known)
    for i, sample in enumerate(known):
        for first in range(0, planes - 2, 3):
            color = np.round(sample[first : first + 3].transpose(1, 2, 0) * 255).astype(np.uint8)
            out = cv2.inpaint(np.ascontiguousarray(color), holes[i, first], TELEA_RADIUS, cv2.INPAINT_TELEA)
            filled[i, first : first + 3] = out.transpose(2, 0, 1) / np.float32(255)
        if planes % 3:
            levels = np.round(sample[-1] * 65535).astype(np.uint16)
            out = cv2.inpaint(levels, holes[i, -1], TELEA_RADIUS, cv2.INPAINT_TELEA)
            filled[i, -1] = out / np.float32(65535)
    return torch.from_numpy(filled).to(batch["target"].device)


def _in(weight: Tensor, values: Tensor) -> Tensor:
    """B x P x H x W -> B means over the weighted pixels."""
    return (values * weight).flatten(1).sum(1) / weight.flatten(1).sum(1).clamp(min=1)
