"""Fusion: a scene and a filled view in; the scene with the fill out; also a scene as one cloud or one mesh (eq. 10, 11)."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.arguments import check_arguments
from dlama.errors import ShapeError
from dlama.geometry.cloud import Mesh, PointCloud, concatenate, join_meshes
from dlama.geometry.codes import HoleType, Origin, from_filler
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.holes import dilate_square
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.jit import BAND
from dlama.geometry.projection import inverse_depth, lift, unproject
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, is_valid
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import View

OVERLAP = 2
"""Overlap in px of a filled layer with the scene: its mesh joins the surfaces that it continues, and no seam opens between two
cameras."""


def fuse(scene: Scene, view: View, known: BoolArray | None = None) -> Scene:
    """The scene with what was filled in `view` as one more layer; nothing filled gives the scene back.

    The layer keeps OVERLAP pixels of neighbours that the scene has already; they are no points of the cloud.

    Args:
        known: H x W bool, filled pixels that come from the scene itself (filled for an earlier camera). They are not added again,
            nor are filled pixels without a hole type, which were rendered from it.
    """
    check_arguments(fuse, locals())
    if known is not None and (np.shape(known) != view.camera.hw or np.asarray(known).dtype != np.bool_):
        given = np.asarray(known)
        raise ShapeError(f"known is {given.dtype} {given.shape}; bool {view.camera.hw}, as the view is, is expected")
    depth_only = (view.origin == Origin.DEPTH_FILLED.value) & (view.hole_type == HoleType.SENSOR.value)
    for layer in scene.layers:
        if layer.camera.same_view_as(view.camera):
            shown = layer.load()
            depth_only = depth_only & ~shown.valid & ~shown.far
    added = (view.filled & (view.hole_type != HoleType.NONE.value)) | depth_only
    return add_layer(scene, view, added if known is None else added & ~known)


def add_layer(scene: Scene, view: View, added: BoolArray, overlap: int = OVERLAP) -> Scene:
    """The scene with the pixels `added` (H x W bool) of a view, and `overlap` pixels round them, as one more layer; none gives
    the scene back."""
    if not added.any():
        return scene
    ring = dilate_square(added, 2 * overlap + 1)
    layer = view.without(~ring, HoleType.NONE)
    filled = from_filler(layer.origin)
    origin = np.where(added | layer.hole | filled, layer.origin, np.uint8(Origin.REPROJECTED))
    types = np.where(added, layer.hole_type, np.uint8(HoleType.NONE))
    return dataclasses.replace(scene, fills=(*scene.fills, layer.with_planes(origin=origin, hole_type=types)))


def scene_cloud(scene: Scene, objects: bool = True) -> PointCloud:
    """c+ (eq. 10: everything and what was filled) or, without the removed objects, c- (eq. 11)."""
    layers = (*scene.layers, *scene.removals) if objects else scene.layers
    return concatenate(
        [lift(view.without(~contribution(view), HoleType.NONE)) for view in (layer.load() for layer in layers)]
    )


def scene_mesh(scene: Scene) -> Mesh:
    """The scene's surfaces, without removed objects, as one triangle mesh, cut where rendering cuts it. Far pixels have no
    vertices."""
    return join_meshes([layer_mesh(layer.load()) for layer in scene.layers])


HALVES = ("abc", "bdc", "abd", "adc")
"""The triangles that a square of the grid can be cut into; corners: a b above, c d below."""


def cell_halves(depth: Float32Array, joined: UInt8Array) -> tuple[BoolArray, ...]:
    """(H - 1) x (W - 1) for each of HALVES: whether a square of four pixels has that triangle.

    A square whose sides are all joined has two of them, cut along the diagonal of the smaller step; else a triangle is where two
    sides that meet are joined.
    """
    right, down = (joined & RIGHT) > 0, (joined & DOWN) > 0
    top, left = right[:-1, :-1], down[:-1, :-1]
    bottom, side = right[1:, :-1], down[:-1, 1:]
    along_bc = np.empty(top.shape, np.bool_)
    for first in range(0, len(top), BAND):
        w = inverse_depth(depth[first : first + BAND + 1])
        along_bc[first : first + BAND] = np.abs(w[:-1, 1:] - w[1:, :-1]) <= np.abs(w[:-1, :-1] - w[1:, 1:])
    full = top & left & bottom & side
    return (
        (full & along_bc) | (~full & top & left),
        (full & along_bc) | (~full & bottom & side),
        (full & ~along_bc) | (~full & top & side),
        (full & ~along_bc) | (~full & left & bottom),
    )


def layer_mesh(view: View) -> Mesh:
    """One layer's joined quads; vertices are its valid, non-flying pixels."""
    depth, joined = mesh_grid(view)
    chosen = is_valid(depth)
    number = np.cumsum(chosen).reshape(chosen.shape) - 1
    corner = {"a": number[:-1, :-1], "b": number[:-1, 1:], "c": number[1:, :-1], "d": number[1:, 1:]}
    triangles = np.concatenate(
        [np.stack([corner[name][half] for name in names], 1) for names, half in zip(HALVES, cell_halves(depth, joined))]
    ).astype(np.int32)
    rows, columns = np.nonzero(chosen)
    return Mesh(
        unproject(view.camera, columns + 0.5, rows + 0.5, depth[chosen]),
        triangles,
        view.color[chosen],
        view.origin[chosen],
        view.confidence[chosen],
    )
