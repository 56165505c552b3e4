"""A view with holes and guesses at it in; the judge's input planes, all in 0..1 and independent of scale, out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.codes import HoleType
from dlama.geometry.holes import nearest_known, smaller_size
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View

CONTEXT = ("red", "green", "blue", "depth", "disoccluded", "out of view", "object", "distance", "colour hole", "hole")
"""Planes that all guesses share: known pixels (0 in the hole), hole types, distance to known pixels."""
GUESS = ("red", "green", "blue", "depth")
"""Planes of one guess."""
TYPES = (HoleType.DISOCCLUDED, HoleType.OUT_OF_VIEW, HoleType.OBJECT)
"""Hole types with a plane of their own."""
FARTHEST = 512.0
"""Distance to known pixels, in px, that is 1 in its plane."""
LARGEST = 640
"""Longer side in pixels of the judge's planes; larger views are shrunk."""
MULTIPLE = 16
"""Height and width of the planes are multiples of this."""


@dataclass(frozen=True, eq=False)
class JudgePlanes:
    """The judge's input for a view, in the view's size or smaller."""

    context: Float32Array
    """C x h x w, in the order of CONTEXT."""
    guesses: Float32Array
    """K x 4 x h x w, in the order of GUESS; known pixels are the view's."""

    @classmethod
    def of(cls, view: View, colors: Sequence[UInt8Array], inverse_depths: Sequence[Float32Array]) -> JudgePlanes:
        """Planes of a view and of the colours (H x W x 3) and inverse depths (H x W, 1/m) of its guesses."""
        scale = depth_scale(view)
        guesses = [
            stack_small([*color.transpose(2, 0, 1) / np.float32(255), nearness(w, scale)])
            for color, w in zip(colors, inverse_depths)
        ]
        return cls(stack_small(context_planes(view, scale)), np.stack(guesses))

    def pad(self) -> JudgePlanes:
        """The planes with rows and columns repeated at the lower and right border, so that sides are multiples of MULTIPLE."""
        height, width = self.context.shape[1:]
        by = ((0, 0), (0, -height % MULTIPLE), (0, -width % MULTIPLE))
        return JudgePlanes(np.pad(self.context, by, mode="edge"), np.pad(self.guesses, ((0, 0), *by), mode="edge"))


def stack_small(planes: Iterable[np.ndarray]) -> Float32Array:
    """C x h x w: planes (H x W each), one by one made smaller where their longer side is larger than LARGEST pixels."""
    return np.stack([shrink_plane(np.asarray(plane, np.float32)) for plane in planes])


def shrink_plane(plane: Float32Array) -> Float32Array:
    """H x W; smaller where its longer side is larger than LARGEST pixels."""
    if max(plane.shape) <= LARGEST:
        return plane
    return np.asarray(cv2.resize(plane, smaller_size(plane.shape, LARGEST), interpolation=cv2.INTER_AREA), np.float32)


def context_planes(view: View, scale: float) -> Iterator[np.ndarray]:
    """H x W each, in the order of CONTEXT; scale: the inverse depth (1/m) at 0.5."""
    yield from (view.color * ~view.hole[..., None]).transpose(2, 0, 1) / np.float32(255)
    yield nearness(inverse_depth(view.known_depth), scale)
    yield from (view.hole & (view.hole_type == kind) for kind in TYPES)
    yield distance_plane(view.hole)
    yield view.color_hole
    yield view.hole


def depth_scale(view: View) -> float:
    """The inverse depth (1/m) that is 0.5: the median of the view's known surfaces."""
    known = view.depth[view.valid]
    return 1 / float(np.median(known)) if known.size else 1.0


def nearness(w: Float32Array, scale: float) -> Float32Array:
    """H x W in 0..1 of inverse depth (1/m): 0 = far, 0.5 = `scale`, 1 = at the camera."""
    return np.asarray(w / (w + np.float32(scale)), np.float32)


def distance_plane(hole: BoolArray) -> Float32Array:
    """H x W in 0..1: logarithm of the distance to the nearest known pixel, of FARTHEST pixels at 1."""
    distance, _ = nearest_known(~hole)
    return np.minimum(np.log1p(distance) / np.float32(np.log1p(FARTHEST)), 1).astype(np.float32)
