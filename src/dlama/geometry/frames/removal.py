"""A scene and the masks of an object in some of its frames in; the scene without that object, in every frame, out.

The masked frames say where the object's points lie and, just as well, which points next to it are not its own. In every other
frame those pixels are its own that show such a point, and those that continue from them in depth and stand in front of the
background around them (`foreground`), within the object's box, and that no masked frame shows outside its mask.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from numbers import Integral
from typing import NamedTuple

import numpy as np

from dlama.errors import InputError, MaskError
from dlama.geometry.drawing.picture_edges import DepthProfile
from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.frames.foreground import grown_over, in_front
from dlama.geometry.holes import checked_mask, closed, dilated, eroded, opened, square
from dlama.geometry.projection import project, rays
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, View

GROWTH_PX, HALO_PX = 3, 3
"""By which a mask grows, and by how much more in a depth camera's picture: compression and blur spread an object's colours."""
RIM_PX = 3
"""A mask's rim that is not carried: masks reach a little over the object."""
EDGE_PX = 2
"""By which a region grows at its edges: there depths are between two surfaces."""
REACH = 1.5
"""How far an object reaches beyond what the masked frames show of it, in sides of a square as large as that."""
BOX_GROWS = 0.25
"""Of the object's diagonal, by which its box grows: other frames see sides of it that the masked ones do not."""
THICK = 0.7
"""Of the object's largest extent: how thick it may be along the line of sight of the masked frames."""
OUTLIERS = (1.0, 99.0)
"""Percentiles of the object's points that its box holds."""


class Growth(NamedTuple):
    """By how much masks grow before their pixels leave the frames."""

    px: int
    reason: str
    """For meta.json."""


class Removal(NamedTuple):
    """What removing an object gave."""

    scene: Scene
    """Without the object, and without what was filled while it was in sight."""
    growth: Growth
    pixels: int
    """Of the masks, of all frames together, before they grew."""
    known_pixels_given_up: int
    """Pixels that they grew over."""


def mask_growth(scene: Scene, dilate: int | None = None) -> Growth:
    """`dilate` px where it is given; else GROWTH_PX, and HALO_PX more where a depth camera took the pictures."""
    if dilate is not None:
        if not isinstance(dilate, Integral) or dilate < 0:
            raise InputError(f"dilate is {dilate!r} px; a whole number, 0 or more, is expected")
        return Growth(int(dilate), "as given")
    profile = DepthProfile.of(scene)
    return Growth(GROWTH_PX + HALO_PX * profile.from_depth_camera, profile.reason)


def remove_object(scene: Scene, mask: BoolArray | Mapping[int, BoolArray], dilate: int | None = None) -> Removal:
    """The scene as it was measured without the object under a mask; arguments and errors as of `Scene.without`."""
    masks = masks_by_place(scene, mask)
    growth = mask_growth(scene, dilate)
    measured = scene.unfilled
    layers, removed, before, given_up = [], [], 0, 0
    count = len(scene.frames)
    for place, (layer, one) in enumerate(zip(measured.layers, carry_masks(measured, masks))):
        larger = dilated(one, growth.px)
        if (larger | (layer.hole_type == HoleType.OBJECT)).all():
            raise MaskError(f"dilate is {growth.px} px: the mask grown by that is full and leaves nothing to fill from")
        before, given_up = before + int(one.sum()), given_up + int(larger.sum()) - int(one.sum())
        if larger.any():
            removed.append(layer.without(~larger, HoleType.NONE))
            layer = layer.without(larger, HoleType.OBJECT if place < count else HoleType.NONE)
        layers.append(layer)
    without = dataclasses.replace(
        measured,
        frames=tuple(layers[:count]),
        removals=(*scene.removals, *removed),
        fills=tuple(layers[count:]),
    )
    return Removal(without, growth, before, given_up)


def masks_by_place(scene: Scene, mask: BoolArray | Mapping[int, BoolArray]) -> dict[int, BoolArray]:
    """Place of a frame -> its mask. Raises MaskError, InputError."""
    if not isinstance(mask, Mapping):
        if len(scene.frames) > 1:
            raise InputError("mask is one picture, and there are many frames; {number of the frame: mask} is expected")
        mask = {scene.numbers[0]: mask}
    if not mask:
        raise InputError("mask is empty; {number of the frame: mask} is expected")
    places = {scene.place_of(number): one for number, one in mask.items()}
    return {place: checked_mask(one, scene.frames[place].camera.hw) for place, one in places.items()}


def carry_masks(scene: Scene, masks: Mapping[int, BoolArray]) -> list[BoolArray]:
    """H x W bool for each layer of the scene: the masks themselves (place of a frame -> mask), and in all others where the same
    object is seen."""
    if len(masks) == len(scene.layers):
        return [masks[place] for place in range(len(masks))]
    masked = dataclasses.replace(
        scene,
        frames=tuple(inner(scene.frames[place], mask) for place, mask in masks.items()),
        removals=(),
        fills=(),
        numbers=tuple(masks),
        gains=(),
    )
    box = box_of(masked)
    return [
        masks[place] if place in masks else _carried_to(layer, scene, masks, masked, box)
        for place, layer in enumerate(scene.layers)
    ]


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


def box_of(masked: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner, in the world, of the box that holds the object; InputError where the masks show no depth."""
    points = [points_of(layer)[layer.valid] for layer in masked.frames]
    if not sum(map(len, points)):
        raise InputError(
            "mask marks no pixel with depth, so it cannot be carried to the other frames; mask another frame"
        )
    low, high = np.percentile(np.concatenate(points), OUTLIERS, axis=0)
    thick = THICK * float((high - low).max())
    backs = []  # where the far side of the object may lie, which the masked frames do not see
    for layer, front in zip(masked.frames, points):
        sight = front - layer.camera.world_from_cam[:3, 3]
        backs.append(front + thick * sight / np.linalg.norm(sight, axis=1, keepdims=True))
    low, high = np.percentile(np.concatenate([*points, *backs]), OUTLIERS, axis=0)
    grow = BOX_GROWS * float(np.linalg.norm(high - low))
    return low - grow, high + grow


def _carried_to(
    frame: View, scene: Scene, masks: Mapping[int, BoolArray], masked: Scene, box: tuple[np.ndarray, np.ndarray]
) -> BoolArray:
    """Where a frame that has no mask shows the object."""
    nothing = np.zeros(frame.hole.shape, bool)
    points = points_of(frame)
    candidates = frame.valid & ((points >= box[0]) & (points <= box[1])).all(-1)
    seen = render(masked, frame.camera, types=False)
    agrees = np.abs(seen.depth - frame.depth) <= AGREES * frame.depth
    seeds = seen.valid & frame.valid & agrees
    near = choose_frames([scene.frames[place] for place in masks], frame.camera)
    behind = np.zeros_like(
        nothing
    )  # all points of an object lie behind its mask, in every masked frame that shows them
    for number, (place, mask) in enumerate(masks.items()):
        if number in near:
            beside, within, in_view = against(points, scene.frames[place], mask)
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
    """With the frame's pixels without depth where the object, as the masked frames know it, lies (H x W `shown`)."""
    return found | (frame.hole & shown & dilated(found, 2 * RIM_PX))
