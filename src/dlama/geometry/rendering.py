"""Rendering: a view or a scene and a camera in; the view from that camera out, with its holes typed.

`points` is the paper's P(∇p') (eq. 2): nearest pixel, z-buffered. `surface` draws the pixel grid as a triangle mesh cut at
depth discontinuities, so that surfaces have no cracks and nothing shines through them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dlama.errors import InputError
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import PointCloud
from dlama.geometry.lifting import project
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View

Mode = Literal["surface", "points"]
MODES: tuple[Mode, ...] = ("surface", "points")

NEAR = 1e-3
"""Metres in front of the camera at which rendering begins."""


TYPE_OF_RANK = np.array(
    [HoleType.OUT_OF_VIEW, HoleType.DISOCCLUDED, HoleType.SENSOR, HoleType.FLYING, HoleType.OBJECT, HoleType.CRACK],
    np.uint8,
)
"""Hole types in rising precedence where several apply (ranks of `dlama.geometry.sheet`)."""
RANK_OF_TYPE = np.array([0, 5, 1, 3, 0, 2, 4], np.uint8)
"""Rank of each HoleType."""


def edge_ratio(camera: Camera) -> float:
    """Relative step in inverse depth between neighbouring pixels above which they need a slope to be one surface.

    A surface seen at 80 degrees changes by 5.7 / f per pixel; the floor of 1 % is a depth sensor's noise.
    """
    return float(np.clip(6.0 / camera.fx, 0.01, 0.03))


def inverse_depth(depth: Float32Array) -> Float32Array:
    """1 / depth in 1/m; 0 where depth is missing or far."""
    out = np.zeros_like(depth)
    np.divide(1, depth, out=out, where=depth > 0)
    return out


def flying(view: View) -> BoolArray:
    """H x W, True at flying pixels: depth strictly between two surfaces that are neighbours there, joined to neither."""
    from dlama.geometry import raster

    return raster.flying_pixels(inverse_depth(view.depth), edge_ratio(view.camera))


@dataclass
class Canvas:
    """What has been drawn so far; depth 0 = empty."""

    color: UInt8Array
    depth: Float32Array
    origin: UInt8Array
    confidence: Float32Array

    @classmethod
    def empty(cls, camera: Camera) -> Canvas:
        hw = camera.hw
        return cls(
            np.zeros((*hw, 3), np.uint8), np.zeros(hw, np.float32), np.zeros(hw, np.uint8), np.zeros(hw, np.float32)
        )

    def buffers(self) -> tuple[UInt8Array, Float32Array, UInt8Array, Float32Array]:
        return self.color, self.depth, self.origin, self.confidence

    def put(self, other: Canvas, tolerance: float, over_measured: bool) -> None:
        """Draw another canvas over this one where this is empty or clearly behind (relative tolerance).

        over_measured: False keeps measured pixels in their own camera (nothing filled covers them).
        """
        wins = (other.depth > 0) & ((self.depth == 0) | (other.depth < self.depth * (1 - tolerance)))
        if not over_measured:
            wins &= self.origin != Origin.MEASURED
        self.color[wins], self.depth[wins] = other.color[wins], other.depth[wins]
        self.origin[wins], self.confidence[wins] = other.origin[wins], other.confidence[wins]


def render(
    source: RGBD | View | Scene | PointCloud, camera: Camera, mode: Mode = "surface", types: bool = True
) -> View:
    """The scene from `camera`.

    Holes carry colour 0, depth 0 and a HoleType (`types=False` leaves them all OUT_OF_VIEW, which is faster). At a layer's
    own camera its pixels come back bit for bit. Flying pixels are rejected only when the pose changes. A bare PointCloud has
    no grid to triangulate, so it renders as points; asking for a surface raises InputError.
    """
    if mode not in MODES:
        raise InputError(f"mode is {mode!r}; one of {', '.join(MODES)} is wanted")
    if isinstance(source, PointCloud):
        return render_cloud(source, camera, mode)
    scene = as_scene(source)
    grids = [Grid.of(layer, camera, mode) for layer in scene.layers]
    canvas = Canvas.empty(camera)
    for number, grid in enumerate(grids):
        if number:
            measured = bool((grid.layer.origin == Origin.MEASURED).any())
            canvas.put(draw(grid, camera, Canvas.empty(camera)), tolerance=0.005, over_measured=measured)
        else:
            draw(grid, camera, canvas)
            if grid.still:
                draw_far(grid.layer, camera, canvas)
    for layer in scene.layers:
        draw_far(layer, camera, canvas)
    hole = canvas.depth == 0
    return View(
        camera=camera,
        color=canvas.color,
        depth=canvas.depth,
        hole=hole,
        hole_type=hole_types(grids, scene.objects, camera, hole) if types else hole * np.uint8(HoleType.OUT_OF_VIEW),
        origin=canvas.origin,
        confidence=canvas.confidence,
    )


def as_scene(source: RGBD | View | Scene) -> Scene:
    """Anything that renders, as a scene."""
    if isinstance(source, RGBD):
        source = View.from_rgbd(source)
    return Scene((source,)) if isinstance(source, View) else source


@dataclass(frozen=True, eq=False)
class Grid:
    """A layer made ready for drawing into one camera."""

    layer: View
    still: bool
    """The camera is the layer's own: pixels are copied, nothing is rejected."""
    depth: Float32Array
    """Depth without holes and flying pixels (0)."""
    flying: BoolArray
    joined: UInt8Array | None
    """Which neighbours are one surface, `raster.joints`; None: draw points."""
    matrix: Float64Array
    offset: Float64Array
    """Layer pixels to target pixels, `px_from_px`."""

    @classmethod
    def of(cls, layer: View, camera: Camera, mode: Mode) -> Grid:
        from dlama.geometry import raster

        ratio = edge_ratio(layer.camera)
        depth = np.where(layer.hole, np.float32(0), layer.depth)
        w = inverse_depth(depth)
        mixed = raster.flying_pixels(w, ratio)
        depth[mixed] = w[mixed] = 0
        joined = raster.joints(w, ratio) if mode == "surface" else None
        still = layer.camera.same_view_as(camera)
        return cls(layer, still, depth, mixed, joined, *px_from_px(camera, layer.camera))


def rim(joined: UInt8Array, depth: Float32Array) -> NDArray[np.int64]:
    """Flat indices of vertices round which some quad is not whole: there the mesh ends short of the pixel's edge."""
    whole = np.zeros((joined.shape[0] + 1, joined.shape[1] + 1), np.bool_)
    whole[1:-1, 1:-1] = (joined[:-1, :-1] == 3) & (joined[:-1, 1:] >= 2) & ((joined[1:, :-1] & 1) > 0)
    inner = whole[:-1, :-1] & whole[:-1, 1:] & whole[1:, :-1] & whole[1:, 1:]
    return np.flatnonzero(~inner & (depth > 0))


def draw(grid: Grid, camera: Camera, canvas: Canvas) -> Canvas:
    """One layer's finite surfaces, drawn onto an empty canvas."""
    from dlama.geometry import raster, shading

    layer = grid.layer
    if grid.still:
        copy_onto(canvas, layer)
        return canvas
    pixels = layer.color, layer.origin, layer.confidence
    x, y, w = transformed(grid.depth, grid.matrix, grid.offset)
    wbuf = np.zeros(camera.hw, np.float32)
    if grid.joined is None:
        index = np.full(camera.hw, -1, np.int32)
        raster.draw_points(x, y, w, wbuf, index)
        shading.shade_points(wbuf, index, *pixels, *canvas.buffers())
        return canvas
    where = np.empty((*camera.hw, 2), np.float32)
    raster.draw_surface(x, y, w, grid.joined, wbuf, where)
    raster.draw_rim(
        x, y, w, grid.joined, rim(grid.joined, grid.depth), grid.depth, camera.fx / layer.camera.fx, wbuf, where
    )
    shading.shade_surface(wbuf, where, grid.joined, *pixels, *canvas.buffers())
    return canvas


def mesh_grid(layer: View) -> tuple[Float32Array, UInt8Array]:
    """Depth without flying pixels, and which neighbours are joined into one surface."""
    from dlama.geometry import raster

    depth = Grid.of(layer, layer.camera, "points").depth
    return depth, raster.joints(inverse_depth(depth), edge_ratio(layer.camera))


def copy_onto(canvas: Canvas, layer: View) -> None:
    """The layer seen from its own camera: every finite pixel as it is; a sensor hole its colour, but no depth."""
    copy_where(canvas, layer, layer.valid)
    color_only = layer.hole & (layer.origin == Origin.DEPTH_FILLED)
    np.copyto(canvas.color, layer.color, where=color_only[..., None])
    np.copyto(canvas.origin, layer.origin, where=color_only)


def copy_where(canvas: Canvas, layer: View, where: BoolArray) -> None:
    """The chosen pixels of a layer onto the canvas, as they are."""
    np.copyto(canvas.color, layer.color, where=where[..., None])
    np.copyto(canvas.depth, layer.depth, where=where)
    np.copyto(canvas.origin, layer.origin, where=where)
    np.copyto(canvas.confidence, layer.confidence, where=where)


def draw_far(layer: View, camera: Camera, canvas: Canvas) -> None:
    """The layer's far pixels (sky) behind everything drawn so far."""
    from dlama.geometry import shading

    far = layer.far
    if not far.any():
        return
    if layer.camera.same_view_as(camera):
        copy_where(canvas, layer, far & (canvas.depth == 0))
        return
    turn = layer.camera.cam_from_world[:3, :3] @ camera.world_from_cam[:3, :3]
    matrix = layer.camera.K @ turn @ np.linalg.inv(camera.K)
    shading.shade_far(matrix, far, layer.color, layer.origin, layer.confidence, *canvas.buffers())


def px_from_px(target: Camera, source: Camera) -> tuple[Float64Array, Float64Array]:
    """The 3x3 matrix and 3-vector that take a source pixel (u, v, 1) at depth z to z * matrix @ (u, v, 1) + offset."""
    target_from_source = target.cam_from_world @ source.world_from_cam
    matrix = target.K @ target_from_source[:3, :3] @ np.linalg.inv(source.K)
    return matrix, target.K @ target_from_source[:3, 3]


def transformed(depth: Float32Array, matrix: Float64Array, offset: Float64Array) -> tuple[Float32Array, ...]:
    """Target x, y (pixels) and inverse z (1/m, 0 = not in front) of every source pixel, float32 H x W each."""
    from dlama.geometry import raster

    x, y, w = (np.empty_like(depth) for _ in range(3))
    raster.transform(depth, matrix, offset, NEAR, x, y, w)
    return x, y, w


def hole_types(grids: list[Grid], objects: tuple[View, ...], camera: Camera, hole: BoolArray) -> UInt8Array:
    """H x W HoleType codes of the empty pixels of a scene (its grids, its removed objects) seen from `camera`."""
    from dlama.geometry import sheet

    ranks = np.zeros(hole.shape, np.uint8)
    for grid in grids:
        layer = grid.layer
        if not hole.any():
            break
        if grid.still:
            np.maximum(ranks, RANK_OF_TYPE[layer.hole_type], out=ranks, where=hole)
        elif (layer.origin == Origin.MEASURED).any():
            depth, grid_rank = closed_grid(layer, objects)
            x, y, w = transformed(depth, grid.matrix, grid.offset)
            joined, crack_rank = grid.joined, sheet.DISOCCLUDED_RANK
            if joined is None:
                joined, crack_rank = mesh_grid(layer)[1], sheet.CRACK_RANK
            sheet.mark_sheet(x, y, w, joined, grid_rank, crack_rank, hole, ranks)
            sheet.mark_points(x, y, w, grid.flying, sheet.FLYING_RANK, hole, ranks)
    return np.where(hole, TYPE_OF_RANK[ranks], np.uint8(0)).astype(np.uint8)


def closed_grid(layer: View, objects: tuple[View, ...]) -> tuple[Float32Array, UInt8Array]:
    """Depth of a layer with every gap closed, and the sheet rank of what was closed.

    Removed objects get their own depth back, sensor holes the depth of the nearest pixel, far pixels a large one.
    """
    import cv2

    from dlama.geometry import sheet

    depth = np.where(layer.hole, np.float32(0), layer.depth)
    rank = np.zeros(depth.shape, np.uint8)
    rank[layer.hole & (layer.hole_type == HoleType.SENSOR)] = sheet.SENSOR_RANK
    rank[layer.hole & (layer.hole_type == HoleType.OBJECT)] = sheet.OBJECT_RANK
    for removed in objects:
        if removed.camera.same_view_as(layer.camera):
            depth = np.where((depth == 0) & removed.valid, removed.depth, depth)
    finite = (depth > 0) & (depth < np.inf)
    horizon = 100 * float(depth[finite].max()) if finite.any() else 1e4
    depth = np.minimum(depth, np.float32(horizon))
    known = depth > 0
    if known.any() and not known.all():
        _, labels = cv2.distanceTransformWithLabels(
            (~known).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        of_label = np.zeros(labels.max() + 1, np.float32)
        of_label[labels[known]] = depth[known]
        depth = np.where(known, depth, of_label[labels])
    return depth, rank


def render_cloud(cloud: PointCloud, camera: Camera, mode: Mode) -> View:
    """A bare cloud by nearest-pixel projection; its uncovered pixels are OUT_OF_VIEW (a cloud does not know more)."""
    if mode != "points":
        raise InputError("a bare point cloud has no pixel grid to triangulate; mode 'points' is wanted")
    canvas = Canvas.empty(camera)
    pixels, z = project(cloud.points, camera)
    inside = (z > NEAR) & (pixels >= 0).all(1) & (pixels[:, 0] < camera.width) & (pixels[:, 1] < camera.height)
    chosen = np.flatnonzero(inside)
    chosen = chosen[np.argsort(-z[chosen], kind="stable")]  # far to near: the last writer is the nearest
    column, row = pixels[chosen].astype(np.int64).T
    canvas.color[row, column] = cloud.color[chosen]
    canvas.depth[row, column] = z[chosen]
    origin = cloud.origin[chosen]
    canvas.origin[row, column] = np.where(origin == Origin.MEASURED, np.uint8(Origin.REPROJECTED), origin)
    canvas.confidence[row, column] = cloud.confidence[chosen]
    hole = canvas.depth == 0
    return View(
        camera,
        canvas.color,
        canvas.depth,
        hole,
        hole * np.uint8(HoleType.OUT_OF_VIEW),
        canvas.origin,
        canvas.confidence,
    )
