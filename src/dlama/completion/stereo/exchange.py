"""Two pictures of a pair in; in each, and in their scene, what the other camera measured and it could not see, out.

What a removed object or an occluder hides from one camera is often visible to the other. Such pixels have no
match, so their depth is that of the surface they continue; their colour is measured.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.completion.stereo.pair import MatchedPair
from dlama.geometry.camera import Float64Array
from dlama.geometry.codes import Origin
from dlama.geometry.frames.agreement import SAME_GAIN, UNCLIPPED
from dlama.geometry.fusion import add_layer
from dlama.geometry.holes import morphological_open, square
from dlama.geometry.projection import depth_from_inverse
from dlama.geometry.rendering import Mode, render
from dlama.geometry.rgbd import brighten
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.confidence import judge_fill
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.surfaces import continue_surfaces
from dlama.perception.stereo.consistency import nearest_columns

MOST_FOR_GAIN = 500_000
"""Matched pixels of which the gain between two pictures is found."""
NARROWEST = 3
"""px; what one camera saw alone and is narrower than this is the rim of a depth edge."""


def color_gain(pair: MatchedPair) -> Float64Array:
    """3: what the right picture's channels are multiplied by to look like the left's.

    The median ratio over matched pixels outside the masks that neither picture clips; 1 where none is left or it is within 1 %.
    """
    disparity = pair.disparities[0]
    there, inside = nearest_columns(disparity, 1)
    known = inside & (disparity != 0)
    if pair.masks is not None:
        known &= ~pair.masks[0]
    rows, columns = np.nonzero(known)
    some = slice(None, None, 1 + len(rows) // MOST_FOR_GAIN)
    rows, columns = rows[some], columns[some]
    left, right = pair.colors[0][rows, columns], pair.colors[1][rows, there[rows, columns]]
    gains = np.ones(3)
    for channel in range(3):
        ours, theirs = left[:, channel].astype(np.float64), right[:, channel].astype(np.float64)
        fit = (np.minimum(ours, theirs) > UNCLIPPED[0]) & (np.maximum(ours, theirs) < UNCLIPPED[1])
        if fit.any():
            gains[channel] = np.median(ours[fit] / theirs[fit])
    return np.where(np.abs(gains - 1) < SAME_GAIN, 1.0, gains)


def apply_gain(view: View, gain: Float64Array) -> View:
    """The view with its colour channels multiplied by `gain` (3)."""
    if (gain == 1).all():
        return view
    return dataclasses.replace(view, color=brighten(view.color, gain))


def continue_depth(view: View, context: FillContext, seed: int) -> View:
    """The view with depth where only depth was unknown: of the surface that continues there. Other holes stay open.

    The depth of known pixels on planes is freed of noise.
    """
    depth_only = view.depth_hole
    if not view.valid.any():
        return view
    proposed = depth_from_inverse(continue_surfaces(view, context, seed).inverse_depth)
    view = dataclasses.replace(view, depth=np.where(view.valid, proposed, view.depth))
    depth, _ = context.law.project(view.camera, np.where(depth_only, proposed, view.depth), depth_only)
    confidence, errors = judge_fill(view, view.color, depth)
    return dataclasses.replace(
        view,
        depth=depth,
        hole=view.hole & ~depth_only,
        origin=np.where(depth_only, np.uint8(Origin.DEPTH_FILLED), view.origin),
        confidence=np.where(depth_only, confidence, view.confidence),
        errors=np.where(depth_only[..., None], errors, 0 if view.errors is None else view.errors).astype(np.float32),
    )


def transfer_hidden(view: View, other: View, law: Law, mode: Mode) -> View:
    """The view with its removed object's hole closed where `other`, a view from elsewhere, shows what is behind.

    Left out is what would break the law: depth in front of what was measured is a wrong match.
    """
    hidden = view.object_hole
    if not hidden.any():
        return view
    shown = render(other, view.camera, mode, types=False)
    usable = hidden & ~shown.hole
    usable &= ~law.violations(view.camera, shown.depth, usable)
    return view.with_pixels(shown, usable)


def add_seen_alone(scene: Scene, view: View, law: Law, mode: Mode) -> Scene:
    """The scene with what only this view saw of it as one more layer: surfaces that the scene already has are not doubled."""
    seen = ~view.hole & ((view.origin == Origin.MEASURED.value) | (view.origin == Origin.DEPTH_FILLED.value))
    alone = seen & render(scene, view.camera, mode, types=False, close=False).hole
    alone &= ~law.violations(view.camera, view.depth, alone)
    return add_layer(scene, view, morphological_open(alone, square(NARROWEST)))


def transferred_share(view: View, before: View) -> float:
    """Share of the colour hole of `before` (0..1) that the other camera measured in the completed `view`; 0 without a hole."""
    hole = before.color_hole
    transferred = (view.origin == Origin.REPROJECTED.value) | (view.origin == Origin.DEPTH_FILLED.value)
    return round(float(transferred[hole].mean()), 6) if hole.any() else 0.0
