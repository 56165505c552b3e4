"""`layered` and `layered-patches`: a view with holes in; depth of continued surfaces, colours of the surfaces, of patches and,
in the second, of a network, out.

The second is the default for measured depth. Holes a few pixels wide take the background colours round them. Each other one
begins with smooth colours that spread along its own surface; patches of the picture, rather of the same surface, are copied
over them. Behind removed objects and in dis-occlusions the colours are a mean of these and of what MI-GAN paints in the whole
view: each errs elsewhere. The network does not see occluders of what is filled next to them, nor the remaining shadow of a
removed object: a table would extend to where the chair before it was. Behind a removed object patches are copied from any
surface, and from the network's picture on. Out of a depth camera's view they begin from the mean of surfaces and network,
since planes of such depth end in the wrong places.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import morphological_open, nearest_known, square
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, paste, replace_pixels
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter, Painter
from dlama.inpainters.layered.color.low_frequency import blend_with_low_frequency, smooth_guess
from dlama.inpainters.layered.color.surface_colors import NEARER, paint_surfaces
from dlama.inpainters.layered.depth.surfaces import Surfaces, continue_lawfully
from dlama.inpainters.layered.depth_first import Painted, hide_from_painter, paint_in_part
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.patchmatch.completion import QUICK, complete_picture
from dlama.inpainters.patchmatch.filler import GUESS_SIDE, blend_with_guess, guess_coarsely
from dlama.perception.planes import SKY

VIEW_SIDE = 256
"""Longer side of the picture that the network paints where nothing is removed: 384 pixels take twice the time, for LPIPS -3 %."""


def layered(view: View, context: FillContext, seed: int = 0) -> Fill:
    """The filler without a network."""
    return fill_over_surfaces(view, context, seed, None)


def layered_patches_filler(model: str | Path) -> Inpainter:
    """The filler with its network: MI-GAN's generator, or the published pipeline. FileError where the file is neither."""
    network = migan_filler(model)
    return lambda view, context, seed: fill_over_surfaces(view, context, seed, network)


def fill_over_surfaces(view: View, context: FillContext, seed: int, network: Painter | None) -> Fill:
    """Continue planes, sky and smooth surfaces into the holes, project them onto the visibility law, then paint them; network:
    of `layered-patches`."""
    surfaces, depth, moved = continue_lawfully(view, context, seed)
    paint = partial(paint_over_surfaces, seed=seed, network=network)
    color, notes = paint_in_part(view, surfaces, depth, context, paint)
    return Fill(color, depth, moved, {"planes": len(surfaces.planes)} | notes)


def paint_over_surfaces(
    view: View, surfaces: Surfaces, depth: Float32Array, context: FillContext, seed: int, network: Painter | None
) -> Painted:
    """The colours of a view whose depth (H x W metres) is filled; network as above."""
    view = close_narrow_holes(view, depth)
    smooth = begin_job(smooth_guess, view)
    removed, uncovered = (
        view.color_hole & (view.hole_type == kind.value) for kind in (HoleType.OBJECT, HoleType.DISOCCLUDED)
    )
    unseen, misplaced, guess = view.unseen_hole, context.law.misplaced_edges, None
    if network is not None and (removed | uncovered | (unseen & misplaced)).any():
        guess = Guess.begin(network, view, surfaces, depth, context.law, seed)
    color = view.color
    if guess is None or (view.color_hole & ~removed).any():
        color = paint_surfaces(view, surfaces, context)
    copied = removed | uncovered | unseen
    if not misplaced:
        # no clouds, which end in hard edges, and no foliage, whose leaves are copied already
        copied &= surfaces.without_leaves(~unseen | (surfaces.label != SKY))
    if guess is not None and removed.any():
        color, copied = replace_pixels(color, removed, guess.picture()), copied & ~removed
    if guess is not None and misplaced:  # patches of exact depth begin without the guess, and take as long as it
        color[unseen] = (color[unseen].astype(np.uint16) + guess.picture()[unseen]) // 2
    if copied.any():
        color = copy_patches(color, copied, surfaces.label, seed)
    if guess is not None and removed.any():
        color = replace_removed(view, color, guess, removed, seed)
    painted, w = surfaces.without_leaves(view.color_hole), surfaces.inverse_depth
    color = blend_with_low_frequency(view, color, painted, w, surfaces.label, smooth)
    if guess is not None and uncovered.any():  # not out of view: houses that it guesses would shine through the sky
        color = blend_with_guess(color, guess.picture(), uncovered, guess_share=0.4)
    return color, guess.notes() if guess is not None else {}


@dataclass(frozen=True, eq=False)
class Guess:
    """A network's picture of a view, painted while other work is done."""

    picture: Callable[[], UInt8Array]
    """Waits for it: H x W x 3."""
    hidden: BoolArray
    """H x W, what the network did not see."""
    notes: Callable[[], dict[str, Any]]
    """What was hidden, and what ran, for meta.json."""

    @classmethod
    def begin(cls, network: Painter, view: View, surfaces: Surfaces, depth: Float32Array, law: Law, seed: int) -> Guess:
        """Begin to paint a view whose depth (H x W metres) is filled, finer where an object was removed."""
        coarsely = not view.object_hole.any()
        hidden, notes = hide_from_painter(view, surfaces, depth, law, coarsely)
        side = VIEW_SIDE if coarsely else GUESS_SIDE
        picture = cache(begin_job(guess_coarsely, network.paint, view.color, hidden, seed, side))
        return cls(picture, hidden, lambda: notes | {"guess": network.notes()})


def close_narrow_holes(view: View, depth: Float32Array) -> View:
    """The view with colours, as if they were measured, in the narrow parts of its holes, into which no square of 4 px fits, but
    for those of removed objects; their depth stays open. depth: H x W metres, filled.

    Between pixels that a sensor or a renderer left apart, and along silhouettes, neither a surface nor a patch tells more; and
    what paints wider holes sees a whole picture. Occluders give no colour: seen from another camera, what is filled next to them
    lies apart. The means are those of `gaussian_mean`, to a few levels: of 8 bit they take a fifth of the time.
    """
    hole = view.color_hole
    narrow = hole & ~view.object_hole & ~morphological_open(hole, square(4))
    if not narrow.any():
        return view
    w = inverse_depth(np.where(view.hole, depth, view.depth))
    nearest = cv2.dilate(np.where(narrow, w, np.float32(0)), square(9))
    known = (~hole & (w <= NEARER * nearest)).view(np.uint8) * np.uint8(255)
    sums, share = (cv2.GaussianBlur(each, (0, 0), 1.2) for each in (cv2.copyTo(view.color, known), known))
    narrow &= share > 8
    means = sums[narrow] * (np.float32(255) / share[narrow])[:, None]
    color = view.color.copy()
    color[narrow] = np.minimum(np.rint(means), 255)
    return view.with_planes(color=color, origin=np.where(narrow, np.uint8(Origin.MEASURED), view.origin))


def copy_patches(color: UInt8Array, copied: BoolArray, label: NDArray[np.int8], seed: int) -> UInt8Array:
    """H x W x 3: colours with patches of the picture in `copied` (H x W).

    color: H x W x 3, in `copied` what the patches begin from; label: H x W, surfaces that patches rather come from.
    """
    painted, _ = complete_picture(color, copied, seed, label=label, effort=QUICK)
    return blend_with_guess(painted, color, copied)


def replace_removed(view: View, color: UInt8Array, guess: Guess, removed: BoolArray, seed: int) -> UInt8Array:
    """H x W x 3: colours with patches of the picture, from any surface, where an object was removed (H x W).

    color: H x W x 3, painted elsewhere. No patch near the object shows any of what the network did not see.
    """
    network = guess.picture()
    near = guess.hidden & ~view.color_hole
    if near.any():
        near &= removed.ravel()[nearest_known(view.color_hole)[1]]
    painted, levels = complete_picture(
        replace_pixels(color, removed | near, network), removed | near, seed, effort=QUICK
    )
    spread = np.zeros(removed.shape, np.float32)
    spread[removed | near] = levels
    out = blend_with_guess(painted, network, removed, view.color_hole | near, spread=spread)
    paste(color, near, out)
    return out
