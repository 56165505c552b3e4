"""A picture with depth and an object's mask in; the mask of its cast shadow out.

Shapes are cast by the likeliest lights and by the sky. A network and three classifiers, trained on procedural worlds, decide
which shape is right, which pixels are shadow, and whether there is one. Only the supporting surface is covered, and what
object and shadow enclose.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import cv2
import numpy as np

from dlama.errors import warn
from dlama.geometry.holes import dilate_mask, enclosed_by, regions_touching
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.geometry.scene import Scene
from dlama.perception.masks.small import SmallPicture
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.shadows.classifier import SHADOW, shadow_probability
from dlama.perception.shadows.ground import EDGE_PX, Ground, find_ground
from dlama.perception.shadows.lit_surface import around, log_luma, measure_darkness, sky_lost
from dlama.perception.shadows.planes import shadow_planes
from dlama.perception.shadows.search import SMALLEST_PX

RIM_PX = 4
"""Border of a shadow, in which the ambient fit does not count."""


def find_shadow(rgbd: RGBD, mask: BoolArray) -> BoolArray:
    """H x W bool, True in the shadow of the object under `mask`, without the object; all False where there is none.

    What the two enclose and is no supporting surface belongs to it: a side of the object that its mask lacks. A large picture is
    searched at a smaller size.
    """
    small = SmallPicture.of(rgbd)
    if small is not None:
        return small.enlarge(find_shadow(small.rgbd, small.shrink(mask))) & ~mask
    none = np.zeros(mask.shape, np.bool_)
    ground = find_ground(rgbd, mask, find_planes_of_picture(rgbd))
    if ground is None:
        return none
    planes, crop, occlusion = shadow_planes(rgbd, mask, ground)
    probability = shadow_probability(planes)
    if probability is None:
        return none
    usable = ground.surface & ~dilate_mask(mask, EDGE_PX)
    shadow = (crop.large(probability, mask.shape) > SHADOW) & usable
    shadow |= grow_ambient_shadow(rgbd, mask, ground, usable, shadow, occlusion)
    if shadow.sum() < SMALLEST_PX:
        return none
    shadow |= grow_under_object(rgbd, mask, usable, shadow)
    contact = dilate_mask(shadow, EDGE_PX + 2) & dilate_mask(mask, EDGE_PX + 1)
    shadow = (shadow | contact) & ground.surface & ~mask
    return np.asarray(shadow | enclosed_between(mask, shadow, ground.surface))


def add_shadows(scene: Scene, masks: Iterable[BoolArray]) -> Iterator[BoolArray]:
    """The masks of an object in the layers of a scene (H x W each), of frames with its shadow; warns where none has any."""
    estimate: dict[str, object] | None = {} if scene.has_estimated_depth else None
    found = 0
    for place, mask in enumerate(masks):
        if place < len(scene.frames) and mask.any():
            frame = scene.original(place).load()
            shadow = find_shadow(RGBD(frame.color, frame.known_depth, frame.camera, estimate=estimate), mask)
            mask, found = mask | shadow, found + int(shadow.any())
        yield mask
    if not found:
        warn("no shadow of the removed object was found in any frame")


def grow_under_object(rgbd: RGBD, mask: BoolArray, usable: BoolArray, shadow: BoolArray) -> BoolArray:
    """H x W, the surface right under the object that is darker than nearly all of the shadow: no light gets under a car."""
    below = 1 + int(0.2 * np.sqrt(mask.sum()))  # px that right under it reaches
    under = cv2.dilate(mask.astype(np.uint8), np.ones((below, 1), np.uint8), anchor=(0, below - 1)) > 0
    luma = cv2.GaussianBlur(log_luma(rgbd.color), (0, 0), 1.5)  # without speckles
    darker = usable & under & (luma < np.quantile(luma[shadow], 0.1))
    return regions_touching(darker, dilate_mask(mask, EDGE_PX + 1))


def enclosed_between(mask: BoolArray, shadow: BoolArray, surface: BoolArray) -> BoolArray:
    """H x W, the regions that an object and its shadow enclose, and not the object alone, and that are less than half surface."""
    enclosed = enclosed_by(mask | shadow) & ~enclosed_by(mask)
    count, labels = cv2.connectedComponents(enclosed.astype(np.uint8))
    of_surface = np.bincount(labels[surface], minlength=count) * 2 >= np.bincount(labels.ravel(), minlength=count)
    of_surface[0] = True  # all that is not enclosed
    return ~of_surface[labels]


def grow_ambient_shadow(
    rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shadow: BoolArray, occlusion: Float32Array
) -> BoolArray:
    """H x W, the part of the surface darkened by ambient occlusion, fitted outside `shadow`.

    occlusion: H x W, `ambient_occlusion`. Where a hard shadow explains the darkness, little is left for the sky. On patterned
    surfaces, where the fit leaves .07 of the logarithm in the mean, a tenth cannot be measured.
    """
    outside = ground.surface & ~dilate_mask(shadow, RIM_PX)
    darkness = measure_darkness(rgbd, mask, outside, occlusion)
    if darkness is None:
        return np.zeros_like(shadow)
    rest = (darkness.dark - darkness.ambient)[outside & usable & around(mask)]
    if not rest.size or np.abs(rest).mean() > 0.07:
        return np.zeros_like(shadow)
    darker = usable & (darkness.share * sky_lost(occlusion) > 0.1)
    return regions_touching(darker, shadow | dilate_mask(mask, RIM_PX))
