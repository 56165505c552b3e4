"""A picture with depth and the mask of an object in; the shadow that the object casts on the surface it stands on out.

Shapes are thrown by the lights that explain most and by the sky; a network and three classifiers made on procedural worlds say
which of them is right, which pixels are in the shadow, and whether there is one at all. Only the surface is ever covered, never
another object.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.holes import dilate_mask, regions_touching
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.masks.supports import Planes, find_planes_of_picture
from dlama.perception.shadows.cast import SMALLEST_PX
from dlama.perception.shadows.classifier import SHADOW, shadow_probability
from dlama.perception.shadows.contrast import has_contrast
from dlama.perception.shadows.ground import EDGE_PX, find_ground
from dlama.perception.shadows.growing import grow_ambient_shadow, grow_shadow
from dlama.perception.shadows.planes import shadow_planes

NEAR_PX = 5
"""A shadow touches the shape that was thrown, or comes so near the object."""
PLAUSIBLE = 0.1
"""What darkness alone adds has this mean probability at least: elsewhere it is a rug or the pattern that is dark."""
FAINT = 0.02
"""And what the sky explains this one: it is faint."""
TRUSTED = 0.8
"""From this certainty on a shadow need not stand out from the surface's pattern."""
LARGEST = 4.0
"""It covers no more pixels than this many times the object."""


def find_shadow(rgbd: RGBD, mask: BoolArray, found: Planes | None = None) -> BoolArray:
    """H x W bool, True in the shadow of the object under `mask`, which is no part of it; False everywhere where there is none.

    found: the planes of the picture, where they are known already.
    """
    none = np.zeros(mask.shape, np.bool_)
    ground = find_ground(rgbd, mask, found or find_planes_of_picture(rgbd))
    if ground is None:
        return none
    planes, crop, occlusion = shadow_planes(rgbd, mask, ground)
    answer = shadow_probability(planes)
    if answer is None:
        return none
    probability, shape = (crop.large(each.astype(np.float32), mask.shape) for each in answer[:2])
    certain = answer[2]
    usable = ground.surface & ~dilate_mask(mask, EDGE_PX)
    thrown = (shape > 0.5) & usable
    shadow = regions_touching((probability > SHADOW) & usable, thrown | dilate_mask(mask, NEAR_PX))
    further = grow_shadow(rgbd, mask, ground, usable, thrown) & ~shadow
    if further.any() and probability[further].mean() > PLAUSIBLE:
        shadow |= further
    soft = grow_ambient_shadow(rgbd, mask, ground, usable, shadow, occlusion) & ~shadow
    if soft.any() and probability[soft].mean() > FAINT:
        shadow |= soft
    if not SMALLEST_PX <= shadow.sum() <= LARGEST * mask.sum():
        return none
    if certain < TRUSTED and not has_contrast(rgbd, shadow, usable):
        return none
    contact = dilate_mask(shadow, EDGE_PX + 2) & dilate_mask(mask, EDGE_PX + 1)
    return np.asarray((shadow | contact) & ground.surface & ~mask)
