"""One layer and a camera in; its surfaces, or its points, and its sky drawn on a canvas out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing.canvas import Canvas
from dlama.geometry.drawing.grid_mesh import Seen, seen_from_elsewhere, smooth_noise
from dlama.geometry.holes import dilate_square
from dlama.geometry.kernels.drawing import rasterize as raster
from dlama.geometry.kernels.drawing import shading
from dlama.geometry.kernels.drawing.chunks import CHUNK, Vertices
from dlama.geometry.kernels.drawing.footprints import draw_rim, rim
from dlama.geometry.kernels.drawing.rasterize import ZBuffer
from dlama.geometry.kernels.drawing.sampling import MeshColors, far_blocks, smooth_quads, spline
from dlama.geometry.kernels.jit import in_bands, light_band
from dlama.geometry.projection import PixelMap, px_from_px
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, UInt16Array, freeze, paste
from dlama.geometry.view import View

Mode = Literal["surface", "points"]
MODES: tuple[Mode, ...] = ("surface", "points")

ALL = np.zeros((0, 0), np.int32)
"""Instead of a table of the pixels that count (`count_needed`): all do."""
NO_ERRORS = freeze(np.zeros((0, 0, 2), np.float32))
"""Instead of `View.errors` where there are none."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What drawing needs of a layer, the same for every camera; each is found when it is asked for first."""

    layer: View

    @cached_property
    def seen(self) -> Seen:
        """What other cameras see of it."""
        return seen_from_elsewhere(self.layer)

    @cached_property
    def drawn_depth(self) -> Float32Array:
        """Its depth without noise (`smooth_noise`), as other cameras see it."""
        return smooth_noise(self.layer, self.seen.depth)

    @cached_property
    def knots(self) -> Float32Array:
        """Of the colours' splines (`sampling.spline`)."""
        return spline(self.layer.color)

    @cached_property
    def rim(self) -> NDArray[np.int64]:
        """As `footprints.rim`."""
        return rim(self.seen.joined, self.seen.depth)

    @cached_property
    def smooth(self) -> UInt8Array:
        """Where colours are read by splines (`sampling.smooth_quads`)."""
        return smooth_quads(self.seen.joined)


@dataclass(frozen=True, eq=False)
class Grid:
    """A layer prepared for drawing into one camera."""

    surface: Surface
    camera: Camera
    mode: Mode
    fine: bool
    """Colours by cubic B-spline; False: bilinear."""

    @property
    def layer(self) -> View:
        """The layer."""
        return self.surface.layer

    @property
    def way(self) -> PixelMap:
        """From layer pixels to target pixels."""
        return px_from_px(self.camera, self.layer.camera)

    @cached_property
    def own_camera(self) -> bool:
        """The camera is the layer's own: pixels are copied, nothing is rejected."""
        return self.layer.camera.same_view_as(self.camera)

    @property
    def knots(self) -> Float32Array:
        """Of the colours' splines; none where not fine."""
        return self.surface.knots if self.fine else np.empty(0, np.float32)

    @property
    def pixels(self) -> shading.Planes:
        """Those of the layer, for kernels."""
        layer = self.layer
        errors = NO_ERRORS if layer.errors is None else layer.errors
        return shading.Planes(layer.color, layer.depth, layer.origin, layer.confidence, errors)


class Drawn(NamedTuple):
    """What was drawn of a scene."""

    canvas: Canvas
    grids: list[Grid]
    """Of its layers."""
    frame: UInt16Array | None = None
    """H x W, 1 + the number of the frame that a pixel comes from, of a scene of many; 0 = none."""
    own: View | None = None
    """The frame whose camera it is."""

    def view(self, camera: Camera, hole_type: UInt8Array | None = None) -> View:
        """As a view, whose holes have these types (H x W); None: all are OUT_OF_VIEW."""
        canvas, frame = self.canvas, self.frame
        if self.own is not None:
            canvas.keep_colors(self.own)
        color, depth, origin, confidence, errors = (freeze(plane) for plane in canvas)
        frame = None if frame is None else freeze(frame * np.uint16(origin != Origin.FILLED.value))
        hole = freeze(depth == 0)
        types = hole * np.uint8(HoleType.OUT_OF_VIEW) if hole_type is None else hole_type
        return View(
            camera, color, depth, hole, freeze(types), origin, confidence, frame, errors if len(errors) else None
        )


def count_needed(needed: BoolArray) -> NDArray[np.int32]:
    """The table for `draw` of the pixels that count (H x W); with their neighbours, which colours are averaged over."""
    return np.asarray(cv2.integral(dilate_square(needed, 3).view(np.uint8)), np.int32)


def crop_count(count: NDArray[np.int32], rows: slice, columns: slice) -> NDArray[np.int32]:
    """The table for a part of the picture."""
    part = slice(rows.start, rows.stop + 1), slice(columns.start, columns.stop + 1)
    return np.ascontiguousarray(count[part]) if count.size else count


def draw(grid: Grid, canvas: Canvas, count: NDArray[np.int32] = ALL) -> Canvas:
    """One layer's finite surfaces, drawn onto an empty canvas.

    count: of the pixels that count (`count_needed`); all others may come out as anything.
    """
    if grid.own_camera:
        view = grid.layer
        canvas.copy_where(view, view.valid)
        paste(view.color, view.depth_hole, canvas.color)  # of a sensor hole the colour, but no depth
        paste(view.origin, view.depth_hole, canvas.origin)
    elif grid.mode == "points":
        x, y, w, _ = (plane.ravel() for plane in transform_depth(grid.surface.seen.depth, grid.way))
        with np.errstate(divide="ignore"):  # where there is nothing
            depth = np.float32(1) / w
        draw_points(grid.pixels._replace(depth=depth), x, y, w, canvas)
    else:
        draw_as_surface(grid, canvas, count)
    return canvas


def draw_apart(
    grids: Sequence[Grid], canvases: Sequence[Canvas], counts: Sequence[NDArray[np.int32]], far: bool = False
) -> None:
    """Layers side by side, each onto its own canvas by `draw`, and where `far` by `draw_far`."""

    def draw_some(first: int, last: int) -> None:
        for grid, canvas, count in zip(grids[first:last], canvases[first:last], counts[first:last]):
            draw(grid, canvas, count)
            if far:
                draw_far(grid, canvas)

    in_bands(draw_some, len(grids), band=1)


def draw_points(points: shading.Planes, x: np.ndarray, y: np.ndarray, w: Float32Array, canvas: Canvas) -> None:
    """Points (planes of any shape) onto the pixel that each falls on, where it is the nearest (the paper's P', eq. 2).

    x, y: N px; w: N inverse depths (1/m), 0 = nothing, or not in front: x and y may be anything there.
    """
    (height, width), count = canvas.depth.shape, len(w)
    nearest = np.zeros(height * width, np.uint64)
    in_bands(raster.drop_points, count, x, y, w, width, nearest, band=count)
    in_a_column = shading.Planes(
        points.color.reshape(-1, 1, 3),
        points.depth.reshape(-1, 1),
        points.origin.reshape(-1, 1),
        points.confidence.reshape(-1, 1),
        points.errors.reshape(-1, 1, 2),
    )
    in_bands(shading.shade_points, height, nearest.reshape(height, width), in_a_column, canvas, band=light_band(width))


def draw_as_surface(grid: Grid, canvas: Canvas, count: NDArray[np.int32]) -> None:
    """The layer's mesh, and footprints at its rim."""
    layer, rows = grid.layer, grid.camera.height
    depth, joined = grid.surface.drawn_depth, grid.surface.seen.joined
    drawn = rasterize_surface(depth, joined, grid.surface.rim, layer.camera, grid.camera, count)
    smooth = grid.surface.smooth if grid.fine else np.zeros_like(joined)
    colors = MeshColors(joined, smooth, layer.color, grid.knots)
    in_bands(shading.shade_surface, rows, drawn, colors, grid.fine, grid.pixels, canvas)


def rasterize_surface(
    depth: Float32Array,
    joined: UInt8Array,
    rim: NDArray[np.int64],
    source: Camera,
    target: Camera,
    count: NDArray[np.int32] = ALL,
) -> ZBuffer:
    """What each of H x W pixels of a target camera shows of the mesh of a source's depth (`mesh_grid`) and the footprints at its
    rim (`footprints.rim`). count: as of `draw`."""
    vertices, hw = transform_depth(depth, px_from_px(target, source)), target.hw
    drawn = ZBuffer(np.zeros(hw, np.float32), np.empty((*hw, 2), np.float32))
    in_bands(raster.draw_surface, hw[0], vertices, joined, count, box_room(hw[0]), drawn)
    draw_rim(vertices, joined, rim, depth, target.fx / source.fx, drawn.w.copy(), drawn)
    return drawn


def draw_far(grid: Grid, canvas: Canvas) -> None:
    """The layer's far pixels (sky) behind everything drawn so far."""
    layer, camera = grid.layer, grid.camera
    far = layer.far if grid.own_camera else grid.surface.seen.far
    if not far.any():
        return
    if grid.own_camera:
        canvas.copy_where(layer, far & (canvas.depth == 0))
        return
    matrix, _ = px_from_px(layer.camera, camera)
    sky, band = shading.Sky(far, far_blocks(far, grid.fine)), light_band(camera.width)
    in_bands(shading.shade_far, camera.height, matrix, sky, grid.knots, grid.pixels, canvas, band=band)


def transform_depth(depth: Float32Array, way: PixelMap) -> Vertices:
    """Every source pixel (H x W metres) in a target."""
    (height, width), (x, y, w) = depth.shape, (np.empty(depth.shape, np.float32) for _ in range(3))
    vertices = Vertices(x, y, w, np.empty((height, -(-width // CHUNK), 2), np.float32))
    in_bands(raster.transform, height, depth, way, vertices, band=light_band(width))
    return vertices


def box_room(rows: int) -> NDArray[np.int32]:
    """Room to work for `raster.draw_surface`."""
    return np.empty((rows, 4, CHUNK), np.int32)
