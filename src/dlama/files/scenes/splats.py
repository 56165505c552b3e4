"""A scene in; Gaussian splats out, as a PLY file in the layout of "3D Gaussian Splatting" (Kerbl et al., 2023), of SH degree 0.

One splat a pixel and layer: an ellipse in the surface, as large as the pixel's step to its neighbours on it. Soft borders of the
source are splats of less opacity. Axes are OpenCV's, as in COLMAP scenes that such files come from.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.lib.recfunctions import unstructured_to_structured
from plyfile import PlyData, PlyElement

from dlama.errors import warn
from dlama.files.scenes.textured_mesh import average_visible
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.drawing.grid_mesh import mesh_grid
from dlama.geometry.kernels.depth_edges import DOWN, RIGHT
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.layered_mesh import fill_own_holes, sky_distance
from dlama.geometry.layers.source_sheets import Sheet, cut_source, depth_of_sphere
from dlama.geometry.layers.subsampling import step_for, subsample
from dlama.geometry.motion.poses import quaternion_from_rotation
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike, new_file

MOST_SPLATS = 600_000
SIZE = 0.75
"""Standard deviation of a splat in steps to the neighbouring pixels. Viewers that keep a splat's integral where it is smaller
than their pixels show a sheet of smaller ones through (0.6: 5 % darker on black)."""
OPAQUE = 0.98
"""Opacity of a splat in the middle, where the surface is opaque."""
FIELDS = (
    *"xyz", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
    "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
)  # fmt: skip


def write_splats(path: PathLike, rows: np.ndarray) -> None:
    """Write splats, N x len(FIELDS), of `scene_splats`; warns of a far origin. OutputError."""
    warn_of_rounding(path, rows, rows[:, :3].astype("<f4"))
    vertex = unstructured_to_structured(rows, np.dtype([(name, "<f4") for name in FIELDS]))
    with new_file(path) as draft:
        PlyData([PlyElement.describe(vertex, "vertex")], byte_order="<").write(str(draft))


def warn_of_rounding(path: PathLike, rows: np.ndarray, stored: np.ndarray) -> None:
    """Warn (UserWarning) where 1 % of the splats (N x len(FIELDS)) have positions that are rounded, to N x 3, by more than their
    size."""
    moved, sizes = np.abs(stored - rows[:, :3]).max(1), FIELDS.index("scale_0")
    if np.count_nonzero(moved > np.exp(rows[:, sizes : sizes + 2]).max(1)) > 0.01 * len(rows):
        warn(
            f"{Path(path).name}: splats are moved by up to {moved.max():.2g} m, as the world's origin is "
            f"{np.abs(rows[:, :3]).max() / 1000:,.0f} km away and the format has few bits; give poses near the origin"
        )


def scene_splats(scene: Scene, box: HeadBox) -> np.ndarray:
    """N x len(FIELDS): the splats of a scene, MOST_SPLATS or fewer: the source is subsampled until it has two thirds of them, the
    other layers to what is left."""
    source, others = fill_own_holes(scene, box.camera)
    sky = sky_distance(scene, box)
    step = step_for(int((source.valid | source.far).sum()), 2 / 3 * MOST_SPLATS)
    parts = [sheet_splats(sheet) for sheet in cut_source(source, box, step, sky)]
    layers = [layer.load() for layer in others]
    counts = [int((contribution(one) | one.far).sum()) * (box.camera.fx / one.camera.fx) ** 2 for one in layers]
    step = max(step, step_for(sum(counts), MOST_SPLATS - sum(map(len, parts))))
    for one in layers:
        own = max(1, round(step * one.camera.fx / box.camera.fx))
        if min(one.camera.hw) >= 2 * own:
            parts.append(layer_splats(subsample(one, own), (box.camera, sky)))
    return np.concatenate(parts)


def sheet_splats(sheet: Sheet) -> np.ndarray:
    """N x len(FIELDS): the splats of one of the layers that a source is cut into; its picture's alpha is their opacity."""
    depth, joined = sheet.grid
    rows, columns = (side * sheet.step for side in depth.shape)
    color, share = average_visible(sheet.picture[:rows, :columns], (depth.shape[1], depth.shape[0]))
    shown = (depth > 0) & (share >= 0.02)
    return grid_splats(sheet.layer.camera, (depth * (1 + sheet.behind), joined), shown, color, peak_opacity(share))


def layer_splats(view: View, sky: tuple[Camera, float]) -> np.ndarray:
    """N x len(FIELDS): the splats of what a layer adds to its scene."""
    depth, joined = mesh_grid(view)
    shown = ((contribution(view) | view.far) & (depth > 0)) | (view.far & view.filled) | (view.far & view.shows_source)
    depth = np.where(view.far, depth_of_sphere(view.camera, *sky), np.where(depth > 0, depth, view.depth))
    return grid_splats(view.camera, (depth, joined), shown, view.color, np.full(depth.shape, OPAQUE))


def peak_opacity(share: np.ndarray) -> np.ndarray:
    """The opacity of each splat with which a sheet of them, each with its neighbours around it, has that share (0..1)."""
    away = np.add.outer(np.arange(-2, 3) ** 2, np.arange(-2, 3) ** 2)
    peaks = np.linspace(0, OPAQUE, 64)
    shares = 1 - np.prod(1 - peaks[:, None, None] * np.exp(-away / (2 * SIZE**2)), axis=(1, 2))
    return np.interp(share, shares, peaks)


def grid_splats(
    camera: Camera, grid: tuple[np.ndarray, np.ndarray], shown: BoolArray, color: np.ndarray, opacity: np.ndarray
) -> np.ndarray:
    """N x len(FIELDS): a splat for each pixel that is shown. grid: H x W depth (m) and which neighbours are joined; color: H x W
    x 3 levels; opacity: H x W in the middle of a splat, 0..1."""
    depth, joined = grid
    points = rays(camera) * depth[..., None].astype(np.float64)
    right = tangent(points, 1, (joined & RIGHT) > 0, depth / camera.fx)
    down = tangent(points, 0, (joined & DOWN) > 0, depth / camera.fy)
    right, down, points = right[shown], down[shown], points[shown]
    x, along = unit(right)
    normal, _ = unit(np.cross(x, down))
    y = np.cross(normal, x)
    across = np.abs((y * down).sum(1, keepdims=True))
    turn = camera.world_from_cam[:3, :3]
    axes = np.einsum("ij,njk->nik", turn, np.stack([x, y, normal], 2))
    thickness = 0.1 * np.minimum(along, across)
    sizes = np.log(np.maximum(SIZE * np.concatenate([along, across, thickness], 1), 1e-9))
    harmonic = (color[shown] / 255 - 0.5) / 0.28209479177387814  # that of degree 0: colour = 0.5 + this * f_dc
    world = points @ turn.T + camera.world_from_cam[:3, 3]
    logit = np.log(opacity[shown] / (1 - opacity[shown]))[:, None]
    wxyz = np.roll(quaternion_from_rotation(axes), 1, axis=1)
    return np.concatenate([world, axes[..., 2], harmonic, logit, sizes, wxyz], 1)


def tangent(points: Float64Array, axis: int, joined: BoolArray, size: np.ndarray) -> Float64Array:
    """H x W x 3: the step from each pixel to its next neighbour along an axis, or to the one before; where neither is joined to
    it, as long as on a surface that faces the camera (size, metres)."""
    step = np.diff(points, axis=axis, append=np.take(points, [-1], axis))
    before, joined_before = np.roll(step, 1, axis), np.roll(joined, 1, axis)
    facing = np.zeros(3)
    facing[1 - axis] = 1
    return np.where(joined[..., None], step, np.where(joined_before[..., None], before, size[..., None] * facing))


def unit(vectors: Float64Array) -> tuple[Float64Array, Float64Array]:
    """N x 3 vectors of length 1, and their lengths, N x 1."""
    length = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return vectors / length, length
