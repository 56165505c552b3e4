"""A shape that was thrown, and the picture, in; the shadow that goes on from it where the surface is plain enough out.

What the thing's hidden side casts touches the shape and is as dark; soft borders fade. On patterns darkness alone tells neither,
and nothing is added.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.holes import dilated, opened, square, touching
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.shadows.ground import Ground, darkness

DARKER = 0.1
"""Natural logarithm by which a shadow is darker at least; a tenth."""
PLAIN = 4.0
"""A surface is plain where a shadow is darker by so many standard deviations of its lit part: it may be followed far."""
SOFT_WINDOW_PX, SOFT_EVEN, FADED = 15, 0.035, 0.75
"""Shadows fade over a surface whose darkness over such windows has at most this standard deviation; less dark is less than this
share of the shadow's own darkness: what is darker is another thing's."""
ROUNDS, MORE = 8, 1.01
"""Of growing, and the factor by which a shadow grows in a round, at least."""


def grown(
    rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shape: BoolArray, dark: Float32Array | None
) -> BoolArray:
    """H x W: `shape` with what touches it and is darker than half of its darkness, and what fades from that.

    dark: H x W, `darkness` of the surface.
    """
    if dark is None or not shape.any():
        return np.zeros_like(shape)
    deep = max(DARKER, float(np.median(dark[shape])))
    shadow = np.zeros_like(shape)
    if deep > PLAIN * unevenness(dark, usable):
        shadow = shape
        for _ in range(ROUNDS):
            near = usable & dilated(shadow, growth_px(shape))
            larger = shadow | opened(touching(near & (dark > deep / 2), shape), square(3))
            if larger.sum() < MORE * shadow.sum():
                break
            shadow = larger
    return shadow | fading(rgbd, mask, ground, usable, shape | shadow, deep)


def growth_px(shape: BoolArray) -> int:
    """Pixels by which a shadow may grow in one round: a twentieth of the shape's size."""
    return 2 + round(0.05 * float(np.sqrt(shape.sum())))


def unevenness(dark: Float32Array, usable: BoolArray) -> float:
    """Standard deviation of the darkness of the lit surface, from its brighter half: shadows are in the darker one."""
    values = dark[usable & (dark < 0)]
    return 1.4826 * float(np.median(np.abs(values))) if values.size > 50 else 0.0


def fading(rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shadow: BoolArray, deep: float) -> BoolArray:
    """What goes on from a shadow, less dark, down to DARKER: where the surface is plain enough for that to be told."""
    dark = darkness(rgbd, mask, ground.surface, SOFT_WINDOW_PX)
    if dark is None or unevenness(dark, usable) > SOFT_EVEN:
        return np.zeros_like(shadow)
    less = usable & (dark > DARKER) & (dark < FADED * deep)
    both = touching(opened(less, square(5)) | shadow, shadow)
    beyond = both & ~dilated(shadow, SOFT_WINDOW_PX // 2 + 1)  # a hard border, averaged, fades over half the window
    return both if beyond.sum() > 0.5 * shadow.sum() else np.zeros_like(shadow)
