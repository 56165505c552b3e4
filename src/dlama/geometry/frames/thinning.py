"""A scene of many frames in; the same without duplicate surfaces, with equal brightness, for clouds and meshes, out."""

from __future__ import annotations

import dataclasses
from functools import partial

import cv2
import numpy as np

from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.frames.merging import nearest_depth_around
from dlama.geometry.frames.stored import StoredView, unpack_bits
from dlama.geometry.holes import morphological_open, square
from dlama.geometry.projection import project, rays
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View

MOST_COMPARED = 6
"""Most frames that each frame is compared with."""
FLOOR, SIGMAS = 0.01, 3.0
"""Relative depth difference, and standard deviations of the noise, within which two frames show one surface."""


def thin_scene(scene: Scene) -> Scene:
    """The frames with only new points that no other frame saw through; fills stay.

    Colours get the scene's common brightness. A scene of one picture comes back unchanged.
    """
    if len(scene.frames) == 1:
        return scene
    layers: list[View] = []
    for place, frame in enumerate(scene.frames):
        added = new_points(scene, place)
        if added.any() or not place:
            make = partial(keep_new_points, frame, np.packbits(added), scene.gains[place])
            layers.append(StoredView.of(frame.camera, make, frame.cache) if isinstance(frame, StoredView) else make())
    return Scene(tuple(layers), scene.removals, scene.fills)


def keep_new_points(frame: View, bits: UInt8Array, gain: tuple[float, float, float]) -> View:
    """A frame in the scene's brightness with the pixels `bits` (H x W bool, as `numpy.packbits` packs it) and a rim of one."""
    added = unpack_bits(bits, frame.camera)
    ring = cv2.dilate(added.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    layer = frame.read().without(~ring, HoleType.NONE)
    origin = np.where(added | layer.hole, layer.origin, np.uint8(Origin.REPROJECTED))
    color = np.clip(np.rint(layer.color * np.array(gain)), 0, 255).astype(np.uint8)
    return dataclasses.replace(layer, origin=origin, color=color)


def new_points(scene: Scene, place: int) -> BoolArray:
    """H x W, True at the pixels of a frame that no earlier frame shows and no other frame saw through."""
    frame = scene.frames[place].read()
    held = [one for one in choose_frames(scene.frames, frame.camera, MOST_COMPARED) if one != place]
    added = frame.valid.copy()
    rows, columns = np.nonzero(added)
    depth = frame.depth[rows, columns].astype(np.float64)
    pose = frame.camera.world_from_cam
    points = (rays(frame.camera)[rows, columns] * depth[:, None]) @ pose[:3, :3].T + pose[:3, 3]
    drop = np.zeros(len(points), bool)
    for other in held:
        drop |= _is_redundant(points, scene, scene.frames[other], other < place)
    added[rows, columns] = ~drop
    return morphological_open(added, square(3))


def _is_redundant(points: np.ndarray, scene: Scene, other: View, earlier: bool) -> BoolArray:
    """N, True at points that another frame saw through, or shows itself if it comes earlier."""
    other = other.read()
    pixels, z = project(points, other.camera)
    width, height = other.camera.wh
    inside = (z > 0) & (pixels >= 0).all(1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    x, y = np.where(inside[:, None], pixels, 0).astype(np.intp).T
    there = np.where(other.hole, 0, other.depth)[y, x]
    near = nearest_depth_around(other)[y, x]
    limit = np.maximum(FLOOR * z, SIGMAS * np.hypot(scene.noise[0], scene.noise[1] * z**2))
    through = inside & (near > 0) & (z < near - 2 * limit)
    if not earlier:
        return np.asarray(through)
    with np.errstate(invalid="ignore"):
        return np.asarray(through | (inside & (there > 0) & (np.abs(there - z) <= limit)))
