"""The default filler: a view with holes in; depth continued from the far side of each hole, colour from that surface, out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.geometry.view import HoleType, View
from dlama.geometry.visibility import Law, lawful_depth
from dlama.inpainters.filling import Fill
from dlama.inpainters.layered.hedging import hedged
from dlama.inpainters.layered.remaining_shadows import fading_out, shadow_beside
from dlama.inpainters.layered.rims import led_in
from dlama.inpainters.layered.softening import softened
from dlama.inpainters.layered.surfaces import Surfaces, continue_surfaces
from dlama.inpainters.layered.texture_synthesis import synthesize
from dlama.perception.planes import SKY, SMOOTH

NOT_LED_IN = (HoleType.OUT_OF_VIEW, HoleType.OBJECT)
"""Holes into which nothing is led from their rims: beside a removed thing lie scraps of it and of its shadow."""

Repaint = Callable[[View, Surfaces, Float32Array, UInt8Array, Law, int], UInt8Array]
"""(view, continued surfaces, H x W metres filled, H x W x 3 painted colours, law, seed) -> H x W x 3, painted better."""


def layered(view: View, law: Law, seed: int = 0) -> Fill:
    """Continue planes, sky and smooth surfaces into the holes, move them behind what was measured, then paint them."""
    return layered_fill(view, law, seed)


def layered_fill(view: View, law: Law, seed: int, repaint: Repaint | None = None) -> Fill:
    """As `layered`; with `repaint`, which sees what is painted before colours out of view are hedged."""
    surfaces, depth, moved = surfaces_behind(view, law, seed)
    color = painted(view, surfaces, depth, law, seed)
    if repaint is not None:
        color = repaint(view, surfaces, depth, color, law, seed)
    w = np.where(view.hole, inverse_depth(depth), surfaces.inverse_depth)
    color = hedged(view, color, view.color_hole & (surfaces.leaves < 0), w, surfaces.label, law.sky)
    if law.misplaced_edges:  # where surfaces end is a guess upon a guess
        color = softened(color, view.color_hole, view.hole_type == HoleType.OUT_OF_VIEW, surfaces.label)
    return Fill(color, depth, moved, {"planes": len(surfaces.planes)})


def painted(view: View, surfaces: Surfaces, depth: Float32Array, law: Law, seed: int) -> UInt8Array:
    """H x W x 3: the view's colours, and in its colour holes each surface with texture of its own; depth: H x W m, filled."""
    if not view.color_hole.any():
        return view.color
    w = np.where(view.hole, inverse_depth(depth), surfaces.inverse_depth)
    label = np.where(np.abs(w - surfaces.inverse_depth) > 0.05 * w, np.int32(SMOOTH), surfaces.label)
    label = np.where(view.hole & (w == 0), np.int32(SKY), label).astype(np.int32)
    shadow = shadow_beside(view, label)
    leafy = with_leaves(view.color, view, surfaces)
    open_ = view.color_hole & (surfaces.leaves < 0)
    color = synthesize(leafy, open_, w, label, view.camera, seed=seed, sky=law.sky, spoiled=shadow)
    color = led_in(color, view.color_hole, open_ & ~np.isin(view.hole_type, NOT_LED_IN), w, label, shadow)
    return fading_out(color, shadow, view.color_hole, label) if shadow.any() else color


def with_leaves(color: UInt8Array, view: View, surfaces: Surfaces) -> UInt8Array:
    """H x W x 3 colours with those of the leaves where foliage goes on in the view's colour holes."""
    leafy = view.color_hole & (surfaces.leaves >= 0)
    if not leafy.any():
        return color
    out = color.copy()
    out[leafy] = view.color.reshape(-1, 3)[surfaces.leaves[leafy]]
    return out


def surfaces_behind(view: View, law: Law, seed: int) -> tuple[Surfaces, Float32Array, int]:
    """The surfaces continued into the holes, their depth put behind what was measured, and how many pixels that moved."""
    surfaces = continue_surfaces(view, law, seed)
    depth, moved = lawful_depth(view, depth_from_inverse(surfaces.inverse_depth), view.hole, law)
    return surfaces, depth, moved
