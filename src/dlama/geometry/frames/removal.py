"""A scene and the masks of objects in each of its layers in; the scene without the objects, its masks grown, out."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from dlama.arguments import check_count
from dlama.errors import MaskError
from dlama.geometry.codes import HoleType
from dlama.geometry.frames.choosing import sample_view
from dlama.geometry.frames.stored import BoxedView, StoredView, coarse_depth
from dlama.geometry.holes import box_around, dilate_mask
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.progress import begin_stage


class Growth(NamedTuple):
    """Growth of masks before their pixels leave the frames."""

    px: int
    reason: str
    """For meta.json."""


class Dilation(NamedTuple):
    """What growing masks or a hole cost."""

    pixels: int
    """Of the masks or the hole, before they grew."""
    known_pixels_given_up: int
    """Known pixels that they grew over."""


NO_DILATION = Dilation(0, 0)


class Removal(NamedTuple):
    """Result of a removal."""

    scene: Scene
    """Without the object, and without fills made while it was visible."""
    growth: Growth
    mask: Dilation
    """Of the masks of all frames together."""


def mask_growth(scene: Scene, dilate: int | None = None) -> Growth:
    """`dilate` px where given; else 3, as compression and blur spread an object's colours, and in proportion more in pictures of
    more than 1024 px."""
    check_count(dilate, "dilate", 0)
    if dilate is not None:
        return Growth(int(dilate), "as given")
    widest = max(max(frame.camera.wh) for frame in scene.frames)
    return Growth(round(3 * max(1.0, widest / 1024)), f"by the picture's longer side, {widest} px")


def remove_masked(scene: Scene, masks: Iterable[BoolArray], growth: Growth) -> Removal:
    """The scene as it was measured, without what the masks of its layers (H x W each) mark. MaskError: a grown mask is full."""
    layers, removed, before, given_up = [], [], 0, 0
    count = len(scene.frames)
    for place, (layer, one) in enumerate(zip(scene.unfilled.layers, masks)):
        if count > 1:
            begin_stage(f"remove from frame {place + 1} of {count}")
        larger, view = dilate_mask(one, growth.px), layer.load()
        if (larger | (view.hole_type == HoleType.OBJECT.value)).all():
            raise MaskError(
                f"`dilate` is {growth.px} px: the mask grown by that is full and leaves nothing to fill from"
            )
        before, given_up = before + int(one.sum()), given_up + int(larger.sum()) - int(one.sum())
        if larger.any():
            part = part_under_mask(view, one, larger)
            removed.append(part if count == 1 else crop_layer(part, larger))
            layer = layer.without(larger, HoleType.OBJECT if place < count else HoleType.NONE)
            if isinstance(layer, StoredView):  # what choosing frames asks of it, while the frame is in memory
                layer.find_once(sample_view), layer.find_once(coarse_depth)
        layers.append(layer)
    without = dataclasses.replace(
        scene.unfilled,
        frames=tuple(layers[:count]),
        removals=(*scene.removals, *removed),
        fills=tuple(layers[count:]),
    )
    return Removal(without, growth, Dilation(before, given_up))


def part_under_mask(view: View, mask: BoolArray, larger: BoolArray) -> View:
    """The removed part of a layer: the pixels under its grown mask (`larger`); the hole type OBJECT is the mask itself."""
    part = view.without(~larger, HoleType.NONE)
    return part.with_planes(hole_type=np.where(mask, np.uint8(HoleType.OBJECT), part.hole_type))


def crop_layer(view: View, where: BoolArray) -> BoxedView:
    """A view that is a hole outside `where` (H x W, not empty), in a box round that."""
    return BoxedView(view.camera, view.cropped(*box_around(where, 1)))
