"""A scene of many frames and the masks of a thing in some of them in; the scene without that thing, in every frame, out.

The masked frames say where the thing's points lie and, just as well, which points beside it are not its own. In every other frame
those pixels are its own that show such a point, and those that follow on from them in depth and stand in front of the background
around them (`foreground`), within the thing's box, and that no masked frame shows outside its mask.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from dlama.completion.frames.foreground import grown_over, in_front
from dlama.completion.plausible import warn_of_mask
from dlama.completion.recipes import Recipe
from dlama.completion.steps import NO_DILATION, Dilation, halo, take_out
from dlama.errors import InputError, MaskError
from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.holes import checked_mask, closed, dilated, eroded, opened, square
from dlama.geometry.projection import project, rays
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, View

RIM_PX = 3
"""A mask's rim that is not carried: masks reach a little over the thing."""
EDGE_PX = 2
"""By which a region grows at its edges: there depths are between two surfaces."""
REACH = 1.5
"""How far a thing reaches beyond what the masked frames show of it, in sides of a square as large as that."""
BOX_GROWS = 0.25
"""Of the thing's diagonal, by which its box grows: other frames see sides of it that the masked ones do not."""
THICK = 0.7
"""Of the thing's largest extent: how thick it may be along the line of sight of the masked frames."""
OUTLIERS = (1.0, 99.0)
"""Percentiles of the thing's points that its box holds."""


def with_halo(recipe: Recipe, scene: Scene, mask: BoolArray | Mapping[int, BoolArray] | None) -> Recipe:
    """The recipe with masks grown by the widest halo of the pictures that have one; itself without a mask.

    Raises InputError: a mask for a frame that is not there.
    """
    if mask is None:
        return recipe
    places = [_place(scene, number) for number in mask] if scene.numbers and isinstance(mask, Mapping) else [0]
    wider = max((halo(scene.layers[place].read()) for place in places), default=0)
    return dataclasses.replace(recipe, dilate=recipe.dilate + wider)


def take_out_of(scene: Scene, mask: BoolArray | Mapping[int, BoolArray] | None, radius: int) -> tuple[Scene, Dilation]:
    """The measured scene without the thing under a mask, or under the masks of several frames, grown by `radius` px.

    Raises MaskError, InputError (a mask for a frame that is not there, or no number where there are many frames).
    """
    if not scene.numbers:
        if isinstance(mask, Mapping):
            if list(mask) != [0]:
                raise InputError(f"mask is for frames {', '.join(map(str, mask))}; there is one picture, frame 0")
            mask = mask[0]
        taken = take_out(scene.layers[0], mask, radius)
        if mask is not None:
            warn_of_mask(mask)
        return taken
    measured = Scene(scene.measured, scene.objects, scene.numbers, scene.gains, scene.noise)
    if mask is None:
        return measured, NO_DILATION
    if not isinstance(mask, Mapping):
        raise InputError("mask is one picture, and there are many frames; {number of the frame: mask} is wanted")
    masks = {_place(scene, number): checked_mask(one, scene.layers[0].camera.hw) for number, one in mask.items()}
    if not masks:
        raise InputError("mask is empty; {number of the frame: mask} is wanted")
    everywhere = carried(measured, masks)
    frames, objects, before, given_up = [], [], 0, 0
    for frame, one in zip(measured.layers, everywhere):
        larger = dilated(one, radius)
        if larger.all():
            raise MaskError(f"dilate is {radius} px: a mask grown by that is full and leaves nothing to fill from")
        before, given_up = before + int(one.sum()), given_up + int(larger.sum()) - int(one.sum())
        frames.append(frame.without(larger, HoleType.OBJECT) if larger.any() else frame)
        if larger.any():
            objects.append(frame.without(~larger, HoleType.NONE))
    without = Scene(tuple(frames), (*scene.objects, *objects), scene.numbers, scene.gains, scene.noise)
    return without, Dilation(before, given_up)


def _place(scene: Scene, number: int) -> int:
    if number not in scene.numbers:
        known = (
            f"{scene.numbers[0]} to {scene.numbers[-1]}"
            if len(scene.numbers) > 8
            else ", ".join(map(str, scene.numbers))
        )
        raise InputError(f"mask is for frame {number}, which is not in the scene; it has frames {known}")
    return scene.numbers.index(number)


def carried(scene: Scene, masks: Mapping[int, BoolArray]) -> list[BoolArray]:
    """H x W bool for each frame of the scene: the masks themselves, and in all other frames where the same thing is seen."""
    thing = Scene(
        tuple(inner(scene.layers[place], mask) for place, mask in masks.items()),
        numbers=tuple(masks),
        gains=tuple((1.0, 1.0, 1.0) for _ in masks),
        noise=scene.noise,
    )
    box = box_of(thing)
    found = []
    for place, frame in enumerate(scene.layers):
        found.append(masks[place] if place in masks else _carried_to(frame, scene, masks, thing, box))
    return found


def inner(frame: View, mask: BoolArray) -> View:
    """What the mask shows of a frame, without the rim of its wide parts: what is thin is rim altogether."""
    wide = opened(mask, square(2 * RIM_PX + 1))
    core = (eroded(mask, RIM_PX) | (mask & ~wide)) & frame.valid
    return frame.without(~(core if core.any() else mask), HoleType.NONE)


def points_of(view: View) -> np.ndarray:
    """H x W x 3, where each pixel's point lies in the world; pixels without depth at the camera."""
    depth = np.where(view.valid, view.depth, 0)
    pose = view.camera.world_from_cam
    return (rays(view.camera) * depth[..., None]) @ pose[:3, :3].T + pose[:3, 3]


def box_of(thing: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner, in the world, of the box that holds the thing; InputError where the masks show no depth."""
    points = [points_of(layer)[layer.valid] for layer in thing.layers]
    if not sum(map(len, points)):
        raise InputError(
            "mask marks no pixel with depth, so it cannot be carried to the other frames; mask another frame"
        )
    low, high = np.percentile(np.concatenate(points), OUTLIERS, axis=0)
    thick = THICK * float((high - low).max())
    backs = []  # where the far side of the thing may lie, which the masked frames do not see
    for layer, front in zip(thing.layers, points):
        sight = front - layer.camera.world_from_cam[:3, 3]
        backs.append(front + thick * sight / np.linalg.norm(sight, axis=1, keepdims=True))
    low, high = np.percentile(np.concatenate([*points, *backs]), OUTLIERS, axis=0)
    grow = BOX_GROWS * float(np.linalg.norm(high - low))
    return low - grow, high + grow


def _carried_to(
    frame: View, scene: Scene, masks: Mapping[int, BoolArray], thing: Scene, box: tuple[np.ndarray, np.ndarray]
) -> BoolArray:
    """Where a frame that has no mask shows the thing."""
    nothing = np.zeros(frame.hole.shape, bool)
    points = points_of(frame)
    candidates = frame.valid & ((points >= box[0]) & (points <= box[1])).all(-1)
    seen = render(thing, frame.camera, types=False)
    agrees = np.abs(seen.depth - frame.depth) <= AGREES * frame.depth
    seeds = seen.valid & frame.valid & agrees
    near = choose_frames([scene.layers[place] for place in masks], frame.camera)
    behind = np.zeros_like(
        nothing
    )  # a thing's points all lie behind its mask, in every masked frame that they are in view of
    for number, (place, mask) in enumerate(masks.items()):
        if number in near:
            beside, within, in_view = against(points, scene.layers[place], mask)
            candidates &= ~beside & (within | ~in_view)
            seeds &= ~beside
            behind |= within
    candidates &= behind
    if not seeds.any():
        return nothing
    size = max(int(seeds.sum()), *(int(mask.sum()) for mask in masks.values()))
    candidates &= dilated(seeds, max(2 * RIM_PX, round(REACH * float(np.sqrt(size)))))
    seeds &= candidates
    found = grown_over(seeds, in_front(frame, candidates) | seeds, frame.depth)
    return with_missing(
        gaps_closed(found, candidates | frame.hole) | (dilated(found, EDGE_PX) & candidates), frame, seen.valid
    )


def against(points: np.ndarray, masked: View, mask: BoolArray) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Points (H x W x 3) held against a masked frame, H x W each: those that it shows outside its mask, those on a line of sight
    of its mask (grown by RIM_PX), and those in its view."""
    pixels, z = project(points.reshape(-1, 3), masked.camera)
    width, height = masked.camera.wh
    inside = (z > 0) & (pixels >= 0).all(1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    x, y = np.where(inside[:, None], pixels, 0).astype(np.intp).T
    there = np.where(masked.hole, 0, masked.depth)[y, x]
    shown = inside & (np.abs(there - z) <= AGREES * z) & ~mask[y, x]
    within = inside & dilated(mask, RIM_PX)[y, x]
    hw = points.shape[:2]
    return shown.reshape(hw), within.reshape(hw), inside.reshape(hw)


def gaps_closed(found: BoolArray, allowed: BoolArray) -> BoolArray:
    """H x W, with small gaps closed where that is allowed."""
    return found | (closed(found, square(3)) & allowed)


def with_missing(found: BoolArray, frame: View, shown: BoolArray) -> BoolArray:
    """With the frame's pixels without depth where the thing, as the masked frames know it, lies (H x W `shown`)."""
    return found | (frame.hole & shown & dilated(found, 2 * RIM_PX))
