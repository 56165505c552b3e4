"""A view with holes and its truth in -> a sample, exactly as the filler `joint` would be fed that view, out; a pair of pictures
in -> a sample as the filler `pair` would be fed it, out.

Two things are decided here. **What is known of the target**: the view shows warped colours, blurred by resampling and, after
noise, wrong at edges; the truth is the frame that a camera there would take. Where both agree at most known pixels (depth
within DEPTH_AGREES, colour within COLOR_AGREES levels, at MOST of them), the whole target is the true frame: the
terms on known pixels then teach the network to clean up what it is shown, and no seam of sharpness runs round the hole of the
pictures that the discriminator takes for real. Where they do not (another exposure, poses that are off), the target's known
pixels are the view's own, since nothing could lead from the one to the other. **The scale of depth** is `robust_scale` of what
the view knows, and the truth is clipped at 1 as the input is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dlama.geometry.holes import with_nearest
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.networks.view_tensors import DepthPlane, color_planes, robust_scale
from dlama.training.data.law_limit import law_limit
from dlama.training.settings import NetworkSettings

DEPTH_AGREES, COLOR_AGREES = 0.03, 25
"""Relative, and levels of 255 in every channel."""
MOST = 0.8
LOOKED_AT = np.s_[1::3, 1::3]
"""Of which pixels."""
SMALLEST, LARGEST = 0.004, 0.6
"""Share of the picture that a hole has at least and at most; other views are drawn again."""


@dataclass(frozen=True, eq=False)
class Question:
    """A view as the method would meet it, and the answer."""

    view: View
    truth: RGBD
    """Seen from the view's camera; its depth 0 = no truth known."""
    law: Law


def fits(hole: BoolArray) -> bool:
    """Whether a hole is neither next to nothing nor next to everything."""
    return SMALLEST <= float(hole.mean()) <= LARGEST


def view_sample(question: Question, network: NetworkSettings) -> dict[str, np.ndarray]:
    """One view as a sample of planes rgb or rgbd, see `batches.Batch`."""
    view, hole = question.view, question.view.hole
    mask = hole[None].astype(np.float32)
    known, target = color_planes(view.color), color_planes(question.truth.color)
    own = not agrees(question)
    made = {"mask": mask}
    if network.has_depth:
        depth = DepthPlane.of(view, robust_scale)
        true = inverse_depth(question.truth.depth)
        # no gaps in what the discriminator takes for real
        plane = with_nearest(np.minimum(true / np.float32(depth.scale), np.float32(1)), question.truth.depth > 0)
        known, target = np.concatenate([known, depth.values[None]]), np.concatenate([target, plane[None]])
        is_known = question.truth.depth > 0 if not own else np.where(hole, question.truth.depth > 0, True)
        limit = law_limit(question.law, view.camera, true, hole) / np.float32(depth.scale)
        made["known_depth"] = is_known[None].astype(np.float32)
        limit = np.maximum(limit, max(depth.far_below, 1e-7))  # what is not above that is far, which is always lawful
        limit = np.where(question.truth.depth > 0, np.maximum(limit, plane), np.float32(np.inf))
        made["limit"] = np.where(hole, limit, np.float32(np.inf))[None].astype(np.float32)
    made["input"] = np.concatenate([known * (1 - mask), mask])
    made["target"] = np.where(hole, target, known) if own else target
    return made


def pair_sample(
    shown: Sequence[UInt8Array], true: Sequence[UInt8Array], holes: Sequence[BoolArray], network: NetworkSettings
) -> dict[str, np.ndarray]:
    """Left and right pictures (H x W x 3), what they should be, and the hole of each (H x W), as a sample of planes stereo
    or stereo-two-masks: one mask is the union of both holes."""
    each = np.stack(holes).astype(np.float32)
    mask = each if network.masks == 2 else each.max(0, keepdims=True)
    pictures, target = (np.concatenate([color_planes(color) for color in colors]) for colors in (shown, true))
    known = pictures * (1 - mask.repeat(6 // len(mask), 0))
    return {"input": np.concatenate([known, mask]), "target": target, "mask": mask}


def agrees(question: Question) -> bool:
    """Whether the truth shows, at most known pixels, what the view shows."""
    view, truth = question.view, question.truth
    shown, true = view.depth[LOOKED_AT], truth.depth[LOOKED_AT]
    both = ~view.hole[LOOKED_AT] & (true > 0)
    if not both.any():
        return False
    w, true_w = inverse_depth(shown[both]), inverse_depth(true[both])
    close = np.abs(w - true_w) <= DEPTH_AGREES * np.maximum(w, true_w)
    levels = np.abs(view.color[LOOKED_AT][both].astype(np.int16) - truth.color[LOOKED_AT][both])
    return float((close & (levels.max(1) <= COLOR_AGREES)).mean()) >= MOST
