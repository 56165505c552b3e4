"""The frames of a scene and a camera in; their merged view on one canvas out.

Each of at most MOST_FRAMES frames is drawn into the camera. Per pixel, depths within the measured noise are one surface. The
nearest surface counts, unless as many frames saw through it as show it. Its depth is the mean, its colour that of the frames
that see it best.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import cv2
import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.codes import HoleType, Origin, from_source
from dlama.geometry.drawing.canvas import Canvas
from dlama.geometry.drawing.layers import ALL, Drawn, Grid, Mode, Surface, count_needed, draw_apart
from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.frames.choosing import MOST_FRAMES, choose_frames
from dlama.geometry.frames.foreground import interpolate_harmonic
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import box_around, morphological_open, square
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.kernels.drawing import merging as kernels
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.projection import inverse_depth, project_to_pixels, px_from_px, unproject
from dlama.geometry.rgbd import Float32Array, UInt16Array, paste, replace_pixels
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

KEPT, KEPT_PIXELS = 4 * MOST_FRAMES, 5_000_000
"""Layers of which is kept what drawing needs of them, some 30 bytes a pixel, and pixels that they have together at most."""
UNLIKE = 8.0
"""Levels beyond which another frame shows what lies behind: none measured the surface in front, which would hide it."""
Found = TypeVar("Found")


def merge_frames(scene: Scene, camera: Camera, mode: Mode, fine: bool, errors: bool = False) -> Drawn:
    """The frames of a scene, merged as `camera` sees them; `errors`: onto a canvas that has expected errors, too.

    In the camera of a frame its own pixels stay bit for bit; the others are drawn only where it has no depth.
    """
    places = choose_frames(scene.frames, camera)
    frames = [scene.frames[place].load() for place in places]
    grids = [Grid(surface_of(frame), camera, mode, fine) for frame in frames]
    gains = np.array([scene.gains[place] for place in places])
    own = grids[0].layer if grids[0].own_camera else None
    best, count = np.zeros(camera.hw, np.uint16), ALL
    if own is not None:
        gains, best[own.valid | own.far] = gains / gains[0], 1
        count = count_needed(best == 0)
    drawn = [np.zeros((len(grids), *plane.shape), plane.dtype) for plane in Canvas.empty(camera)]
    draw_apart(grids, [Canvas(*planes) for planes in zip(*drawn)], [count] * len(grids), far=True)
    canvas = Canvas.empty(camera, errors)
    _merge_drawn(drawn, grids, canvas, gains, scene.noise, best)
    number = np.array([0, *(scene.numbers[place] + 1 for place in places)], np.uint16)
    if own is not None:
        _open_gaps(canvas, best, own, frames[1:])
        _keep_own(canvas, best, own)
    return Drawn(canvas, grids, number[best], own)


def _merge_drawn(
    drawn: Sequence[np.ndarray],
    grids: Sequence[Grid],
    canvas: Canvas,
    gains: Float64Array,
    noise: tuple[float, float],
    best: UInt16Array,
) -> None:
    """Several canvases onto one, in the pixels where `best` is 0; it gets 1 + the place of the frame that each comes from."""
    camera = grids[0].camera
    ways = [px_from_px(grid.layer.camera, camera) for grid in grids]
    centers = [
        [*(camera.cam_from_world @ grid.layer.camera.world_from_cam)[:3, 3], grid.layer.camera.fx] for grid in grids
    ]
    taken = (
        np.stack([nearest_depth_around(grid.layer) for grid in grids]),
        np.stack([confidence_margin(grid.layer, grid.mode) for grid in grids]),
        np.stack([way.matrix for way in ways]),
        np.stack([way.offset for way in ways]),
        np.array(centers),
        gains,
    )
    color, depth, origin, confidence, _ = drawn
    frames = kernels.Frames(color, depth, origin, confidence, *taken)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    in_bands(kernels.merge, camera.height, frames, lens, np.array(noise), canvas, best)


def keep_latest(function: Callable[..., Found]) -> Callable[..., Found]:
    """Decorator of a function of a frame, and more: what it gave for the frames drawn last is kept, of large frames fewer."""
    keeping = functools.cache(lambda count: functools.lru_cache(count)(function))

    def of_frame(frame: Layer, *more: Hashable) -> Found:
        found: Found = keeping(min(KEPT, KEPT_PIXELS // (frame.camera.width * frame.camera.height)))(frame, *more)
        return found

    return of_frame


@keep_latest
def surface_of(layer: Layer) -> Surface:
    """What drawing needs of a layer."""
    return Surface(layer.load())


@keep_latest
def nearest_depth_around(view: View) -> Float32Array:
    """H x W, the nearest depth measured within 2 px of each pixel with depth, as poses drift: what is before it was seen through;
    0 elsewhere, inf = far."""
    measured = ~view.hole & (view.depth > 0) & from_source(view.origin)
    nearest = cv2.erode(np.where(measured, view.depth, np.float32(np.inf)), square(5))
    return np.where(measured, nearest, np.float32(0))


@keep_latest
def confidence_margin(frame: View, mode: Mode) -> Float32Array:
    """H x W distance in px to the picture's border, the next pixel without depth and, of surfaces, the next depth edge."""
    depth, joined, _ = surface_of(frame).seen
    inside = depth > 0
    if mode == "surface":
        inside[:, :-1] &= (joined[:, :-1] & RIGHT) > 0
        inside[:-1] &= (joined[:-1] & DOWN) > 0
    framed = cv2.copyMakeBorder(inside.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    return np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_3)[1:-1, 1:-1], np.float32)


def _open_gaps(canvas: Canvas, best: UInt16Array, own: View, others: Sequence[View]) -> None:
    """Make holes of the pixels of a removed object in which other frames show what is clearly behind the surface that continues
    from around them, where none of them saw through that surface: they only did not see it either."""
    removed = own.hole & (own.hole_type == HoleType.OBJECT.value) & (best > 0)
    if not removed.any():
        return
    box = box_around(removed, 16)
    known = (own.valid | own.far)[box]
    surface = interpolate_harmonic(inverse_depth(own.known_depth)[box], known)
    rows, columns = np.nonzero(removed[box] & (surface > 1.15 * inverse_depth(canvas.depth)[box]))
    if not len(rows):
        return
    v, u = rows + box[0].start, columns + box[1].start
    points = unproject(own.camera, u + 0.5, v + 0.5, 1 / surface[rows, columns])
    through = np.zeros(len(rows), np.bool_)
    for other in others:
        row, column, z, inside = project_to_pixels(points, other.camera)
        through |= inside & (other.known_depth[row, column] > (1 + AGREES) * z)
    gap = v[~through], u[~through]
    for plane in (*canvas[:4], best):
        plane[gap] = 0


def _keep_own(canvas: Canvas, best: UInt16Array, own: View) -> None:
    """A frame's own pixels as they are; depth of others where it has none, and where they show its colours, is ELSEWHERE."""
    known = own.valid | own.far
    colored = own.depth_hole
    others = ~known & (canvas.depth > 0) & (best > 0)
    between = others & ~colored
    slivers = between & ~morphological_open(between, square(3))  # visible between misaligned edges: left to be filled
    unlike = others & colored
    if unlike.any():
        shown = replace_pixels(own.color, others, canvas.color)
        means = (cv2.blur(each, (7, 7)) for each in (shown, own.color))
        unlike &= cv2.absdiff(*means).mean(-1) > UNLIKE
    for plane in (*canvas[:4], best):
        plane[slivers | unlike] = 0
    others &= best > 0
    canvas.origin[others & (canvas.origin != Origin.DEPTH_FILLED.value)] = Origin.ELSEWHERE
    paste(own.color, known | colored, canvas.color)
    paste(own.origin, known | (colored & (canvas.depth == 0)), canvas.origin)
    paste(own.depth, known, canvas.depth)
    paste(own.confidence, known, canvas.confidence)
    best[known] = 1
