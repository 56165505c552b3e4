"""A scene and an object's masks in some of its frames in; the scene without the object, in every frame, out.

The masked frames locate the object's points and, equally, the points next to it that are not its own. In every other frame an
object's pixel shows such a point. Connected pixels of similar depth in front of the background (`foreground`) are added, if
they lie within the object's box and no masked frame shows them outside its mask, but all under it or hidden; so are pixels
without depth where the object would be seen. A network that sees the picture decides at the rims (`masks.corrections`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from dlama.errors import InputError
from dlama.geometry.codes import HoleType
from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.frames.choosing import box_corners, choose_frames, find_box_in_view
from dlama.geometry.frames.foreground import find_foreground, grow_region
from dlama.geometry.frames.removal import Removal, mask_growth, remove_masked
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import (
    check_mask,
    dilate_mask,
    erode_mask,
    morphological_close,
    morphological_open,
    nearest_known,
    square,
)
from dlama.geometry.projection import project_to_pixels, world_points
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.perception.masks.corrections import correct_carried
from dlama.perception.shadows.find import add_shadows

RIM_PX = 3
"""Rim in px of a mask that is not transferred: masks reach a little over the object."""
OUTLIERS = (1.0, 99.0)
"""Percentiles of the object's points inside its box."""


def remove_object(
    scene: Scene, mask: BoolArray | Mapping[int, BoolArray], dilate: int | None, with_shadow: bool = False
) -> Removal:
    """The scene as it was measured without the object under a mask; arguments and errors as of `Scene.without`. with_shadow: and
    without the shadow that it casts in each frame."""
    masks, growth = masks_by_place(scene, mask), mask_growth(scene, dilate)
    carried = carry_masks(scene.unfilled, masks)
    if with_shadow:
        carried = add_shadows(scene.unfilled, carried)
    return remove_masked(scene, carried, growth)


def masks_by_place(scene: Scene, mask: BoolArray | Mapping[int, BoolArray]) -> dict[int, BoolArray]:
    """Place of a frame -> its mask. Raises MaskError, InputError."""
    if not isinstance(mask, Mapping):
        if len(scene.frames) > 1:
            raise InputError(
                "`mask` is one picture, and there are many frames; {number of the frame: mask} is expected"
            )
        mask = {scene.numbers[0]: mask}
    if not mask:
        raise InputError("`mask` is empty; {number of the frame: mask} is expected")
    places = {scene.place_of(number): one for number, one in mask.items()}
    return {place: check_mask(one, scene.frames[place].camera.hw) for place, one in places.items()}


@dataclass(frozen=True, eq=False)
class MaskedObject:
    """One masked object."""

    masks: dict[int, BoolArray]
    """Place of a frame -> H x W."""
    shown: Scene
    """The frames under the masks."""
    whole: Scene
    """The same with depth wherever the masks are: that of the nearest pixel amid the object."""
    box: tuple[np.ndarray, np.ndarray]
    """Lower and upper corner, in the world, of the box that holds it."""

    @cached_property
    def corners(self) -> np.ndarray:
        """8 x 3, of a box that holds that one and all of `whole`."""
        return box_corners(np.concatenate([*points_of_frames(self.whole), np.stack(self.box)]))

    @cached_property
    def points(self) -> np.ndarray:
        """N x 3, in the world, under the masks."""
        return np.concatenate(points_of_frames(self.shown))

    def is_part_of(self, other: MaskedObject, frames: Mapping[int, Layer]) -> bool:
        """Whether both are one object: parts under masks of one frame whose points' boxes meet, or parts of other frames most of
        whose points lie under the masks of the other's; frames: the masked ones, by index."""
        if self.masks.keys() & other.masks.keys():
            (low, high), (other_low, other_high) = (
                np.percentile(one.points, OUTLIERS, axis=0) for one in (self, other)
            )
            return bool((low <= other_high).all() and (other_low <= high).all())
        return max(self.share_under(other, frames), other.share_under(self, frames)) > 0.5

    def share_under(self, other: MaskedObject, frames: Mapping[int, Layer]) -> float:
        """Share of the points in view of the other's masked frames that lie under its masks, not before or behind them."""
        in_view, under = 0, 0
        for place, mask in other.masks.items():
            at, _, _, shown = find_in_frame(self.points, frames[place].load())
            in_view, under = in_view + int(shown.sum()), under + int((shown & dilate_mask(mask, RIM_PX)[at]).sum())
        return under / in_view if in_view else 0.0


def carry_masks(scene: Scene, masks: Mapping[int, BoolArray]) -> Iterator[BoolArray]:
    """H x W bool for each layer of the scene: the given masks (index of a frame -> mask), and in all other layers the same
    objects. Each is transferred alone, in the frames before any removal, so that the order does not matter. InputError."""
    if len(masks) == len(scene.layers):
        return (masks[place] for place in range(len(masks)))
    frames = {place: scene.original(place) for place in masks}
    objects = separate_objects(frames, masks)
    if not objects:
        raise InputError(
            "mask marks no pixel with depth, so it cannot be carried to the other frames; mask another frame"
        )

    def mask_of(place: int) -> BoolArray:
        mask = masks.get(place, np.zeros(scene.layers[place].camera.hw, bool))
        left = [one for one in objects if place not in one.masks]
        if left:
            original = scene.original(place).load()
            mask = np.logical_or.reduce([mask, *(_carry_to(original, frames, one) for one in left)])
        return mask

    return map(mask_of, range(len(scene.layers)))


def find_removed(scene: Scene, frame: View) -> BoolArray:
    """H x W, where one more frame shows removed objects, by the layers relevant to its camera."""
    masks = {}
    for place in choose_frames(scene.layers, frame.camera):
        camera = scene.layers[place].camera
        removed = [one.load() for one in scene.removals if one.camera.same_view_as(camera)]
        of_layer = [one.hole_type == HoleType.OBJECT.value for one in removed]
        if of_layer:
            masks[place] = np.logical_or.reduce(of_layer)
    frames = {place: scene.original(place) for place in masks}
    found = [_carry_to(frame, frames, one) for one in separate_objects(frames, masks)]
    return np.logical_or.reduce([np.zeros(frame.hole.shape, bool), *found])


def separate_objects(frames: Mapping[int, Layer], masks: Mapping[int, BoolArray]) -> list[MaskedObject]:
    """The masked objects that have depth (place of a frame -> frame, mask): parts of masks that show one object are one."""
    objects: list[MaskedObject] = []
    for place, mask in masks.items():
        count, labels = cv2.connectedComponents(dilate_mask(mask, RIM_PX).astype(np.uint8))
        for label in range(1, count):
            one = masked_object(frames, {place: mask & (labels == label)})
            while one is not None and (near := next((each for each in objects if one.is_part_of(each, frames)), None)):
                objects.remove(near)
                parts = near.masks | {each: part | near.masks.get(each, part) for each, part in one.masks.items()}
                one = masked_object(frames, parts)
            objects += [] if one is None else [one]
    return objects


def masked_object(frames: Mapping[int, Layer], masks: dict[int, BoolArray]) -> MaskedObject | None:
    """The object under masks of frames (place -> H x W); None where they show no depth."""
    shown = Scene(tuple(mask_interior(frames[place], mask) for place, mask in masks.items()), numbers=tuple(masks))
    box = bounding_box(shown)
    if box is None:
        return None
    layers = (frames[place].load() for place in masks)
    whole = Scene(tuple(map(spread_depth, layers, shown.frames, masks.values())), numbers=tuple(masks))
    return MaskedObject(masks, shown, whole, box)


def spread_depth(frame: View, shown: Layer, mask: BoolArray) -> View:
    """The masked part of a frame, with the depth of the nearest pixel that is `shown`; without pixels where none is."""
    known = shown.load().valid
    _, nearest = nearest_known(known)
    inside = mask & known.any()
    depth = np.where(inside, frame.depth.ravel()[nearest], np.float32(0))
    part = frame.without(~inside, HoleType.NONE)
    return part.with_planes(depth=depth, hole=~inside)


def mask_interior(frame: Layer, mask: BoolArray) -> Layer:
    """The masked part of a frame without its rim; thin parts are kept whole."""
    wide = morphological_open(mask, square(2 * RIM_PX + 1))
    core = (erode_mask(mask, RIM_PX) | (mask & ~wide)) & frame.load().valid
    return frame.without(~(core if core.any() else mask), HoleType.NONE)


def points_of_frames(scene: Scene) -> list[np.ndarray]:
    """N x 3, in the world, of the measured pixels of each frame."""
    return [world_points(view)[view.valid] for view in (layer.load() for layer in scene.frames)]


def bounding_box(masked: Scene) -> tuple[np.ndarray, np.ndarray] | None:
    """Lower and upper corner, in the world, of the box that holds the object; None where the masks show no depth."""
    points = points_of_frames(masked)
    if not sum(map(len, points)):
        return None
    low, high = np.percentile(np.concatenate(points), OUTLIERS, axis=0)
    thick = 0.7 * float((high - low).max())  # along the line of sight, at most
    backs = []  # where the far side of the object may lie, which the masked frames do not see
    for layer, front in zip(masked.frames, points):
        sight = front - layer.camera.world_from_cam[:3, 3]
        backs.append(front + thick * sight / np.linalg.norm(sight, axis=1, keepdims=True))
    low, high = np.percentile(np.concatenate([*points, *backs]), OUTLIERS, axis=0)
    grow = 0.25 * float(np.linalg.norm(high - low))  # other frames see sides that the masked ones do not
    return low - grow, high + grow


def _carry_to(frame: View, frames: Mapping[int, Layer], masked: MaskedObject) -> BoolArray:
    """The pixels of an unmasked frame that show the object; frames: the masked ones, by index."""
    box = find_box_in_view(masked.corners, frame.camera)
    if box is None:
        return np.zeros_like(frame.hole)
    found = np.zeros((3, *frame.hole.shape), np.bool_)
    found[(slice(None), *box)] = find_in_depth(frame.cropped(*box), frames, masked)
    return correct_carried(frame, *found)


def find_in_depth(frame: View, frames: Mapping[int, Layer], masked: MaskedObject) -> tuple[BoolArray, ...]:
    """What depth says of an object in a part of an unmasked frame that holds its box, H x W each: the pixels that show it, or may
    where depth is missing; those that show what a masked frame shows amid its mask; those that one shows outside its mask.

    frames: the masked ones, by index.
    """
    points = world_points(frame)
    candidates = frame.valid & ((points >= masked.box[0]) & (points <= masked.box[1])).all(-1)
    seen = render(masked.shown, frame.camera, types=False)
    agrees = np.abs(seen.depth - frame.depth) <= AGREES * frame.depth
    near = choose_frames([frames[place] for place in masked.masks], frame.camera)
    # all points of an object lie behind its mask, in every masked frame that shows them
    behind, barred = np.zeros_like(frame.hole), np.zeros_like(frame.hole)
    for number, (place, mask) in enumerate(masked.masks.items()):
        if number in near:
            outside, within, in_view = compare_with_mask(points, frames[place].load(), mask)
            candidates &= within | ~in_view
            barred |= outside
            behind |= within
    candidates &= behind & ~barred
    seeds = seen.valid & frame.valid & agrees & ~barred
    unmeasured = frame.hole & render(masked.whole, frame.camera, types=False).valid if frame.has_holes else frame.hole
    if not seeds.any():
        return unmeasured, seeds, barred
    size = max(int(seeds.sum()), *(int(mask.sum()) for mask in masked.masks.values()))
    # as far beyond its masked part as one and a half sides of a square of equal area
    candidates &= dilate_mask(seeds, max(2 * RIM_PX, round(1.5 * float(np.sqrt(size)))))
    seeds &= candidates
    found = grow_region(seeds, find_foreground(frame, candidates) | seeds, frame.depth)
    gaps = morphological_close(found, square(3)) & (candidates | frame.hole)
    rim = dilate_mask(found, 2) & candidates  # px of depths between two surfaces
    return found | gaps | rim | unmeasured, seeds, barred


def compare_with_mask(points: np.ndarray, masked: View, mask: BoolArray) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Points (H x W x 3) compared with a masked frame, H x W each: shown outside its mask; on a line of sight of its mask (grown
    by RIM_PX), or hidden there by what is in front; in its view. Beyond the picture a mask that its border cuts continues."""
    at, z, inside, shown = find_in_frame(points, masked)
    hidden = masked.valid[at] & (masked.depth[at] < (1 - AGREES) * z)
    within = np.where(inside, dilate_mask(mask, RIM_PX)[at] | hidden, mask[at] & (z > 0))
    return shown & ~mask[at], within, inside


def find_in_frame(
    points: np.ndarray, frame: View
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, BoolArray, BoolArray]:
    """Where points (... x 3) are in a frame, each of their shape: row and column (the nearest of the picture), depth in metres,
    in its view, and shown there, neither before nor behind what it measured."""
    row, column, z, inside = project_to_pixels(points, frame.camera)
    return (row, column), z, inside, inside & (np.abs(frame.known_depth[row, column] - z) <= AGREES * z)
