"""Planes of a crop round an object in; features of cast shapes and of surface pixels out.

Of a shape: its probability from the search, its agreement with other shapes, its darkness against its surroundings and the rest
of the surface. Of a pixel: darkness at several scales against the shape's, distances, frequency of its colour on the surface
and of the same colour if it were lit, darkness on the way to the object.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.holes import box_mean, dilate_mask, distance_to, erode_square, nearest_known
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.shadows.planes import FAR, LOG_RANGE, ShadowPlanes

Place = tuple[Float32Array | np.float32, Float32Array | np.float32]
"""Column and row."""
WINDOWS = 9, 19, 41
"""Pixels of the crop over which darkness is averaged."""
STEPS = 8
"""Samples on the way to the object."""
REACH = 20.0
"""Largest distance to a shape, in pixels of the crop."""
FEWEST_PX = 6
LEAST_DEEP = 0.05
TONES = 5, 10, 25, 50, 75, 90, 95
"""Percentiles of the surface's level."""
TONE_STEPS = len(TONES) + 2
ENOUGH_PX = 30
"""Least pixels of a ring, and of the inside of a region, whose tones are compared."""


def cast_interiors(planes: ShadowPlanes) -> list[BoolArray]:
    """The visible cast shapes of the crop, the region of strong ambient occlusion, and the surface round the ground contact."""
    where = planes.surface
    cast = [np.asarray((plane > 0.5 * plane.max()) & (plane > 0) & where) for plane in planes.casts]
    return [*cast, np.asarray((planes.plane("occluded") > 0.3) & where), near_ground_contact(planes) & where]


def near_ground_contact(planes: ShadowPlanes) -> BoolArray:
    """h x w, True within .15 of the object's size of the lowest .15 of it."""
    caster = planes.caster
    low = caster & (planes.plane("height") < 0.15 / 2)
    low = low if low.any() else caster
    if not low.any():
        return low
    return np.asarray((distance_to(low) < max(5.0, 0.15 * float(np.sqrt(caster.sum())))) & ~caster)


def candidate_features(planes: ShadowPlanes, shapes: list[BoolArray]) -> Float32Array:
    """K x features of the K cast shapes; rows of nan where there is none. shapes: `cast_interiors`, and optionally one more
    region."""
    where, caster, dark = planes.surface, planes.caster, planes.plane("darkness")
    apart = distance_to(caster)
    common, raised = planes.shares[0], np.max(planes.shares[1], 0)
    probability = [*(float(plane.max()) for plane in planes.casts), 0.0, 0.0, 0.0]
    rows = []
    for number, inside in enumerate(shapes):
        if inside.sum() < FEWEST_PX:
            rows.append([np.nan] * CANDIDATE_FEATURES)
            continue
        ring, rest = surroundings(inside, where, 10)
        ring = ring if ring.sum() >= FEWEST_PX else where
        deep, around = float(np.median(dark[inside])), float(np.median(dark[ring]))
        middle = (deep + around) / 2
        ratio = planes.color[:, ring].mean(1) - planes.color[:, inside].mean(1)
        agree = [overlap(inside, other) if n != number else 0.0 for n, other in enumerate(shapes)]
        spread = float(dark[ring].std())
        rows.append(
            [
                probability[number], probability[1], *(float(number == kind) for kind in range(4)), max(agree[:2]), agree[1],
                sum(agree[:2]), deep, deep - around, float((dark[inside] > middle).mean() + (dark[ring] < middle).mean()) - 1,
                min((deep - around) / max(spread, LEAST_DEEP), 4.0), spread,
                min(float(np.abs(ratio - ratio[1]).max()) / max(float(abs(ratio[1])), 0.05), 3.0),
                float((dark[rest] > middle).mean()) if rest.sum() > 50 else 0.5,
                float(common[inside[where]].mean() - common[ring[where]].mean()), float((raised - common)[inside[where]].mean()),
                float(np.log(inside.sum() / max(float(caster.sum()), 1.0))), float(np.log(inside.sum())),
                min(float(apart[inside].min()), 40.0) / 10, float(where.mean()), float(planes.plane("ambient")[inside].mean()),
            ]
        )  # fmt: skip
    return np.array(rows, np.float32)


CANDIDATE_FEATURES = 23


def tone_steps(planes: ShadowPlanes, region: BoolArray) -> Float32Array:
    """TONE_STEPS numbers: how much lighter the surface is round a region (h x w) than in it, at each of TONES; the steps of the
    light tones and the least step, over the middle one. A shadow darkens all tones alike, joints and stains few."""
    where = planes.surface
    inside = region & where
    if inside.sum() < FEWEST_PX:
        return np.zeros(TONE_STEPS, np.float32)
    level = cv2.blur(planes.color.mean(0) * LOG_RANGE, (2, 2))
    ring = dilate_mask(region, 12) & ~dilate_mask(region, 3) & where
    ring = ring if ring.sum() >= ENOUGH_PX else where
    inner = erode_square(inside, 5)
    inner = inner if inner.sum() >= ENOUGH_PX else inside
    steps = np.percentile(level[ring], TONES) - np.percentile(level[inner], TONES)
    middle = max(float(steps[TONES.index(50)]), LEAST_DEEP)
    shares = np.clip([steps[TONES.index(90)] / middle, steps.min() / middle], -1, 2)
    return np.array([*np.clip(steps, -1, 1.5), *shares], np.float32)


def surroundings(region: BoolArray, where: BoolArray, width: float) -> tuple[BoolArray, BoolArray]:
    """h x w each: the part of `where` (h x w) more than 2 and less than `width` px round a region (h x w), and all beyond."""
    away = cv2.distanceTransform((~region).astype(np.uint8), cv2.DIST_L2, 3)
    return (away > 2) & (away < width) & where, (away >= width) & where


def overlap(one: BoolArray, other: BoolArray) -> float:
    """Intersection over the smaller."""
    return float((one & other).sum()) / max(float(min(one.sum(), other.sum())), 1.0)


def pixel_features(planes: ShadowPlanes, shape: BoolArray, probability: float) -> tuple[Float32Array, BoolArray]:
    """N x features of the N visible surface pixels, and h x w, where those are. shape: h x w, cast; probability: the shape's."""
    where, caster = planes.surface, planes.caster
    there, dark = where.astype(np.float32), planes.plane("darkness") * where
    inside = shape & where
    out = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, 3)
    within = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, 3)
    ring = (out > 2) & (out < 10) & where
    deep = float(np.median(dark[inside])) if inside.any() else 0.0
    around, surroundings = 0.0, np.zeros(3, np.float32)
    if ring.sum() >= FEWEST_PX:
        around, surroundings = float(np.median(dark[ring])), planes.color[:, ring].mean(1)
    scale = max(deep, LEAST_DEEP)
    smooth = [box_mean(dark, there, window, 1e-3) for window in WINDOWS]
    spread = np.sqrt(np.maximum(box_mean(dark * dark, there, WINDOWS[1], 1e-3) - smooth[1] ** 2, 0))
    apart, nearest = nearest_object_pixel(caster)
    tall = max(float(np.sqrt(caster.sum())), 4.0)
    right, away = (FAR * np.arctanh(np.clip(plane, -0.999, 0.999)) for plane in map(planes.plane, ("right", "away")))
    ratio = planes.color - surroundings[:, None, None]
    flat = [dark, *smooth, spread, box_mean(there, np.ones_like(there), WINDOWS[1])]
    flat += [np.clip(each / scale, -1.5, 2.5) for each in (dark, smooth[0], smooth[1])]
    flat += [np.clip((out - within) / REACH, -1, 1), np.exp(-out / 5), np.clip((out - within) / tall, -1, 2)]
    flat += [ratio[0] - ratio[1], ratio[2] - ratio[1], ratio[1]]
    flat += [np.log(np.hypot(right, away) + 0.1), np.clip(away, -4, 4), np.log(apart + 1), np.minimum(apart / tall, 3)]
    flat += [
        np.clip(mean_towards(smooth[0], there, target) / scale, -1, 2) for target in (nearest, ground_contact(caster))
    ]
    ambient = planes.plane("ambient")
    flat += [planes.plane("occluded"), ambient, np.clip(ambient / scale, 0, 2.5)]
    columns = [np.asarray(plane, np.float32)[where] for plane in flat]
    common, raised = planes.shares
    columns += [common, *(each - common for each in raised)]
    columns += [np.full(len(common), value, np.float32) for value in (probability, deep, deep - around)]
    return np.stack(columns, 1).astype(np.float32), where


def nearest_object_pixel(caster: BoolArray) -> tuple[Float32Array, Place]:
    """Distance to the object (h x w), and column and row of its nearest pixel (h x w each)."""
    if not caster.any():
        return np.full(caster.shape, 64, np.float32), (np.float32(0), np.float32(0))
    apart, nearest = nearest_known(caster)
    rows, columns = np.divmod(nearest, caster.shape[1])
    return apart, (columns.astype(np.float32), rows.astype(np.float32))


def ground_contact(caster: BoolArray) -> Place:
    """Column and row of the middle of the ground contact."""
    rows, columns = np.nonzero(caster)
    if not len(rows):
        return np.float32(0), np.float32(0)
    low = rows >= rows.max() - 0.1 * np.ptp(rows)
    return np.float32(np.median(columns[low])), np.float32(np.median(rows[low]))


def mean_towards(values: Float32Array, there: Float32Array, target: Place) -> Float32Array:
    """h x w mean of `values` over the visible surface on the way from each pixel to its target, or all pixels to one."""
    rows, columns = (each.astype(np.float32) for each in np.mgrid[: values.shape[0], : values.shape[1]])
    total, count = np.zeros_like(values), np.full(values.shape, 1e-3, np.float32)
    for share in (np.arange(STEPS) + 0.5) / STEPS:
        x = (columns + share * (target[0] - columns)).astype(np.float32)
        y = (rows + share * (target[1] - rows)).astype(np.float32)
        total += cv2.remap(values * there, x, y, cv2.INTER_NEAREST)
        count += cv2.remap(there, x, y, cv2.INTER_NEAREST)
    return np.asarray(total / count, np.float32)
