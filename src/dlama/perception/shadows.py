"""A picture with depth and the mask of a thing in; the shadow that the thing casts on the surface it stands on out.

The surface is a plane. A shadow on it is the thing's own shape thrown along the light, and darker than the lit surface by a
nearly constant ratio in every channel. Where no direction of light explains one with certainty there is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.holes import dilated
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.supports import Planes, planes_of
from dlama.perception.planes import plane_values
from dlama.perception.shadow_search import SHARP, SOFT, Scale, Thrown, best_direction, pixels_of

DARKER = 0.1
"""Natural logarithm by which a shadow is darker at least; a tenth."""
WINDOW_PX = 5
"""Darkness is averaged over so many pixels where the shape is grown."""
EDGE_PX = 2
"""Pixels round the thing that are mixes of it and its surroundings."""
AROUND = 1.6
"""The lit surface is looked at as far from the thing as this many times its diagonal in the picture."""
ROUNDS = 8
"""Of the robust fit of the lit surface, and of growing."""
PLAIN = 4.0
"""A surface is plain where a shadow is darker by so many standard deviations of its lit part: it may be followed far."""
SOFT_WINDOW_PX, SOFT_EVEN, FADED = 15, 0.035, 0.75
"""Shadows fade over a surface whose darkness over such windows has at most this standard deviation; less dark is less than this
share of the shadow's own darkness: what is darker is another thing's."""
MORE = 1.01
"""Factor by which a shadow grows in a round, at least."""
POINTS = 8000
"""Pixels of the thing that are thrown for each direction of light."""
FEATURES = "strength over next best", "strength", "step", "even and clear", "contrast", "off in colour", "over pattern"
"""What speaks for a thrown shape being a shadow: `features_of`."""
WEIGHTS = {
    SHARP: (3.027, 1.401, 0.903, 3.322, 0.765, -1.893, 0.079, -1.249),
    SOFT: (2.148, 0.585, -1.594, 1.615, 3.260, 0.527, 0.250, -4.860),
}
"""Of FEATURES at each scale, and a constant; fitted on 120 worlds by `python benchmarks/shadows.py train`."""
CERTAIN = 0.6
"""Least probability of a shadow: of worlds held out 84 % of the right shapes are taken, and 95 % of those taken are right."""
PLAIN_CERTAIN = 0.2
"""The same of soft borders where the surface is plain: wrong shapes come from patterns."""
BENT = 0.2
"""Share by which estimated inverse depth of the ground may differ from its plane."""
SMALLEST_PX = 25
LARGEST = 4.0
"""A shadow covers no more pixels than this many times the thing."""


@dataclass(frozen=True, eq=False)
class Ground:
    """The surface that a thing stands on."""

    normal: NDArray[np.float64]
    """n of the plane n . p = 1 over points in camera axes, 1/m; the camera is on its side where n . p < 1."""
    surface: BoolArray
    """H x W, True where it is seen."""


def find_shadow(rgbd: RGBD, mask: BoolArray, found: Planes | None = None) -> BoolArray:
    """H x W bool, True in the shadow of the thing under `mask`, which is no part of it; False everywhere where there is none.

    found: the planes of the picture, where they are known already.
    """
    none = np.zeros(mask.shape, np.bool_)
    ground = ground_of(rgbd, mask, found or planes_of(rgbd))
    if ground is None:
        return none
    usable = ground.surface & ~dilated(mask, EDGE_PX)
    for scale, weights in WEIGHTS.items():
        thrown = thrown_shape(rgbd, mask, ground, usable, scale)
        plain = scale == SOFT and is_plain(rgbd, mask, ground, usable)
        if thrown is not None and certainty(thrown[1], weights) >= (PLAIN_CERTAIN if plain else CERTAIN):
            shadow = in_picture(rgbd, mask, ground, usable, thrown[0])
            return none if shadow is None or shadow.sum() > LARGEST * mask.sum() else shadow
    return none


def ground_of(rgbd: RGBD, mask: BoolArray, found: Planes) -> Ground | None:
    """The plane that holds most of what is seen just below and beside the lower part of the thing; None where there is none."""
    rows = np.flatnonzero(mask.any(1))
    if not len(rows) or not len(found.planes):
        return None
    lower = np.zeros(mask.shape, np.bool_)
    lower[int(rows[0] + 0.6 * (rows[-1] - rows[0])) :] = True
    ring = dilated(mask, 6) & ~mask & lower
    counts = np.bincount(found.label[ring & (found.label > 0)], minlength=len(found.planes) + 1)
    number = int(counts.argmax())
    if number < 1 or counts[number] < 10:
        return None
    camera = rgbd.camera
    a, b, c = found.planes[number - 1]
    normal = np.array([a * camera.fx, b * camera.fy, a * camera.cx + b * camera.cy + c])
    surface = found.label == number
    if rgbd.estimate is not None:  # estimated ground bends
        value = plane_values(found.planes[number - 1 : number], mask.shape)[0]
        surface = np.abs(value - found.w) < BENT * found.w
    return Ground(normal, np.asarray(surface & rgbd.valid & ~mask))


def darkness(rgbd: RGBD, mask: BoolArray, surface: BoolArray, window: int) -> Float32Array | None:
    """H x W: natural logarithm of the lit surface's luma over what is seen, averaged over
    windows; 0 off the surface. None: too little is seen.

    The lit surface is a quadratic over pixels, fitted so that what is much darker counts less each round (Tukey's weights, the
    darker side cut sooner).
    """
    near = around(mask)
    usable = surface & near & ~dilated(mask, EDGE_PX)
    if usable.sum() < 200:
        return None
    luma = cv2.cvtColor(rgbd.color, cv2.COLOR_RGB2GRAY).astype(np.float32) + 4
    level = np.log(luma)
    inside = (surface & ~dilated(mask, EDGE_PX)).astype(np.float32)
    size = (window, window)
    total, count = cv2.blur(level * inside, size), cv2.blur(inside, size)
    smooth = np.where(count > 0, total / np.maximum(count, 1e-6), level)
    v, u = np.nonzero(usable)
    keep = slice(None, None, max(1, len(v) // 20000))
    v, u = v[keep], u[keep]
    value = smooth[v, u].astype(np.float64)
    height, width = mask.shape
    design = quadratic(u / width, v / height)
    weight = np.ones(len(v))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        fit = np.linalg.lstsq(design * root[:, None], value * root, rcond=None)[0]
        off = value - design @ fit
        spread = max(1.4826 * float(np.median(np.abs(off))), 0.02)
        scaled = off / np.where(off < 0, 2.0 * spread, 4.0 * spread)
        weight = np.clip(1 - scaled**2, 0, None) ** 2 + 1e-6
    rows, columns = np.nonzero(surface & near)
    lit = quadratic(columns / width, rows / height) @ fit
    out = np.zeros(mask.shape, np.float32)
    out[rows, columns] = lit - smooth[rows, columns]
    return out


def quadratic(u: np.ndarray, v: np.ndarray) -> NDArray[np.float64]:
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], 1).astype(np.float64)


def around(mask: BoolArray) -> BoolArray:
    """H x W, True in the box of the mask grown by AROUND of its diagonal."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    reach = int(AROUND * np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1))
    out = np.zeros(mask.shape, np.bool_)
    out[max(rows[0] - reach, 0) : rows[-1] + reach + 1, max(columns[0] - reach, 0) : columns[-1] + reach + 1] = True
    return out


def unevenness(dark: Float32Array, usable: BoolArray) -> float:
    """Standard deviation of the darkness of the lit surface, from its brighter half: shadows are in the darker one."""
    values = dark[usable & (dark < 0)]
    return 1.4826 * float(np.median(np.abs(values))) if values.size > 50 else 0.0


def thrown_shape(
    rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, scale: Scale
) -> tuple[BoolArray, NDArray[np.float64]] | None:
    """The thing's shape thrown over the surface (H x W bool) by the light that explains most, and what speaks for it: FEATURES.

    None where no light throws a shape on what is seen. usable: H x W, True where the surface is seen.
    """
    points, rise = thing_points(rgbd, mask, ground)
    if len(points) < SMALLEST_PX:
        return None
    up = -ground.normal / np.linalg.norm(ground.normal)
    foot = points - rise[:, None] * up
    found = best_direction(foot, rise, up, rgbd, usable, scale)
    if found is None:
        return None
    shape = filled_shape(foot + rise[:, None] * found.over, rgbd, usable)
    ring = ring_of(shape, usable)
    if shape.sum() < SMALLEST_PX or ring.sum() < SMALLEST_PX:
        return None
    return shape, np.array([*features_of(rgbd, shape, ring, found)])


def features_of(rgbd: RGBD, shape: BoolArray, ring: BoolArray, found: Thrown) -> tuple[float, ...]:
    """What speaks for a thrown shape being a shadow, in the order of FEATURES. ring: H x W, True on the surface round it."""
    level = np.log(rgbd.color.astype(np.float32) + 4)
    inside, outside = level[shape], level[ring]
    ratio = outside.mean(0) - inside.mean(0)
    contrast = float(ratio.mean())
    middle = float(np.median(inside[:, 1]) + np.median(outside[:, 1])) / 2
    return (
        float(np.log(max(found.strength / max(found.next_best, 1.0), 0.1))),
        float(np.log(max(found.strength, 1.0))),
        float(np.log(max(found.step, 0.003))),
        float((inside[:, 1] < middle).mean() + (outside[:, 1] > middle).mean()) - 1,
        float(np.log(np.clip(contrast, 0.03, 1.0))),
        min(float(np.abs(ratio - ratio[1]).max()) / max(contrast, 0.05), 2.0),
        float(np.clip(contrast / max(float(outside[:, 1].std()), 0.05), 0, 4)),
    )


def certainty(features: NDArray[np.float64], weights: tuple[float, ...]) -> float:
    """Probability (0..1) that a thrown shape is the thing's shadow: a logistic regression, fitted on worlds
    (`benchmarks/shadows.py`)."""
    return float(1 / (1 + np.exp(-(features @ np.array(weights[:-1]) + weights[-1]))))


def reach_of(shape: BoolArray) -> int:
    """Pixels by which a thrown shape may be off: a tenth of its size."""
    return 4 + round(0.1 * float(np.sqrt(shape.sum())))


def ring_of(shape: BoolArray, usable: BoolArray) -> BoolArray:
    """The surface round a thrown shape, as far from it as it may be off."""
    return np.asarray(usable & dilated(shape, reach_of(shape) + 4) & ~dilated(shape, 4))


def filled_shape(points: NDArray[np.float64], rgbd: RGBD, usable: BoolArray) -> BoolArray:
    """H x W: where N x 3 points in camera axes fall, gaps between them closed, on `usable`."""
    shape = np.zeros(usable.shape, np.uint8)
    shape.ravel()[pixels_of(points, rgbd)] = 1
    return np.asarray(usable & (cv2.morphologyEx(shape, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)) > 0))


def in_picture(rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shape: BoolArray) -> BoolArray | None:
    """The shadow of which `shape` was thrown: with what touches it and is darker than half of its darkness, which the thing's
    hidden side casts, and with the contact line. None: too little of the surface is seen."""
    dark = darkness(rgbd, mask, ground.surface, WINDOW_PX)
    if dark is None or not shape.any():
        return None
    deep = max(DARKER, float(np.median(dark[shape])))
    even = deep > PLAIN * unevenness(dark, usable)
    shadow = shape
    for _ in range(ROUNDS if even else 1):
        near = usable & dilated(shadow, max(2, reach_of(shape) // 2))
        about = touching(near & (dark > deep / 2), shape).astype(np.uint8)
        larger = shadow | (cv2.morphologyEx(about, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0)
        if larger.sum() < MORE * shadow.sum():
            break
        shadow = larger
    shadow |= fading(rgbd, mask, ground, usable, shadow, deep)
    contact = dilated(shadow, EDGE_PX + 2) & dilated(mask, EDGE_PX + 1)
    return np.asarray((shadow | contact) & ground.surface & ~mask)


def is_plain(rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray) -> bool:
    """True where the lit surface shows no pattern, averaged over SOFT_WINDOW_PX."""
    dark = darkness(rgbd, mask, ground.surface, SOFT_WINDOW_PX)
    return dark is not None and unevenness(dark, usable) <= SOFT_EVEN


def fading(rgbd: RGBD, mask: BoolArray, ground: Ground, usable: BoolArray, shadow: BoolArray, deep: float) -> BoolArray:
    """What goes on from a shadow, less dark, down to DARKER: where the surface is plain enough for that to be told."""
    dark = darkness(rgbd, mask, ground.surface, SOFT_WINDOW_PX)
    if dark is None or unevenness(dark, usable) > SOFT_EVEN:
        return np.zeros_like(shadow)
    less = usable & (dark > DARKER) & (dark < FADED * deep)
    opened = cv2.morphologyEx(less.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8)) > 0
    both = touching(opened | shadow, shadow)
    beyond = both & ~dilated(shadow, SOFT_WINDOW_PX // 2 + 1)  # a hard border, averaged, fades over half the window
    return both if beyond.sum() > 0.5 * shadow.sum() else np.zeros_like(shadow)


def thing_points(rgbd: RGBD, mask: BoolArray, ground: Ground) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """N x 3 points of the thing in camera axes, and their heights over the surface in metres.

    Where depth is estimated, which leans things against the ground, the thing stands upright at the depth of its foot.
    """
    rows, columns = np.nonzero(mask & rgbd.valid)
    keep = slice(None, None, max(1, len(rows) // POINTS))
    directions, depth = rays(rgbd.camera)[rows[keep], columns[keep]], rgbd.depth[rows[keep], columns[keep]]
    if rgbd.estimate is not None and len(rows):
        foot = rays(rgbd.camera)[rows[-1], int(np.median(columns[rows > rows[-1] - 3]))]
        depth = np.full_like(depth, 1 / max(float(foot @ ground.normal), 1e-6))
    points = directions * depth[:, None]
    rise = (1 - points @ ground.normal) / np.linalg.norm(ground.normal)
    return points, np.maximum(rise, 0)


def touching(where: BoolArray, other: BoolArray) -> BoolArray:
    """The 8-connected regions of `where` that touch `other`."""
    _, labels = cv2.connectedComponents(where.astype(np.uint8), connectivity=8)
    numbers = np.unique(labels[where & other])
    return np.asarray(np.isin(labels, numbers) & where)
