"""The visibility law: fills never hide measurements. Depth in; violations, or depth projected onto the law, out.

Seen from a source camera, filled depth is never in front of what was measured there (tolerance: the larger of 1 mm and 0.1 %),
and covers no far pixel. A removed object's own depth counts as measured: its background lies behind it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.arguments import check_arguments
from dlama.geometry.camera import Camera
from dlama.geometry.codes import from_source
from dlama.geometry.drawing.picture_edges import align_edges
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import square
from dlama.geometry.kernels import visibility as kernels
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.projection import px_from_px
from dlama.geometry.rgbd import BoolArray, Float32Array, is_valid
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

BAND = 8192
"""Pixels per task."""
MAX_ROUNDS = 8
"""Passes over all source cameras, after which remaining violations are put at infinity."""

_aligned: WeakKeyDictionary[Law, tuple[tuple[Layer, ...], Law]] = WeakKeyDictionary()
"""A law, the frames that its edges were last aligned by, and what came of it: cameras of one scene ask for the same."""


@dataclass(frozen=True, eq=False)
class Law:
    """Measurements of the source cameras: for each, H x W depth in metres, 0 = none, +inf = far."""

    measured: tuple[tuple[Camera, Float32Array], ...] = field(repr=False)
    misplaced_edges: bool = False
    """True where measured depth edges are misaligned with the picture (`with_aligned_edges`), as a sensor's are."""

    @classmethod
    def of(cls, scene: Scene) -> Law:
        """The law of a scene's measured layers and removed objects, held in memory; of many frames, within their noise."""
        check_arguments(cls.of, locals())
        measured: list[tuple[Camera, Float32Array]] = []
        for layer in (*scene.layers, *scene.removals):
            if not layer.shows_source:
                continue
            layer = layer.load()
            others = ~from_source(layer.origin) & (layer.depth != 0)
            depth = np.where(others, np.float32(0), layer.depth) if others.any() else layer.depth
            for number, (camera, known) in enumerate(measured):
                if camera.same_view_as(layer.camera):
                    measured[number] = camera, np.where(known == 0, depth, known)
                    break
            else:
                measured.append((layer.camera, depth))
        if any(scene.noise):
            measured = [(camera, subtract_noise(depth, scene.noise)) for camera, depth in measured]
        return cls(tuple(measured))

    def with_aligned_edges(self, scene: Scene) -> Law:
        """The law with the scene's frames as they are drawn (`align_edges`). Near misaligned edges filled depth counts as
        measured, and edges lie where the picture has them, if that forbids more."""
        frames, aligned = _aligned.get(self, ((), self))
        if frames is scene.frames:
            return aligned
        measured, misplaced = list(self.measured), self.misplaced_edges
        for layer in scene.frames:
            for number, (camera, known) in enumerate(measured):
                if camera.same_view_as(layer.camera):
                    placed = layer.load().find_once(align_edges)
                    if placed.misaligned.any():
                        measured[number] = camera, np.where(placed.misaligned, np.maximum(known, placed.depth), known)
                        misplaced = True
        aligned = Law(tuple(measured), misplaced)
        _aligned[self] = scene.frames, aligned
        return aligned

    def of_far(self) -> Law:
        """The law of the far pixels alone."""
        return Law(
            tuple((camera, np.where(np.isposinf(known), known, np.float32(0))) for camera, known in self.measured)
        )

    def cropped(self, view: View, rows: slice, columns: slice) -> Law:
        """The law for a part of a view (`View.cropped`): measurements of the view's own camera are cropped as well."""
        part = view.camera.cropped_to(rows, columns)
        measured = tuple(
            (part, np.ascontiguousarray(known[rows, columns])) if camera.same_view_as(view.camera) else (camera, known)
            for camera, known in self.measured
        )
        return replace(self, measured=measured)

    def violations(self, camera: Camera, depth: Float32Array, where: BoolArray) -> BoolArray:
        """H x W bool, True at pixels of `where` (H x W bool) whose `depth` (H x W metres, seen from `camera`) breaks the law."""
        broken, chosen = np.zeros(depth.shape, np.bool_), where & (depth > 0)
        broken[chosen] = self.violations_at(camera, np.flatnonzero(chosen), depth[chosen])
        return broken

    def violations_at(self, camera: Camera, places: NDArray[np.intp], depth: Float32Array) -> BoolArray:
        """N bool, True at the flat `places` (N) of the view of `camera` where `depth` (N metres, > 0) breaks the law."""
        pixels = kernels.Pixels(places.astype(np.int32), depth, camera.width)
        found = np.zeros(len(places), np.bool_)
        for source, measured in self.measured:
            to_source = px_from_px(source, camera), as_input(measured)
            in_bands(kernels.violations, len(found), pixels, *to_source, found, band=BAND)
        return found

    def project(self, camera: Camera, depth: Float32Array, where: BoolArray) -> tuple[Float32Array, BoolArray]:
        """Depth (H x W metres, seen from `camera`) with the pixels of `where` (H x W bool) moved outwards on their rays to the
        nearest lawful place, and which moved (H x W bool).

        A ray that never becomes lawful at a finite depth ends in the far layer (+inf), which is always lawful.
        """
        out = np.asarray(depth, np.float32)
        broken = moved = self.violations(camera, out, where)
        if not broken.any():
            return out, moved
        out = out.copy()
        for number in range(MAX_ROUNDS):
            if not broken.any():
                return out, moved
            if number:  # rounding to float32, or another source's law, brought it back over a border
                out[broken] *= np.float32(1 + 1e-5 * 4**number)
            pixels = kernels.Pixels(np.flatnonzero(broken).astype(np.int32), out[broken], out.shape[1])
            for source, measured in self.measured:
                to_source = px_from_px(source, camera), as_input(measured)
                in_bands(kernels.push_back, len(pixels.places), pixels, *to_source, band=BAND)
            out[broken] = pixels.depth
            broken = self.violations(camera, out, broken)  # all others are lawful as they were
        out[broken] = np.inf
        return out, moved


def subtract_noise(depth: Float32Array, noise: tuple[float, float]) -> Float32Array:
    """Measured depth (H x W metres, 0 = none, inf = far) less three standard deviations of `Scene.noise`, poses included, and
    the nearest of each pixel's neighbourhood, for edges may be off by 2 px. Unchanged where they are 0.1 % or less."""
    finite = is_valid(depth)
    metres = np.where(finite, depth, np.float32(0))
    spread = 3 * np.hypot(noise[0], noise[1] * metres**2)
    if not finite.any() or float(np.median((spread / np.maximum(metres, 1e-3))[finite])) <= 1e-3:
        return depth
    known = np.where(depth > 0, np.where(finite, depth - spread, depth), np.inf).astype(np.float32)
    nearest = cv2.erode(known, square(5))
    return np.where(depth > 0, np.maximum(nearest, np.float32(1e-3)), np.float32(0))


def violations(view: View, law: Law) -> BoolArray:
    """H x W, True at the filled pixels of a view that break the law."""
    return law.violations(view.camera, view.depth, view.filled)
