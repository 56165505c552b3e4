"""A scene and its head box in; the surfaces of its layers in few triangles out, which are right in any renderer.

Each layer is cut at its depth edges; what was filled lies a little behind what it reaches under, so that nothing flickers where
both show one surface; and the sky, which has no depth, lies on a sphere.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.frames.stored import Layer
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.layers.decimation import decimate
from dlama.geometry.layers.edge_layers import continue_everywhere
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.soft_edges import join_depth
from dlama.geometry.layers.source_sheets import (
    MeshPart,
    Sheet,
    cut_source,
    depth_of_sphere,
    move_back,
    pixels_of_grid,
    place_sky,
)
from dlama.geometry.layers.subsampling import step_for, subsample
from dlama.geometry.projection import project_to_pixels
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import Float32Array
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import View

TOLERANCES, LEAST_SHARE, LARGEST_SHARE = (0.1, 0.25, 0.5, 1.0), 0.002, 0.05
"""px of the grid by which depth that is off may move a pixel to the side of the box, from which the first is taken that gives few
enough triangles; the least and the largest share of the depth that this may be."""
GRID_PIXELS = 600_000
"""Vertices are pixels of layers that are subsampled to so many; colours are not."""
IN_FRONT = 0.95
"""Share of the measured depth; what is nearer than that is another surface, which hides it."""
BACKDROP, BACKDROP_STEP, BACKDROP_REACH = 48, 4, 10
"""Vertices of the backdrop across, at most; px of its picture between two; and px within which what is farthest counts."""


def mesh_layers(scene: Scene, box: HeadBox, most_triangles: int) -> list[MeshPart]:
    """The layers of a scene, those of the box's camera first, with about `most_triangles` in all, at most.

    The source takes half of them. Where the largest of TOLERANCES does not do, vertices are fewer pixels. The last part
    is what is soft of the source, its picture with alpha.
    """
    distance = sky_distance(scene, box)
    source, others = fill_own_holes(scene, box.camera)
    home = np.where(source.far, depth_of_sphere(box.camera, box.camera, distance), source.depth)
    step = step_for(int((~source.hole).sum()), GRID_PIXELS)
    parallax = source.camera.fx / step * math.tan(math.radians(box.angle))
    shares = [min(max(px / max(parallax, 1e-9), LEAST_SHARE), LARGEST_SHARE) for px in TOLERANCES]
    backdrop = mesh_backdrop(scene, box, distance)

    @cache
    def sheets(step: int) -> list[Sheet]:
        return cut_source(source, box, step, distance)

    def fills(step: int, share: float) -> Iterator[MeshPart]:
        for number, layer in enumerate(others, 1):
            own = max(1, round(step * layer.camera.fx / source.camera.fx))
            if min(layer.camera.hw) >= 2 * own:
                part = mesh_part(layer.load(), own, box, distance, share)
                yield move_back(drop_in_front(part, box.camera, home), box.camera, behind(number, share))
        yield move_back(backdrop, box.camera, behind(len(others) + 1, share))

    own = fit_triangles(lambda n, share: (sheet.mesh(share) for sheet in sheets(n)), step, shares, most_triangles / 2)
    rest = most_triangles - sum(len(part.mesh.triangles) for part in own)
    rest = max(rest, len(backdrop.mesh.triangles))  # which no step makes fewer: without fills it fits
    return [*own[:-1], *fit_triangles(fills, 2 * step, shares[1:], rest), own[-1]]


def behind(number: int, share: float) -> float:
    """Share of the distance by which the number-th fill lies behind what it joins, and behind the one before it, lest the two
    show in turn; its depth may be off by a share."""
    return 0.002 + (1 + number / 4) * share


def mesh_backdrop(scene: Scene, box: HeadBox, sky: float) -> MeshPart:
    """One surface behind everything, which shows where the others, of large triangles and cut at edges, leave gaps between them:
    what is farthest round each place, in the picture of the camera that sees most; sky: as of `mesh_part`."""
    camera = box.wide()
    scale = BACKDROP * BACKDROP_STEP / max(camera.wh)
    width, height = (max(round(side * scale), 2 * BACKDROP_STEP) for side in camera.wh)
    rim = BACKDROP_STEP  # the surface ends at the middle of the last of its pixels
    camera = camera.resized(width, height).cropped(-rim, -rim, width + 2 * rim, height + 2 * rim)
    seen = place_sky(render(scene, camera, types=False), box.camera, sky)
    small = subsample(continue_everywhere(seen, BACKDROP_REACH), BACKDROP_STEP)
    joined = np.full(small.hole.shape, RIGHT | DOWN, np.uint8)
    joined[:, -1] &= DOWN
    joined[-1] &= RIGHT
    found = decimate(small, LARGEST_SHARE, (small.depth, joined))
    return MeshPart(found.mesh, found.pixels, small.color, None)


def fill_own_holes(scene: Scene, camera: Camera) -> tuple[View, list[Layer]]:
    """The layer of a camera, with its holes as they were filled for the same camera: one surface without a seam; and the others,
    without these pixels."""
    first, *others = sorted(scene.layers, key=lambda layer: not layer.camera.same_view_as(camera))
    source = first.load()
    rest: list[Layer] = []
    for layer in others:
        if layer.camera.same_view_as(camera):
            layer = layer.load()
            filled = source.hole & ~layer.hole
            source = source.with_pixels(layer, filled)
            layer = layer.without(filled, HoleType.NONE)
            if not (contribution(layer) | layer.far).any():
                continue
        rest.append(layer)
    return source, rest


def fit_triangles(
    parts_of: Callable[[int, float], Iterable[MeshPart]], step: int, shares: Sequence[float], most: float
) -> list[MeshPart]:
    """What `parts_of` gives for the first of the steps and shares with which it has no more than so many triangles."""
    while True:
        for share in shares:
            found, count = [], 0
            for part in parts_of(step, share):
                found.append(part)
                count += len(part.mesh.triangles)
                if count > most:
                    break
            else:
                return found
        step += 1


def sky_distance(scene: Scene, box: HeadBox) -> float:
    """Metres at which the sky lies: behind everything, and so far that from end to end of the box it moves by about a pixel."""
    aside = 2 * box.pivot * math.tan(math.radians(box.angle))
    return max(4 * farthest_surface(scene), aside * math.sqrt(GRID_PIXELS) / box.camera.width * box.camera.fx)


def farthest_surface(scene: Scene) -> float:
    """Metres of the farthest surface of the frames, but for a few pixels; 1 where nothing is valid."""
    depths = [frame.depth[frame.valid] for frame in (one.load() for one in scene.frames) if frame.valid.any()]
    return max((float(np.quantile(depth, 0.98)) for depth in depths), default=1.0)


def mesh_part(view: View, step: int, box: HeadBox, sky: float, tolerance: float) -> MeshPart:
    """A layer's surface, with a vertex at every step-th pixel at most; the whole picture of a frame, of a fill what is shown.

    sky: metres from the box's camera at which it lies.
    """
    small = place_sky(subsample(view, step), box.camera, sky)
    least = box.step_that_shows(small.camera)
    grid = join_depth(mesh_grid(small, least)[0], small.camera, least)
    found = decimate(small, tolerance, grid)
    shown = None if view.shows_source else contribution(view) | view.far
    return MeshPart(found.mesh, pixels_of_grid(found.pixels, step), view.color, shown)


def drop_in_front(part: MeshPart, camera: Camera, depth: Float32Array) -> MeshPart:
    """The part without triangles that hide what a camera measured (its H x W depth): the rims of what a fill shows again.
    Vertices that are a little in front of it move back."""
    row, column, z, inside = project_to_pixels(part.mesh.vertices, camera)
    measured = np.where(inside, depth[row, column], np.float32(0))
    share = np.where(measured > 0, z / np.where(measured > 0, measured, 1), 1)
    triangles = part.mesh.triangles[~(share < IN_FRONT)[part.mesh.triangles].any(1)]
    home = camera.world_from_cam[:3, 3]
    back = np.where((share >= IN_FRONT) & (share < 1), share, 1)[:, None]
    vertices = home + (part.mesh.vertices - home) / back
    return part._replace(mesh=dataclasses.replace(part.mesh, vertices=vertices, triangles=triangles))
