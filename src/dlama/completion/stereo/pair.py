"""A rectified pair: as matched (disparities in, frames with depth out) and as completed (views in, a StereoCompletion out)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from typing import Any

import cv2
import numpy as np

from dlama.completion.completion import StereoCompletion
from dlama.completion.recipes import Recipe
from dlama.completion.report import expected_errors, meta_data
from dlama.completion.start import Plan, scene_of
from dlama.errors import InputError, check_same_size
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.frames.removal import NO_DILATION, Dilation
from dlama.geometry.holes import check_mask
from dlama.geometry.projection import depth_from_disparity, disparity_from_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array, check_color
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport
from dlama.perception.object_removal import remove_object
from dlama.perception.stereo.agreement import carry_mask, consistency
from dlama.perception.stereo.matching import Matcher, disparity_pair

FAR_PX = 0.5
"""Disparity (with doffs) below which depth is no more than a guess: such pixels are far."""

MATCH_NOISE_PX = 0.25
"""Disparity by which neighbours of one surface may differ: matches cluster at halves of a pixel, with steps between."""
OBJECT_REACH = 8
"""px round a pixel in which the removed object's nearest disparity is looked for."""

AS_NEAR = 0.85
"""Share of a removed object's disparity from which a pixel next to it counts as the object's."""


@dataclass(frozen=True, eq=False)
class MatchedPair:
    """Left and right picture with the disparity of each; with masks where an object is to be removed."""

    rig: StereoRig
    far: float
    """Metres; what lies at or beyond it is far (sky)."""
    colors: tuple[UInt8Array, UInt8Array]
    """H x W x 3 each: left, right."""
    disparities: tuple[Float32Array, Float32Array]
    """H x W px each, 0 = missing."""
    masks: tuple[BoolArray, BoolArray] | None = None
    """H x W each, True = remove; None: nothing is removed."""
    match: Matcher = disparity_pair
    """What found the disparities: both pictures in, both disparities out."""
    notes: dict[str, Any] = field(default_factory=dict)
    """For meta.json: what found them, and what speaks against the pair."""

    @cached_property
    def left(self) -> RGBD:
        """The left picture with the depth of its disparity."""
        return self._with_depth(0, self.rig.left)

    @cached_property
    def right(self) -> RGBD:
        """The right picture with the depth of its disparity."""
        return self._with_depth(1, self.rig.right)

    def _with_depth(self, place: int, camera: Camera) -> RGBD:
        depth = depth_in_metres(self.disparities[place], self.rig, self.far)
        step = MATCH_NOISE_PX / (self.rig.left.fx * self.rig.baseline_m)
        return RGBD(self.colors[place], depth, camera, noise_step=step)

    @property
    def object_depth(self) -> Float32Array | None:
        """H x W metres, left: how near the removed object is, by its nearest pixel around; None: nothing is removed."""
        if self.masks is None:
            return None
        nearest = largest_object_disparity(self.disparities[0], self.masks[0])
        return RGBD(self.colors[0], depth_in_metres(nearest, self.rig, self.far), self.rig.left).depth

    def without_bleeding(self) -> MatchedPair:
        """The pair without the object's disparity where matching let it bleed over the object's edge."""
        if self.masks is None:
            return self
        left, right = (
            remove_bleeding(one, largest_object_disparity(one, mask), mask, self.rig.doffs)
            for one, mask in zip(self.disparities, self.masks)
        )
        return dataclasses.replace(self, disparities=(left, right))


def completion_of_pair(
    pair: MatchedPair,
    plan: Plan,
    before: tuple[View, View],
    views: tuple[View, View],
    scene: Scene,
    fills: Sequence[FillReport],
    seconds: dict[str, float],
    mask: Dilation = NO_DILATION,
    **about: Any,
) -> StereoCompletion:
    """The completion of a pair, with the disparities of both views, how well they agree, and the meta data.

    before, views: left and right, before filling and completed; fills, seconds, mask: as of `meta_data`; about: what became of
    the right picture, for meta.json: `right`, and where it was given `gain` and `transferred_share`.
    """
    rig, source = pair.rig, View.from_rgbd(pair.left)
    lens = {"fx": rig.left.fx, "baseline_m": rig.baseline_m, "doffs": rig.doffs}
    left, right = (disparity_from_depth(view.depth, rig) for view in views)
    agreement = consistency(views[0].color, views[1].color, left, right)
    meta = meta_data(plan, scene.frames[0].load(), before, fills, seconds, mask) | expected_errors(views)
    meta["stereo"] = {**lens, **pair.notes, **about, "consistency": dataclasses.asdict(agreement)}
    return StereoCompletion(views, before, scene, source, meta, left, right, agreement)


def without_object(pair: MatchedPair, recipe: Recipe) -> tuple[Scene, Dilation]:
    """The scene of the left picture as the recipe clips it, without the object where one is removed, and how its mask grew."""
    scene = scene_of(pair.left, recipe.clip)
    if pair.masks is None:
        return scene, NO_DILATION
    removal = remove_object(scene, pair.masks[0], recipe.dilate)
    return removal.scene, removal.mask


def with_object_depth(scene: Scene, depth: Float32Array | None) -> Scene:
    """The scene with its removed object at this depth (H x W metres), behind which all is filled; None: as it is."""
    if depth is None:
        return scene
    removed = (one.load() for one in scene.removals)
    removals = tuple(one.with_planes(depth=np.where(one.hole, one.depth, depth)) for one in removed)
    return dataclasses.replace(scene, removals=removals)


def default_far(rig: StereoRig) -> float:
    """Metres from which half a pixel of disparity cannot be distinguished from infinity."""
    return rig.left.fx * rig.baseline_m / FAR_PX


def check_pair_inputs(
    left: UInt8Array, right: UInt8Array, rig: StereoRig, far: float | None
) -> tuple[UInt8Array, UInt8Array]:
    """Both pictures as arrays. Raises ShapeError where one has not the rig's size, InputError where `far` is no distance."""
    if far is not None and not (isinstance(far, Real) and far > 0):
        raise InputError(f"`far` is {far!r} m; more than 0 is expected")
    pictures = check_color(left, "left"), check_color(right, "right")
    for name, picture in zip(("left", "right"), pictures):
        check_same_size(f"the {name} picture", picture.shape, "the calibration", rig.left.hw)
    return pictures


def masks_of_pair(
    mask: BoolArray | None, mask_right: BoolArray | None, pair: MatchedPair
) -> tuple[BoolArray, BoolArray] | None:
    """The masks of both pictures; the right one is carried over where it is not given. Raises MaskError."""
    if mask is None:
        return None
    mask = check_mask(mask, pair.rig.left.hw)
    if mask_right is None:
        return mask, carry_mask(mask, pair.disparities, pair.right)
    return mask, check_mask(mask_right, pair.rig.right.hw)


def depth_in_metres(disparity: Float32Array, rig: StereoRig, far: float) -> Float32Array:
    """H x W metres of one picture's disparity (H x W px, 0 = missing); at or beyond `far` metres it is +inf."""
    depth = depth_from_disparity(disparity, rig)
    return np.where(depth >= far, np.float32(np.inf), depth)


def largest_object_disparity(disparity: Float32Array, mask: BoolArray) -> Float32Array:
    """H x W px: the largest disparity of the object (mask, H x W bool) within OBJECT_REACH px; 0 where there is none.

    What is hidden lies behind the object; how far behind, the noise of the matched object must not decide.
    """
    none = np.float32(-1e9)  # not 0: with doffs an object may have a negative disparity
    of_object = np.where(mask & (disparity != 0), disparity, none)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * OBJECT_REACH + 1,) * 2)
    nearest = cv2.dilate(of_object, kernel)
    return np.where(nearest == none, np.float32(0), nearest)


def remove_bleeding(disparity: Float32Array, nearest: Float32Array, mask: BoolArray, doffs: float) -> Float32Array:
    """H x W px: 0 (missing) next to the object (mask) where disparity is as near as the object, else as it was.

    nearest: H x W px as `largest_object_disparity` gives it. Matching lets a nearer object bleed over its edge; the ground
    under the object is taken for it too, and is restored with the surface it belongs to.
    """
    as_near = disparity + doffs >= np.float32(AS_NEAR) * (nearest + np.float32(doffs))
    return np.where(~mask & as_near & (nearest != 0), np.float32(0), disparity)
