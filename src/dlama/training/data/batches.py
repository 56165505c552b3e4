"""What a sample and a batch are, which sources make and losses read; samples in -> checked, out.

Values of pictures and of depth are 0..1. Depth is inverse depth on the scale of the filler `joint`, which is one of the view
(`view_tensors.robust_scale`): 0 = infinity, 0.75 = what 99 % of the known pixels do not exceed, 1 at most; so networks are given
no metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

import numpy as np
import torch
from torch import Tensor

from dlama.errors import ShapeError
from dlama.training.settings import NetworkSettings

Sample = Mapping[str, np.ndarray]
"""One sample: the keys of Batch without the leading B, float32."""


class Batch(TypedDict, total=False):
    """Tensors float32. `known_depth` and `limit` only where depth is a plane (rgbd)."""

    input: Tensor
    """B x C x H x W: the target with the hole zeroed (each view of two masks by its own), then the mask plane(s)."""
    target: Tensor
    """B x P x H x W: the truth, 0..1."""
    mask: Tensor
    """B x M x H x W: 1 = hole; M is 2 for stereo-two-masks (left, right), else 1. The last planes of `input`."""
    known_depth: Tensor
    """B x 1 x H x W: 1 where the target's depth is true, 0 where no truth is known."""
    limit: Tensor
    """B x 1 x H x W: the visibility law; normalised inverse depth must not be larger than this, +inf where anything goes."""


def keys_of(network: NetworkSettings) -> dict[str, int]:
    """Key of Batch -> number of planes, for samples of such a network."""
    expected = {"input": network.kind.inputs, "target": network.kind.outputs, "mask": network.kind.masks}
    return expected | ({"known_depth": 1, "limit": 1} if network.kind.has_depth else {})


def check_sample(sample: Sample, network: NetworkSettings, size: int) -> None:
    """ShapeError naming the first key that is missing, is no float32 array of `size` x `size` pixels, is out of range, or shows
    pixels of the hole."""
    for key, planes in keys_of(network).items():
        if key not in sample:
            raise ShapeError(f"sample: no {key!r}; it has {', '.join(sample)}")
        _check_planes(key, sample[key], (planes, size, size))
    mask = sample["mask"]
    if not ((mask == 0) | (mask == 1)).all() or not 0 < mask.mean() < 1:
        raise ShapeError("sample: mask must be 0 or 1, and neither empty nor full")
    hidden = mask.repeat(len(sample["target"]) // len(mask), 0)
    if not np.array_equal(sample["input"][-len(mask) :], mask) or (sample["input"][: len(hidden)] * hidden).any():
        raise ShapeError("sample: input must end with the mask and be zero in the hole")


def _check_planes(key: str, array: np.ndarray, expected: tuple[int, int, int]) -> None:
    if array.shape != expected or array.dtype != np.float32:
        raise ShapeError(f"sample: {key} is {array.dtype} {array.shape}; float32 {expected} is expected")
    low, high = float(array.min()), float(array.max())
    if not (low >= 0 and (high <= 1 or key == "limit")):
        raise ShapeError(f"sample: {key} is between {low} and {high}; 0 to 1 is expected")


def hole_planes(mask: Tensor, planes: int) -> Tensor:
    """B x M x H x W masks -> B x planes x H x W: each plane with the mask of its view."""
    return mask.repeat_interleave(planes // mask.shape[1], dim=1)


def composite(output: Tensor, batch: Batch) -> Tensor:
    """The output (B x P x H x W) in the hole, the truth elsewhere."""
    hole = hole_planes(batch["mask"], output.shape[1])
    return torch.lerp(batch["target"], output, hole)


def pictures(planes: Tensor, network: NetworkSettings) -> Tensor:
    """B x P x H x W planes -> their colour pictures, (views B) x 3 x H x W: all left ones, then all right ones."""
    return torch.cat([planes[:, 3 * view : 3 * view + 3] for view in range(network.kind.views)])
