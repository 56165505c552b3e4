"""Rendering: a view or a scene and a camera in; the view from that camera out, with its holes typed.

`points` is the paper's P(∇p') (eq. 2): nearest pixel, z-buffered. `surface` draws the pixel grid as a triangle mesh cut at
depth discontinuities, so that surfaces have no cracks and nothing shines through them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.arguments import check_arguments, check_word
from dlama.errors import InputError
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import PointCloud
from dlama.geometry.codes import HoleType
from dlama.geometry.drawing.canvas import Canvas
from dlama.geometry.drawing.gaps import close_gaps
from dlama.geometry.drawing.grid_mesh import close_grid, find_joints
from dlama.geometry.drawing.layers import (
    ALL,
    NO_ERRORS,
    Drawn,
    Grid,
    Surface,
    box_room,
    count_needed,
    crop_count,
    draw,
    draw_apart,
    draw_far,
    draw_points,
    transform_depth,
)
from dlama.geometry.drawing.layers import MODES as MODES
from dlama.geometry.drawing.layers import Mode as Mode
from dlama.geometry.frames.choosing import find_part, may_show
from dlama.geometry.frames.facts import find_once
from dlama.geometry.frames.merging import keep_latest, merge_frames, surface_of
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import Box, box_around, dilate_mask, fill_with_nearest
from dlama.geometry.kernels.drawing import hole_types as hole_kernels
from dlama.geometry.kernels.drawing.rasterize import NEAR
from dlama.geometry.kernels.drawing.shading import Planes
from dlama.geometry.kernels.jit import in_bands, threads
from dlama.geometry.projection import project
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array, freeze
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import View

TYPE_OF_RANK = np.pad(np.array(hole_kernels.RISING, np.uint8), (0, 256 - len(hole_kernels.RISING)))
"""Hole types by rank, for cv2.LUT."""
Fill = tuple[Grid, Box, Float64Array]
"""Prepared for a part of a camera's picture, rows and columns of that, and its gains (`fills_in_view`)."""


def render(
    source: RGBD | View | Scene | PointCloud,
    camera: Camera,
    mode: Mode = "surface",
    types: bool = True,
    fine: bool = True,
    close: bool = True,
) -> View:
    """The scene from `camera`. Holes have colour 0, depth 0 and a HoleType.

    At a layer's own camera its pixels come back bit for bit. Every other camera, of another lens too, rejects flying pixels, and
    what was filled next to an occluder (`find_mixed_fills`). The frames of a scene of many are merged pixel by pixel
    (`dlama.geometry.frames.merging`); what was filled is drawn on top of them, where nothing was measured in front.

    Args:
        source: What is seen; of a PointCloud `mode` "points" alone, since it has no pixel grid to triangulate.
        camera: Where from, in the world of the source.
        mode: "surface" (the pixel grid as triangles, cut at depth edges) or "points" (each pixel to the nearest one).
        types: Find the type of each hole; False leaves them all OUT_OF_VIEW, which is faster.
        fine: Read a surface's colours between source pixels by cubic B-spline, averaged where the source is drawn smaller; False
            reads them bilinearly, which blurs, in two thirds of the time.
        close: In a scene that was filled, close gaps of up to 2 px and sky that continues (origin FILLED; `close_gaps`), unless
            it was thinned by confidence; False leaves them open.
    Raises:
        InputError: an unknown mode, or a surface of a PointCloud.
    """
    check_arguments(render, locals())
    check_word(mode, "mode", MODES)
    if isinstance(source, PointCloud):
        return render_cloud(source, camera, mode)
    if isinstance(source, RGBD):
        source = find_once(source, View.from_rgbd)  # whose facts are kept, for the next camera
    scene = Scene((source,)) if isinstance(source, View) else source
    if not scene.fills and (own := share_own_view(scene, camera, types)) is not None:
        return own
    drawn = draw_scene(scene, camera, mode, fine)
    if close and mode == "surface" and scene.fills and not any(fill.has_open_holes for fill in scene.fills):
        close_gaps(drawn.canvas)
    return drawn.view(camera, hole_types(drawn, scene.removals) if types else None)


def render_measured(measured: Scene, scene: Scene, camera: Camera, mode: Mode, footprint: bool) -> View:
    """What the measurements alone show from `camera`: I', lambda' and M (eq. 2-4).

    Away from the cameras of its frames the depth of sensor holes, filled in `scene`, counts as measured.

    Args:
        measured: The scene without fills.
        scene: The same scene as far as it is filled.
        footprint: What removed objects cover is a hole, too (fig. 5, the union).
    """
    frames = measured.frames if measured.has_frame_of(camera) else scene.frames
    view = render(dataclasses.replace(measured, frames=frames), camera, mode, close=False)
    if footprint and measured.removals:
        first, *others = measured.removals
        removed = render(Scene((first,), fills=tuple(others)), camera, mode, types=False)
        view = view.without(~removed.hole & ~view.hole, HoleType.OBJECT)
    return view


def render_fills(scene: Scene, camera: Camera, mode: Mode, hole: BoolArray, frames: bool) -> View:
    """What fills show in a hole (H x W) that measurements leave; other pixels may come out as anything, gaps stay open.

    frames: False where the frames, as they are in the scene, leave that hole too: they are not drawn again.
    """
    return draw_scene(scene, camera, mode, True, count_needed(hole), frames).view(camera)


def draw_scene(
    scene: Scene, camera: Camera, mode: Mode, fine: bool, count: NDArray[np.int32] = ALL, frames: bool = True
) -> Drawn:
    """A scene's layers, drawn. count: of the pixels of fills that count (`count_needed`); frames: whether they are drawn."""
    fine, errors = fine and mode == "surface", any(layer.has_errors for layer in scene.layers)
    keep = mode == "surface" and len(scene.layers) > 2  # it is one that is drawn into many cameras

    def prepare(layer: Layer, target: Camera) -> Grid:
        return Grid(surface_of(layer) if keep else Surface(layer.load()), target, mode, fine)

    if not frames:
        drawn = Drawn(Canvas.empty(camera, errors), [])
    elif len(scene.frames) > 1:
        drawn = merge_frames(scene, camera, mode, fine, errors)
    else:
        drawn = draw_frame(prepare(scene.frames[0], camera), errors)
    seen = fills_in_view(scene, camera, mode)
    fills = [(prepare(layer, camera.cropped_to(*box)), box, gain) for layer, box, gain in seen]
    put_fills(drawn, fills, count)
    for grid in drawn.grids if drawn.frame is None else ():
        draw_far(grid, drawn.canvas)
    draw_far_of_fills(drawn.canvas, fills)
    return drawn._replace(grids=[*drawn.grids, *(grid for grid, _, _ in fills)])


def draw_frame(grid: Grid, errors: bool) -> Drawn:
    """One frame, drawn; its sky, too, at its own camera, where no fill may cover it."""
    canvas = draw(grid, Canvas.empty(grid.camera, errors))
    if not grid.own_camera:
        return Drawn(canvas, [grid])
    draw_far(grid, canvas)
    return Drawn(canvas, [grid], own=grid.layer)


def fills_in_view(scene: Scene, camera: Camera, mode: Mode) -> list[tuple[Layer, Box, Float64Array]]:
    """What is drawn of each fill that a camera may see, where, and its gains to the brightness of the view: its frame's, or the
    scene's."""
    fills = scene.fills if mode == "surface" else drop_overlap(scene.fills)
    if len(scene.frames) > 1:
        fills = tuple(fill for fill in fills if may_show(fill, camera))
    here = scene.gain_of(camera)
    return [(*find_part(fill, camera), scene.gain_of(fill.camera) / here) for fill in fills]


def put_fills(drawn: Drawn, fills: Sequence[Fill], count: NDArray[np.int32]) -> None:
    """Draw the surfaces of fills, in their order, over what is drawn. count: as of `draw`."""
    canvas, step = drawn.canvas, min(threads(), 2)  # at once, each onto a canvas of its own, of 21 bytes a pixel
    at_home = drawn.frame is None and any(grid.own_camera for grid in drawn.grids)
    for begin in range(0, len(fills), step):
        some = fills[begin : begin + step]
        canvases = [Canvas.empty(grid.camera, len(canvas.errors) > 0) for grid, _, _ in some]
        draw_apart([grid for grid, _, _ in some], canvases, [crop_count(count, *box) for _, box, _ in some])
        for (grid, box, gain), one in zip(some, canvases):
            if (gain != 1).any():
                one.brighten_where(one.depth > 0, gain)
            canvas.cropped(*box).put(one, over_measured=grid.layer.shows_source, at_home=at_home)


def draw_far_of_fills(canvas: Canvas, fills: Sequence[Fill]) -> None:
    """Draw what of fills is infinitely far where nothing is drawn."""
    for grid, _, gain in fills:
        empty = None if (gain == 1).all() else canvas.depth == 0
        draw_far(grid, canvas)
        if empty is not None:
            canvas.brighten_where(empty & (canvas.depth > 0), gain)


def share_own_view(scene: Scene, camera: Camera, types: bool) -> View | None:
    """The one frame of a scene as its own camera sees it, its arrays shared; None: it has to be drawn.

    A frame with something in its holes (a caller's) is drawn, without that.
    """
    if len(scene.frames) > 1 or not scene.frames[0].camera.same_view_as(camera):
        return None
    view = scene.frames[0].load()
    hole = view.hole
    if not np.array_equal(view.depth > 0, ~hole) or (hole.any() and not has_empty_holes(view)):
        return None
    kinds = (
        TYPE_OF_RANK[hole_kernels.RANK_OF_TYPE].take(view.hole_type) * hole
        if types
        else hole * np.uint8(HoleType.OUT_OF_VIEW)
    )
    return dataclasses.replace(view, camera=camera, hole_type=freeze(kinds), frame=None)


def has_empty_holes(view: View) -> bool:
    """Whether the holes of a view, which has some, are as drawing leaves them: no confidence or error, and no colour or origin
    unless the colour was measured."""
    box = box_around(view.hole, 0)
    unknown, no_color = view.hole[box], view.color_hole[box]
    if view.errors is not None and view.errors[box][unknown].any():
        return False
    known = view.confidence[box][unknown], view.origin[box][no_color], view.color[box][no_color]
    return not any(values.any() for values in known)


def drop_overlap(fills: tuple[Layer, ...]) -> tuple[Layer, ...]:
    """Fills without their overlap with the scene: overlaps join surfaces, but points would be doubled."""
    added = (contribution(view) | view.far for view in (fill.load() for fill in fills))
    return tuple(fill.without(~where, HoleType.NONE) for fill, where in zip(fills, added))


def hole_types(drawn: Drawn, removals: tuple[Layer, ...]) -> UInt8Array:
    """H x W HoleType codes of the empty pixels of a drawn scene; removals: its removed objects."""
    grids, hole, rank_of = drawn.grids, drawn.canvas.depth == 0, hole_kernels.RANK_OF_TYPE
    ranks = np.zeros(hole.shape, np.uint8)
    out = hole_kernels.Holes(hole, cv2.integral(hole.view(np.uint8)), ranks)
    for grid in grids:
        layer = grid.layer
        if not hole.any():
            break
        if grid.own_camera:
            np.maximum(ranks, rank_of[layer.hole_type], out=ranks, where=hole)
        elif layer.shows_source:
            depth, grid_rank = (close_frame if len(grids) > 1 else close_grid)(layer, removals)
            vertices = transform_depth(depth, grid.way)
            crack_rank = int(rank_of[HoleType.CRACK if grid.mode == "points" else HoleType.DISOCCLUDED])
            flying, joined = layer.find_once(find_joints)
            mesh = hole_kernels.ClosedMesh(joined, grid_rank, crack_rank)
            in_bands(hole_kernels.mark_closed_mesh, len(hole), vertices, mesh, box_room(len(hole)), out)
            hole_kernels.mark_points(vertices, flying, int(rank_of[HoleType.FLYING]), out)
    return np.asarray(cv2.LUT(ranks, TYPE_OF_RANK) * hole, np.uint8)


close_frame = keep_latest(close_grid)
"""As `close_grid`, of one of many frames."""


def dilate_holes(view: View, radius: int) -> tuple[View, int]:
    """The view with its holes dilated by `radius` px, and how many known pixels that gave up; each takes the type of the nearest
    hole pixel."""
    given_up = dilate_mask(view.hole, radius) & ~view.hole
    if not given_up.any():
        return view, 0
    larger = view.without(given_up, HoleType.DISOCCLUDED)
    types = np.where(given_up, fill_with_nearest(view.hole_type, view.hole), view.hole_type)
    return dataclasses.replace(larger, hole_type=types), int(given_up.sum())


def render_cloud(cloud: PointCloud, camera: Camera, mode: Mode) -> View:
    """A bare cloud by nearest-pixel projection; its uncovered pixels are OUT_OF_VIEW."""
    if mode != "points":
        raise InputError("a bare point cloud has no pixel grid to triangulate; mode 'points' is expected")
    canvas = Canvas.empty(camera)
    (x, y), z = (part.T for part in project(cloud.points, camera))
    w = np.divide(1, z, out=np.zeros(len(z), np.float32), where=z > NEAR, casting="same_kind")
    points = Planes(cloud.color, z.astype(np.float32), cloud.origin, cloud.confidence, NO_ERRORS)
    draw_points(points, x, y, w, canvas)
    return Drawn(canvas, []).view(camera)
