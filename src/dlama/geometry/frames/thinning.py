"""A scene of many frames in; the same with every surface once and equally bright, as clouds and meshes show it, out."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.frames.merging import nearest_depth_around
from dlama.geometry.frames.stored import Layer, make_of, unpack_bits
from dlama.geometry.holes import dilate_square, morphological_open, square
from dlama.geometry.kernels.jit import as_input, in_bands
from dlama.geometry.kernels.visibility import Compared, drop_redundant
from dlama.geometry.projection import px_from_px
from dlama.geometry.rgbd import BoolArray, UInt8Array, brighten
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import View

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
            layer = make_of(frame, keep_new_points, np.packbits(added), scene.gain_of(frame.camera))
            layer.find_once(count_points)  # while the frame is in memory
            layers.append(layer)
    removals, fills = (
        tuple(make_of(one, brighten_layer, scene.gain_of(one.camera)) for one in some)
        for some in (scene.removals, scene.fills)
    )
    return Scene(tuple(layers), removals, fills)


def count_points(layer: Layer) -> int:
    """Points that a layer adds to the cloud."""
    return int(contribution(layer.load_part()).sum())


def brighten_layer(view: View, gain: Float64Array) -> View:
    """A layer in the scene's brightness."""
    return view.with_planes(color=brighten(view.color, gain))


def keep_new_points(frame: View, bits: UInt8Array, gain: Float64Array) -> View:
    """A frame in the scene's brightness with the pixels `bits` (H x W bool, as `numpy.packbits` packs it) and a rim of one."""
    added = unpack_bits(bits, frame.camera)
    ring = dilate_square(added, 3)
    layer = frame.without(~ring, HoleType.NONE)
    origin = np.where(added | layer.hole, layer.origin, np.uint8(Origin.REPROJECTED))
    return dataclasses.replace(layer, origin=origin, color=brighten(layer.color, gain))


def new_points(scene: Scene, place: int) -> BoolArray:
    """H x W, True at the pixels of a frame that no earlier frame shows and no other frame saw through."""
    frame = scene.frames[place].load()
    held = [one for one in choose_frames(scene.frames, frame.camera, most=6) if one != place]
    added = frame.valid.copy()
    limits = np.array([FLOOR, SIGMAS * scene.noise[0], SIGMAS * scene.noise[1]])
    for each in held:
        other = scene.frames[each].load()
        way = px_from_px(other.camera, frame.camera)
        compared = Compared(way, as_input(other.known_depth), nearest_depth_around(other), each < place)
        in_bands(drop_redundant, len(added), as_input(frame.depth), compared, limits, added)
    return morphological_open(added, square(3))
