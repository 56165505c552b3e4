"""A source view in; the three layers out that show it from near by: what is opaque, what reaches under edges, what is soft.

Together they give the picture again at the source camera. From elsewhere borders are as fine and as soft as in the picture,
not as the grid of the mesh is.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import Mesh
from dlama.geometry.holes import dilate_square, fill_with_nearest, repeat_cells, square
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.layers.decimation import decimate
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.soft_edges import complete_surfaces, enlarge, find_soft_edges, join_depth
from dlama.geometry.layers.subsampling import subsample
from dlama.geometry.projection import depth_from_inverse, inverse_depth, rays
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View

OPAQUE, BLOCK = 0.97, 4
"""Share of the near surface from which a pixel is opaque; px of the grid."""


class MeshPart(NamedTuple):
    """The surface of one layer and the picture on it."""

    mesh: Mesh
    pixels: Float64Array
    """N x 2: x and y (px; the first pixel's centre is at 0.5) of each vertex in the picture."""
    picture: UInt8Array
    """H x W x 3; with alpha H x W x 4."""
    shown: BoolArray | None
    """H x W: the pixels that are shown; None: the whole picture."""

    @property
    def soft(self) -> bool:
        """Its picture has alpha."""
        return self.picture.shape[2] == 4


class Sheet(NamedTuple):
    """One of the layers that a source is cut into."""

    layer: View
    grid: tuple[Float32Array, UInt8Array]
    """Its `mesh_grid`."""
    picture: UInt8Array
    """H x W x 3 or 4, of the source's size or of the layer's."""
    step: int
    """Pixels of the picture in a cell of the grid."""
    behind: float
    """Share of the distance by which it is moved back."""
    whole: bool
    """The whole picture is kept."""

    def mesh(self, tolerance: float) -> MeshPart:
        """Its surface."""
        found = decimate(self.layer, tolerance, self.grid)
        shown = None if self.whole else found.surface
        part = MeshPart(found.mesh, pixels_of_grid(found.pixels, self.step), self.picture, shown)
        return move_back(part, self.layer.camera, self.behind) if self.behind else part


def cut_source(source: View, box: HeadBox, step: int, sky: float) -> list[Sheet]:
    """The source as three layers: what is opaque of it; what its far surfaces are at, and a little under, depth edges; and its
    soft borders, whose picture has alpha."""
    layer = place_sky(subsample(source, step), box.camera, sky)
    least = box.step_that_shows(layer.camera)
    grid = partial(join_depth, camera=layer.camera, least=least)
    depth, joined = complete_surfaces(layer, least)
    soft = find_soft_edges(source.color, inverse_depth(depth), joined, step)
    rows, columns = (side * step for side in depth.shape)
    alpha = soft.alpha[:rows, :columns].reshape(len(depth), step, -1, step)
    least_alpha, most_alpha = alpha.min((1, 3)), alpha.max((1, 3))
    band = soft.band & (least_alpha < 1) & (most_alpha > 0)
    opaque = ~(soft.near_side & soft.band & (least_alpha < OPAQUE))
    next_to_edges = dilate_square(joined != (RIGHT | DOWN), 3)
    blocks = cover_blocks(soft.band & (band | ~opaque | next_to_edges)) & (depth > 0)
    picture: UInt8Array = np.where(enlarge(soft.near_side, step, source.camera.wh)[..., None], source.color, soft.back)
    under = fill_with_nearest(soft.back, enlarge(~soft.near_side | soft.band, step, source.camera.wh))
    small = np.asarray(cv2.resize(under[:rows, :columns], depth.shape[::-1], interpolation=cv2.INTER_AREA), np.uint8)
    front = np.concatenate([soft.front, np.rint(255 * soft.alpha[..., None]).astype(np.uint8)], 2, dtype=np.uint8)
    front[~enlarge(blocks, step, source.camera.wh)] = 0
    near, far = (
        np.where(blocks & (w > 0), depth_from_inverse(np.where(w > 0, w, 1)), 0) for w in (soft.near, soft.far)
    )
    return [
        Sheet(layer, grid(np.where(opaque, depth, 0)), picture, step, 0.0, True),
        Sheet(as_depth(layer, far), grid(far), small, 1, 0.002, False),  # it reaches under the near one
        Sheet(as_depth(layer, near), grid(near), front, step, 0.0, True),
    ]


def as_depth(view: View, depth: Float32Array) -> View:
    """The layer with another depth (H x W metres, 0 = hole)."""
    return view.with_planes(depth=depth, hole=depth == 0)


def cover_blocks(where: BoolArray) -> BoolArray:
    """H x W: the squares of BLOCK px that hold a pixel of `where` or one next to it, each with the next row and column: large
    triangles fit in."""
    near = dilate_square(where, 3)
    padded = np.pad(near, [(0, -side % BLOCK) for side in near.shape])
    blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, -1, BLOCK).max((1, 3))
    whole = repeat_cells(blocks, BLOCK, near.shape)
    return cv2.dilate(whole.view(np.uint8), square(2)).view(bool)


def depth_of_sphere(camera: Camera, centre: Camera, radius: float) -> Float32Array:
    """H x W metres at which the rays of a camera meet a sphere about another one, in which it is."""
    directions = rays(camera) @ camera.world_from_cam[:3, :3].T
    aside = camera.world_from_cam[:3, 3] - centre.world_from_cam[:3, 3]
    a, b, c = (directions**2).sum(2), directions @ aside, aside @ aside - radius**2
    return np.asarray((np.sqrt(b**2 - a * c) - b) / a, np.float32)


def place_sky(view: View, centre: Camera, radius: float) -> View:
    """The layer with its far pixels on a sphere about a camera."""
    if not view.far.any():
        return view
    return view.with_planes(depth=np.where(view.far, depth_of_sphere(view.camera, centre, radius), view.depth))


def pixels_of_grid(places: Float64Array, step: int) -> Float64Array:
    """N x 2: where places of a grid (px), of which each pixel is the middle of step x step, lie in the whole picture."""
    return (places - 0.5) * step + step // 2 + 0.5


def move_back(part: MeshPart, camera: Camera, share: float) -> MeshPart:
    """The part with its vertices further from a camera by a share of their distance."""
    home = camera.world_from_cam[:3, 3]
    mesh = part.mesh
    return part._replace(mesh=dataclasses.replace(mesh, vertices=home + (mesh.vertices - home) * (1 + share)))
