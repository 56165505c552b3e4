"""Objects that stand in recorded pictures: a frame in; the frame with an object in it, its mask, and the frame itself, the truth
of the object's removal, out.

The object is a solid of revolution (bottle, bowl, post, ball) or a box on a level surface of the measured depth, hidden by what
is nearer. It carries a part of the bundled street as its texture. Depth has what a structured-light camera gives there: an edge
some pixels off and a band without depth on one side. No shadow is cast.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable

import cv2
import numpy as np

import dlama
from dlama.datasets.frames import RemovalTruth
from dlama.errors import InputError
from dlama.files.rasters.pictures import read_color
from dlama.geometry.holes import box_around, dilate_mask, larger_box, region_at, sides_of
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.supports import Planes, find_planes_of_picture

TRIES = 400
SHARES = (0.006, 0.12)
"""Of the picture, that the object covers."""
SEEN = 0.7
"""Least share of the object that is seen."""
UP = 0.35
"""Least cosine between a surface's normal and the camera's vertical."""
LEAST_SURFACE = 0.01
"""Least share of the picture of a surface on which objects stand."""
BASELINE, WIDEST = 0.075, 24
"""Metres between projector and camera of a Kinect; most pixels without depth next to the object."""
MISALIGNED = 2
"""Most pixels by which the object's depth lies off its colours."""
SOFT = 0.5, 1.2
"""Sigma in pixels of the object's outline."""


def standing_case(load: Callable[[], RGBD], seed: int) -> RemovalTruth:
    """The removal of the object that `seed` draws in a frame. InputError: no place was found for one."""
    case = stand_object(load(), np.random.default_rng(seed))
    if case is None:
        raise InputError("no level surface of this frame has room for an object")
    return case


def stand_object(frame: RGBD, rng: np.random.Generator) -> RemovalTruth | None:
    """The removal of an object drawn at random; None where no place was found."""
    found = find_planes_of_picture(frame)
    level = [n for n in range(len(found.planes)) if cosine_up(found, n, frame) > UP and found.share(n) > LEAST_SURFACE]
    if not level:
        return None
    places = np.argwhere(np.isin(found.label, np.array(level) + 1))
    for _ in range(TRIES):
        row, column = places[rng.integers(len(places))]
        number = int(found.label[row, column]) - 1
        w = draw_object(frame, found, number, row, column, rng)
        shape = w > 0
        if not shape.any():
            continue
        seen = shape & ((w > inverse_depth(frame.depth)) | ~frame.valid)
        border = np.concatenate([shape[0], shape[-1], shape[:, 0], shape[:, -1]]).any()
        if border or not SHARES[0] < seen.mean() < SHARES[1] or seen.sum() < SEEN * shape.sum():
            continue
        seen = region_at(seen, np.s_[:, :])
        if (frame.missing & seen).sum() > 0.4 * seen.sum():
            continue
        return RemovalTruth(compose(frame, seen, w, rng), frame, seen)
    return None


def cosine_up(found: Planes, number: int, frame: RGBD) -> float:
    """Cosine between a plane's normal and the camera's vertical."""
    normal = normal_of(found, number, frame)
    return float(-normal[1])


def normal_of(found: Planes, number: int, frame: RGBD) -> np.ndarray:
    """The unit normal of a plane, towards the camera's side (up: y < 0)."""
    a, b, c = found.planes[number]
    camera = frame.camera
    normal = np.array([a * camera.fx, b * camera.fy, a * camera.cx + b * camera.cy + c])
    normal /= np.linalg.norm(normal)
    return normal if normal[1] < 0 else -normal


def draw_object(
    frame: RGBD, found: Planes, number: int, row: int, column: int, rng: np.random.Generator
) -> Float32Array:
    """H x W inverse depth of an object that stands at a pixel of a plane; 0 elsewhere."""
    camera = frame.camera
    z = 1 / max(found.value_at(number, row, column), 1e-6)
    base = z * np.array([(column + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy, 1.0])
    up = normal_of(found, number, frame)
    side = np.cross(up, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    front = np.cross(side, up)
    height = z * rng.uniform(0.08, 0.55)
    radius = height * rng.uniform(0.15, 0.8)
    kind = rng.integers(3)
    steps = np.linspace(0, 1, 24)
    if kind == 0:  # a bottle, a bowl, a vase
        knots = rng.uniform(0.35, 1, 5)
        profile = np.interp(steps, np.linspace(0, 1, 5), knots)
    elif kind == 1:  # a ball
        radius = height / 2
        profile = np.sqrt(np.maximum(1 - (2 * steps - 1) ** 2, 0.02))
    else:  # a box
        profile = np.ones_like(steps)
    turn, wide = rng.uniform(0, np.pi), rng.uniform(0.5, 1.0) if kind == 2 else 1.0
    angles = turn + (
        np.arange(4) * np.pi / 2 + np.pi / 4 if kind == 2 else np.linspace(0, 2 * np.pi, 40, endpoint=False)
    )
    out = np.zeros(frame.depth.shape, np.float32)
    rings = []
    for step, r in zip(steps, profile * radius):
        ring = base + step * height * up + r * (np.cos(angles)[:, None] * side + wide * np.sin(angles)[:, None] * front)
        if ring[:, 2].min() < 0.1:
            return out
        rings.append(ring)
    for low, high in itertools.pairwise(rings):
        both = np.concatenate([low, high])
        pixels = np.stack(
            [both[:, 0] / both[:, 2] * camera.fx + camera.cx, both[:, 1] / both[:, 2] * camera.fy + camera.cy], 1
        )
        hull = cv2.convexHull(np.round(pixels - 0.5).astype(np.int32))
        near = np.quantile(both[:, 2], 0.25)
        part = np.zeros_like(out)
        cv2.fillConvexPoly(part, hull, 1 / near)
        out = np.maximum(out, part)
    return out


def compose(frame: RGBD, mask: BoolArray, w: Float32Array, rng: np.random.Generator) -> RGBD:
    """The frame with the object in it. mask: H x W, where it is seen; w: H x W 1/m, its inverse depth."""
    box = larger_box(box_around(mask, 0), 4, mask.shape)
    height, width = sides_of(box)
    light = np.linspace(rng.uniform(0.6, 1), rng.uniform(0.6, 1), width, dtype=np.float32)[:, None]
    picture = frame.color.astype(np.float32)
    picture[box] = cv2.resize(texture(rng), (width, height), interpolation=cv2.INTER_AREA) * light
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), rng.uniform(*SOFT))[..., None]
    color = np.round(soft * picture + (1 - soft) * frame.color).astype(np.uint8)
    return dataclasses.replace(frame, color=color, depth=depth_with(frame, mask, w, rng))


def texture(rng: np.random.Generator) -> UInt8Array:
    """Part of the bundled street, drawn at random."""
    street = read_color(dlama.example() / "street.jpg")
    side = int(rng.integers(60, 200))
    top, left = (int(rng.integers(0, n - side)) for n in street.shape[:2])
    return street[top : top + side, left : left + side]


def depth_with(frame: RGBD, mask: BoolArray, w: Float32Array, rng: np.random.Generator) -> Float32Array:
    """H x W metres of the frame and the object, as a structured-light camera gives them."""
    shown = np.roll(mask, int(rng.integers(-MISALIGNED, MISALIGNED + 1)), 1)
    shown = dilate_mask(shown, 1) if rng.random() < 0.5 else shown
    middle, behind = np.float32(np.median(w[mask])), inverse_depth(frame.depth)
    value = np.where(w > 0, w, middle)
    ahead = shown & ((value > behind) | ~frame.valid)
    depth = frame.depth.copy()
    depth[ahead] = 1 / value[ahead]
    around = dilate_mask(mask, 8) & ~mask & frame.valid
    far = float(np.median(behind[around])) if around.any() else 0.0
    blocked = np.zeros_like(mask)
    for step in range(1, 1 + int(np.clip(frame.camera.fx * BASELINE * (middle - far), 0, WIDEST))):
        blocked[:, :-step] |= ahead[:, step:]
    depth[blocked & ~ahead & (behind < 0.97 * middle)] = 0
    return depth
