"""A view with holes and its truth in -> a sample with the input that the filler `joint` would give its network, out; a pair of
pictures in -> a sample with the input of the filler `pair`, out.

**Known pixels of the target.** The view's colours are warped: blurred by resampling and, after noise, wrong at edges; the truth
is the frame of a camera there. Where both agree (depth within DEPTH_AGREES, colour within COLOR_AGREES levels, at MOST of the
known pixels), the whole target is the true frame: then the terms on known pixels teach the network to clean up its input, and
the real pictures of the discriminator have no seam of sharpness around the hole. Where they do not agree (another exposure, poses
that are off), the target's known pixels are those of the view, since the true ones cannot be computed from the input.
**The limit of the law.** What is lawful along a ray is no single stretch: in front of what the source saw lies the unlawful, and
in front of that, where the ray has left the source's picture, all is lawful again. The limit is that of the stretch the truth
lies in: going from the truth towards the camera, where the law is broken first (behind an occluder: its back).
**The scale of depth** is `robust_scale` of the view's known pixels; the truth is clipped at 1 as the input is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth, px_from_px
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.networks.view_tensors import DepthPlane, color_planes, robust_scale
from dlama.training.data.augment import change_light, mirror_at_random
from dlama.training.data.samples.law_limit_kernels import limits
from dlama.training.settings import NetworkSettings


def law_limit(law: Law, camera: Camera, truth: Float32Array, where: BoolArray) -> Float32Array:
    """H x W inverse depth (1/m) that filled pixels must not exceed; +inf outside `where` and where anything is lawful.

    truth: H x W true inverse depth seen from `camera`, 0 = far. Never below the truth: where a pixel centre's truth breaks
    the law itself (at edges, by a fraction of a pixel) the truth is the limit.
    """
    found = np.full(truth.shape, np.inf)
    truth, where = np.require(truth, np.float32, ["C", "W"]), np.require(where, np.bool_, ["C", "W"])  # one signature
    for source, measured in law.measured:
        measured = np.require(measured, np.float32, ["C", "W"])
        in_bands(limits, len(truth), truth, where, px_from_px(source, camera), measured, found)
    return found.astype(np.float32)


DEPTH_AGREES, COLOR_AGREES = 0.03, 25
"""Relative difference of inverse depth, and difference of levels (of 255) in every channel."""
MOST = 0.8
"""Share of the compared pixels that must agree."""
COMPARED = np.s_[1::3, 1::3]
"""Pixels that are compared."""
SMALLEST, LARGEST = 0.004, 0.6
"""Share of the picture that a hole has at least and at most; other views are drawn again."""


@dataclass(frozen=True, eq=False)
class ViewExample:
    """A view with holes, as it is at run time, and the truth."""

    view: View
    truth: RGBD
    """The frame of the view's camera; depth 0 = truth unknown."""
    law: Law
    """The visibility law of the view's source."""


@dataclass(frozen=True, eq=False)
class PairExample:
    """A stereo pair, left then right; H x W x 3 each."""

    shown: Sequence[UInt8Array]
    true: Sequence[UInt8Array]
    """What the pictures should be."""
    holes: Sequence[BoolArray]
    """H x W each."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A `sources.SampleSource` of examples, each mirrored and in other light at random."""

    example: Callable[[int, np.random.Generator], ViewExample | PairExample]
    """Of an index of so many (`count`); picklable."""
    count: int
    network: NetworkSettings
    group_size: int = 1

    def __len__(self) -> int:
        return self.count

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample, see `batches.Batch`."""
        example, views = self.example(index, rng), self.network.kind.views
        make = pair_sample if isinstance(example, PairExample) else view_sample
        return mirror_at_random(change_light(make(example, self.network), rng, 3 * views), rng, views)  # type: ignore[arg-type]


def hole_size_fits(hole: BoolArray) -> bool:
    """Whether a hole (H x W) covers SMALLEST to LARGEST of the picture."""
    return SMALLEST <= float(hole.mean()) <= LARGEST


def view_sample(example: ViewExample, network: NetworkSettings) -> dict[str, np.ndarray]:
    """One view as a sample of planes rgb or rgbd, see `batches.Batch`."""
    view, hole = example.view, example.view.hole
    mask = hole[None].astype(np.float32)
    known, target = color_planes(view.color), color_planes(example.truth.color)
    keep_view = not truth_agrees(example)
    made = {"mask": mask}
    if network.kind.has_depth:
        depth = DepthPlane.of(view, robust_scale)
        true, there = inverse_depth(example.truth.depth), example.truth.depth > 0
        # real pictures of the discriminator have no gaps: unknown depth is that of the nearest known pixel
        plane = fill_with_nearest(np.minimum(true / np.float32(depth.scale), np.float32(1)), there)
        known, target = np.concatenate([known, depth.values[None]]), np.concatenate([target, plane[None]])
        made["known_depth"] = (there | (~hole & keep_view))[None].astype(np.float32)
        limit = law_limit(example.law, view.camera, true, hole) / np.float32(depth.scale)
        limit = np.maximum(limit, max(depth.far_below, 1e-7))  # what is not above that is far, which is always lawful
        made["limit"] = np.where(hole & there, np.maximum(limit, plane), np.float32(np.inf))[None].astype(np.float32)
    made["input"] = np.concatenate([known * (1 - mask), mask])
    made["target"] = np.where(hole, target, known) if keep_view else target
    return made


def pair_sample(example: PairExample, network: NetworkSettings) -> dict[str, np.ndarray]:
    """A pair as a sample of planes stereo or stereo-two-masks: one mask is the union of both holes."""
    each = np.stack(example.holes).astype(np.float32)
    mask = each if network.kind.masks == 2 else each.max(0, keepdims=True)
    pictures, target = (np.concatenate([color_planes(one) for one in both]) for both in (example.shown, example.true))
    known = pictures * (1 - mask.repeat(6 // len(mask), 0))
    return {"input": np.concatenate([known, mask]), "target": target, "mask": mask}


def truth_agrees(example: ViewExample) -> bool:
    """Whether the truth agrees with the view at MOST of the known pixels."""
    view, truth = example.view, example.truth
    shown, true = view.depth[COMPARED], truth.depth[COMPARED]
    both = ~view.hole[COMPARED] & (true > 0)
    if not both.any():
        return False
    w, true_w = inverse_depth(shown[both]), inverse_depth(true[both])
    close = np.abs(w - true_w) <= DEPTH_AGREES * np.maximum(w, true_w)
    levels = np.abs(view.color[COMPARED][both].astype(np.int16) - truth.color[COMPARED][both])
    return float((close & (levels.max(1) <= COLOR_AGREES)).mean()) >= MOST
