"""A scene of many frames in; the same with every surface once and equally bright, as clouds and meshes show it, out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.frames.merging import nearest_depth_around
from dlama.geometry.frames.stored import Layer, StoredView, load_aside, unpack_bits
from dlama.geometry.holes import dilate_square, morphological_open, square
from dlama.geometry.projection import project_to_pixels, unproject
from dlama.geometry.rgbd import BoolArray, UInt8Array, brighten
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

MOST_COMPARED = 6
"""Most frames that each frame is compared with."""
FLOOR, SIGMAS = 0.01, 3.0
"""Relative depth difference, and standard deviations of the noise, within which two frames show one surface."""


def thin_scene(scene: Scene) -> Scene:
    """The frames with only new points that no other frame saw through; fills and removed objects stay.

    Colours get the scene's common brightness. A scene of one picture comes back unchanged.
    """
    if len(scene.frames) == 1:
        return scene
    layers: list[Layer] = []
    for place, frame in enumerate(scene.frames):
        added = new_points(scene, place)
        if added.any() or not place:
            layers.append(made_of(frame, keep_new_points, np.packbits(added), scene.gain_of(frame.camera)))
    removals, fills = (
        tuple(made_of(one, brighten_layer, scene.gain_of(one.camera)) for one in some)
        for some in (scene.removals, scene.fills)
    )
    return Scene(tuple(layers), removals, fills)


def made_of(layer: Layer, make: Callable[..., View], *more: Any) -> Layer:
    """What `make` gives for a layer and more: at once, or, of a stored one, when its pixels are needed."""
    return layer.made_by(make, *more) if isinstance(layer, StoredView) else make(layer, *more)


def brighten_layer(layer: Layer, gain: Float64Array) -> View:
    """A layer in the scene's brightness."""
    view = load_aside(layer)
    return view.with_planes(color=brighten(view.color, gain))


def keep_new_points(frame: Layer, bits: UInt8Array, gain: Float64Array) -> View:
    """A frame in the scene's brightness with the pixels `bits` (H x W bool, as `numpy.packbits` packs it) and a rim of one."""
    added = unpack_bits(bits, frame.camera)
    ring = dilate_square(added, 3)
    layer = load_aside(frame).without(~ring, HoleType.NONE)
    origin = np.where(added | layer.hole, layer.origin, np.uint8(Origin.REPROJECTED))
    return dataclasses.replace(layer, origin=origin, color=brighten(layer.color, gain))


def new_points(scene: Scene, place: int) -> BoolArray:
    """H x W, True at the pixels of a frame that no earlier frame shows and no other frame saw through."""
    frame = scene.frames[place].load()
    held = [one for one in choose_frames(scene.frames, frame.camera, MOST_COMPARED) if one != place]
    added = frame.valid.copy()
    rows, columns = np.nonzero(added)
    points = unproject(frame.camera, columns + 0.5, rows + 0.5, frame.depth[rows, columns])
    drop = np.zeros(len(points), bool)
    for other in held:
        drop |= _is_redundant(points, scene, scene.frames[other].load(), other < place)
    added[rows, columns] = ~drop
    return morphological_open(added, square(3))


def _is_redundant(points: np.ndarray, scene: Scene, other: View, earlier: bool) -> BoolArray:
    """N, True at points that another frame saw through, or shows itself if it comes earlier."""
    y, x, z, inside = project_to_pixels(points, other.camera)
    there = other.known_depth[y, x]
    near = nearest_depth_around(other)[y, x]
    limit = np.maximum(FLOOR * z, SIGMAS * np.hypot(scene.noise[0], scene.noise[1] * z**2))
    through = inside & (near > 0) & (z < near - 2 * limit)
    if not earlier:
        return np.asarray(through)
    with np.errstate(invalid="ignore"):
        return np.asarray(through | (inside & (there > 0) & (np.abs(there - z) <= limit)))
