"""Fusion: a scene and a filled view in; the scene with the fill out (eq. 10, 11).

The other way, a view's holes are closed by what the scene was filled with earlier. Also a scene as one cloud or one mesh.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.arguments import check_arguments
from dlama.errors import ShapeError
from dlama.geometry.cloud import Mesh, PointCloud, concatenate, join_meshes
from dlama.geometry.codes import LARGEST_CONFIDENCE, SEEN_AGAIN, HoleType, Origin, from_filler, has_code
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.drawing.layers import Mode
from dlama.geometry.frames.removal import crop_layer
from dlama.geometry.frames.thinning import thin_scene
from dlama.geometry.holes import box_around, dilate_square
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.jit import BAND
from dlama.geometry.projection import inverse_depth, lift, unproject
from dlama.geometry.rendering import render, render_fills
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, is_valid, replace_pixels
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import PLANES, View
from dlama.geometry.visibility import Law

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
    layer = layer.with_planes(origin=origin, hole_type=types)
    return dataclasses.replace(
        scene, fills=(*scene.fills, layer if len(scene.frames) == 1 else crop_layer(layer, ring))
    )


def close_by_earlier_fill(law: Law, scene: Scene, view: View, mode: Mode, frames: bool) -> tuple[View, int]:
    """The view with its holes closed where `scene` was filled for a frame or for earlier cameras, and how many pixels the law
    moved. frames: whether frames may show something there, too, else `view` is how they are drawn."""
    if not view.hole.any() or not (scene.fills or frames):
        return view, 0
    if len(scene.frames) == 1 and all(layer.camera.same_view_as(view.camera) for layer in scene.layers):
        return close_in_place(law, scene, view, mode)
    return close_holes(law, view, render_fills(scene, view.camera, mode, view.hole, frames))


def close_in_place(law: Law, scene: Scene, view: View, mode: Mode) -> tuple[View, int]:
    """As `close_by_earlier_fill`, of a scene all of whose layers are of the view's own camera: the box of its holes is drawn
    alone."""
    rows, columns = box_around(view.hole, 0)
    part = view.cropped(rows, columns)
    frames, fills = (tuple(one.load().cropped(rows, columns) for one in of) for of in (scene.frames, scene.fills))
    earlier = render(Scene(frames, fills=fills), part.camera, mode, types=False, close=False)
    closed, moved = close_holes(law.cropped(view, rows, columns), part, earlier)
    return paste_part(view, closed, rows, columns), moved


def close_holes(law: Law, view: View, earlier: View, *, measured: bool = False) -> tuple[View, int]:
    """The holes of a view closed with another rendering of the same camera, where that knows more, and how many pixels the law
    moved.

    Colours that were measured stay. Surfaces are drawn between lawful pixel centres, so the depth that is taken over is
    projected onto the law once more. measured: what `earlier` shows of measurements stays marked as such (REPROJECTED).
    """
    closed = view.hole & ~earlier.hole
    depth, moved = law.project(view.camera, np.where(closed, earlier.depth, view.depth), closed)
    of_color = closed & view.color_hole
    again = has_code(earlier.origin, *SEEN_AGAIN) & (not measured)
    origin = np.where(of_color, np.where(again, np.uint8(Origin.FILLED), earlier.origin), np.uint8(Origin.DEPTH_FILLED))
    known = view.with_planes(
        color=replace_pixels(view.color, of_color, earlier.color),
        depth=depth,
        hole=view.hole & ~closed,
        origin=np.where(closed, origin, view.origin),
        confidence=np.where(
            closed, np.where(again, np.float32(LARGEST_CONFIDENCE), earlier.confidence), view.confidence
        ),
        errors=view.errors_with(earlier, closed),
    )
    if view.frame is not None and earlier.frame is not None:
        known = known.with_planes(frame=np.where(of_color, earlier.frame, view.frame))
    return known, int(moved.sum())


def paste_part(view: View, part: View, rows: slice, columns: slice) -> View:
    """The view with a part of it (`View.cropped`) in its place."""
    planes = {}
    for name in PLANES:
        whole, inside = getattr(view, name), getattr(part, name)
        if inside is None or (whole is not None and np.array_equal(whole[rows, columns], inside)):
            continue
        shape = (*view.hole.shape, *inside.shape[2:])
        planes[name] = np.zeros(shape, inside.dtype) if whole is None else whole.copy()
        planes[name][rows, columns] = inside
    return view.with_planes(**planes)


def scene_cloud(scene: Scene, objects: bool = True) -> PointCloud:
    """c+ (eq. 10: everything and what was filled) or, without the removed objects, c- (eq. 11). Every surface is in it once."""
    once = thin_scene(scene)
    layers = (*once.layers, *once.removals) if objects else once.layers
    return concatenate(
        [lift(view.without(~contribution(view), HoleType.NONE)) for view in (layer.load_part() for layer in layers)]
    )


def scene_mesh(scene: Scene) -> Mesh:
    """The scene's surfaces, each once, without removed objects, as one triangle mesh, cut where rendering cuts it. Far pixels
    have no vertices."""
    return join_meshes([layer_mesh(layer.load_part()) for layer in thin_scene(scene).layers])


HALVES = ("abc", "bdc", "abd", "adc")
"""The triangles that a square of the grid can be cut into, clockwise; corners: a b above, c d below."""


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
        [
            np.stack([corner[name][half] for name in names[::-1]], 1)
            for names, half in zip(HALVES, cell_halves(depth, joined))
        ]
    ).astype(np.int32)
    rows, columns = np.nonzero(chosen)
    return Mesh(
        unproject(view.camera, columns + 0.5, rows + 0.5, depth[chosen]),
        triangles,
        view.color[chosen],
        view.origin[chosen],
        view.confidence[chosen],
    )
