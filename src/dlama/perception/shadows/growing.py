"""A cast shape and the picture in; the shadow extended to where it ends, on surfaces without pattern, out.

The shadow of the object's hidden side touches the shape and is as dark. On overcast days it fades with the ambient occlusion.
On patterned surfaces darkness decides nothing, and nothing is added.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.holes import dilate_mask, morphological_open, regions_touching, square
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.shadows.ground import Ground
from dlama.perception.shadows.lit_surface import around, measure_darkness, sky_lost

DARKER = 0.1
"""Least darkness of a shadow (natural logarithm): a tenth."""
PLAIN = 4.0
"""Least darkness of the shadow, in standard deviations of the lit surface, for the surface to count as plain."""
EVEN, RIM_PX = 0.07, 4
"""Largest residual of the ambient fit (mean of the logarithm), outside the shadow's border, for ambient shadows to be used."""
ROUNDS, MORE = 8, 1.01
"""Rounds of growing, and the least factor of growth in a round."""


def grow_shadow(rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shape: BoolArray) -> BoolArray:
    """H x W, `shape` with connected pixels darker than half its darkness."""
    darkness = measure_darkness(rgbd, mask, ground.surface, None)
    if darkness is None or not shape.any():
        return np.zeros_like(shape)
    dark = darkness.dark
    deep = max(DARKER, float(np.median(dark[shape])))
    shadow = np.zeros_like(shape)
    if deep > PLAIN * unevenness(dark, usable):
        shadow = shape
        for _ in range(ROUNDS):
            near = usable & dilate_mask(shadow, growth_px(shape))
            larger = shadow | morphological_open(regions_touching(near & (dark > deep / 2), shape), square(3))
            if larger.sum() < MORE * shadow.sum():
                break
            shadow = larger
    return shadow


def grow_ambient_shadow(
    rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shadow: BoolArray, occlusion: Float32Array
) -> BoolArray:
    """H x W, the part of the surface darkened by ambient occlusion, fitted outside `shadow`.

    occlusion: H x W, `ambient_occlusion`. Where a hard shadow explains the darkness, little is left for the sky. On patterned
    surfaces a tenth cannot be measured.
    """
    outside = ground.surface & ~dilate_mask(shadow, RIM_PX)
    darkness = measure_darkness(rgbd, mask, outside, occlusion)
    if darkness is None:
        return np.zeros_like(shadow)
    rest = (darkness.dark - darkness.ambient)[outside & usable & around(mask)]
    if not rest.size or np.abs(rest).mean() > EVEN:
        return np.zeros_like(shadow)
    darker = usable & (darkness.share * sky_lost(occlusion) > DARKER)
    return regions_touching(darker, shadow | dilate_mask(mask, RIM_PX))


def growth_px(shape: BoolArray) -> int:
    """Largest growth in px in one round: a twentieth of the shape's size."""
    return 2 + round(0.05 * float(np.sqrt(shape.sum())))


def unevenness(dark: Float32Array, usable: BoolArray) -> float:
    """Standard deviation of the darkness of the lit surface, from its brighter half: shadows are in the darker one."""
    values = dark[usable & (dark < 0)]
    return 1.4826 * float(np.median(np.abs(values))) if values.size > 50 else 0.0
