"""A scene and its head box in; the surfaces of its layers in few triangles out, which are right in any renderer.

Each layer is cut at its depth edges; what was filled lies a little behind what it reaches under, so that nothing flickers where
both show one surface; and the sky, which has no depth, lies on a sphere.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.layers.decimation import decimate
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.subsampling import step_for, subsample
from dlama.geometry.mesh import Mesh
from dlama.geometry.projection import project_to_pixels, rays
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

TOLERANCES = (0.002, 0.005, 0.01, 0.02)
"""Shares of the depth by which it may be off, from which the first is taken that gives few enough triangles."""
GRID_PIXELS = 600_000
"""Vertices are pixels of layers that are subsampled to so many; colours are not."""
BEHIND, BEHIND_EACH = 0.004, 0.0004
"""Share of the distance by which fills lie behind what they join, and each further one behind those before it."""
IN_FRONT = 0.95
"""Share of the measured depth; what is nearer than that hides it."""
SKY, SKY_QUANTILE = 4.0, 0.98
"""Distance of the sky, in that quantile of the depth of the frames."""


class MeshPart(NamedTuple):
    """The surface of one layer and the picture on it."""

    mesh: Mesh
    pixels: Float64Array
    """N x 2: x and y (px; the first pixel's centre is at 0.5) of each vertex in the picture."""
    picture: UInt8Array
    """H x W x 3."""
    shown: BoolArray | None
    """H x W: the pixels that are shown; None: the whole picture."""


def mesh_layers(scene: Scene, box: HeadBox, most_triangles: int) -> list[MeshPart]:
    """The layers of a scene, those of the box's camera first, with about `most_triangles` in all, at most.

    Where the largest of TOLERANCES does not do, vertices are pixels of smaller layers.
    """
    distance = sky_distance(scene, box)
    layers = sorted(scene.layers, key=lambda layer: not layer.camera.same_view_as(box.camera))
    source = layers[0].read()
    home = np.where(source.far, depth_of_sphere(box.camera, box.camera, distance), source.depth)
    step = step_for(Scene((source,)), GRID_PIXELS)
    while True:
        for tolerance in TOLERANCES:
            parts, count = [], 0
            for number, layer in enumerate(layers):
                own = max(1, round(step * layer.camera.fx / layers[0].camera.fx))
                if min(layer.camera.hw) < 2 * own:
                    continue
                parts.append(mesh_part(layer.read(), own, (box.camera, distance), tolerance))
                if number:
                    kept = drop_in_front(parts[-1], box.camera, home)
                    parts[-1] = move_back(kept, box.camera, BEHIND + BEHIND_EACH * number)
                count += len(parts[-1].mesh.triangles)
                if count > most_triangles:
                    break
            else:
                return parts
        step += 1


def sky_distance(scene: Scene, box: HeadBox) -> float:
    """Metres at which the sky lies: behind everything, and so far that from end to end of the box it moves by about a pixel."""
    depths = [frame.depth[frame.valid] for frame in (one.read() for one in scene.frames) if frame.valid.any()]
    farthest = max((float(np.quantile(depth, SKY_QUANTILE)) for depth in depths), default=1.0)
    aside = 2 * box.pivot * math.tan(math.radians(box.angle))
    return max(SKY * farthest, aside * math.sqrt(GRID_PIXELS) / box.camera.width * box.camera.fx)


def depth_of_sphere(camera: Camera, centre: Camera, radius: float) -> Float32Array:
    """H x W metres at which the rays of a camera meet a sphere about another one, in which it is."""
    directions = rays(camera) @ camera.world_from_cam[:3, :3].T
    aside = camera.world_from_cam[:3, 3] - centre.world_from_cam[:3, 3]
    a, b, c = (directions**2).sum(2), directions @ aside, aside @ aside - radius**2
    return np.asarray((np.sqrt(b**2 - a * c) - b) / a, np.float32)


def mesh_part(layer: View, step: int, sky: tuple[Camera, float], tolerance: float) -> MeshPart:
    """A layer's surface, with a vertex at every step-th pixel at most; the whole picture of a frame, of a fill what is shown.

    sky: the camera about which it lies, and how many metres away.
    """
    small = subsample(layer, step)
    if small.far.any():
        small = small.with_planes(depth=np.where(small.far, depth_of_sphere(small.camera, *sky), small.depth))
    found = decimate(small, tolerance)
    pixels = found.pixels if step == 1 else (found.pixels - 0.5) * step + step // 2 + 0.5
    whole = layer.shows_source
    if step > 1 and not whole:
        return MeshPart(found.mesh, found.pixels, small.color, found.surface)
    return MeshPart(found.mesh, pixels, layer.color, None if whole else found.surface)


def drop_in_front(part: MeshPart, camera: Camera, depth: Float32Array) -> MeshPart:
    """The part without triangles that hide what a camera measured (its H x W depth): the rims of what a fill shows again."""
    row, column, z, inside = project_to_pixels(part.mesh.vertices, camera)
    hides = inside & (z < IN_FRONT * depth[row, column])
    triangles = part.mesh.triangles[~hides[part.mesh.triangles].any(1)]
    return part._replace(mesh=dataclasses.replace(part.mesh, triangles=triangles))


def move_back(part: MeshPart, camera: Camera, share: float) -> MeshPart:
    """The part with its vertices further from a camera by a share of their distance."""
    home = camera.world_from_cam[:3, 3]
    mesh = part.mesh
    return part._replace(mesh=dataclasses.replace(mesh, vertices=home + (mesh.vertices - home) * (1 + share)))
