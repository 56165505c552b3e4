"""Rows of shapes in; their bounding boxes, seen from a camera or across the light, out: which shapes a ray may meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.motion.poses import transform_points
from dlama.worlds.raycast import shape_rows as k

Int32Array = NDArray[np.int32]
SIDE = 48
"""Cells of the grid across the light, along each side."""


def boxes_by_depth(shapes: Float64Array, camera: Camera) -> tuple[Float64Array, Int32Array]:
    """Bounding boxes before a camera, nearest first: centre, three half edges (camera axes) and nearest depth, M x 13, metres;
    and whose they are, M int32."""
    centre, edges = bounding_boxes(shapes)
    cam_from_world = camera.cam_from_world
    centre = transform_points(cam_from_world, centre)
    edges = edges @ cam_from_world[:3, :3].T
    reach = np.abs(edges[..., 2]).sum(1)
    near = centre[:, 2] - reach
    order = np.argsort(near, kind="stable")
    order = order[(centre[:, 2] + reach > 0)[order]]
    boxes = np.concatenate([centre, edges.reshape(-1, 9), near[:, None]], 1)
    return np.ascontiguousarray(boxes[order]), order.astype(np.int32)


def shadow_cells(shapes: Float64Array, to_light: Float64Array) -> tuple[Float64Array, Int32Array, Int32Array]:
    """Which shapes may shade what: a grid across the light.

    Returns ten numbers (two axes of 3, first x, first y, cells per metre, cells a side) and the lists as starts
    (int32, SIDE^2 + 1) and items (int32).
    """
    axis = np.cross(to_light, (1.0, 0, 0) if abs(to_light[0]) < 0.8 else (0, 0, 1.0))
    e1 = axis / np.linalg.norm(axis)
    e2 = np.cross(to_light, e1)
    casting = np.flatnonzero(shapes[:, k.CASTS] > 0)
    centre, edges = bounding_boxes(shapes[casting])
    low, high = [], []
    for e in (e1, e2):
        middle, reach = centre @ e, np.abs(edges @ e).sum(1) + 2 * k.LIFT
        low.append(middle - reach)
        high.append(middle + reach)
    first = np.array([x.min(initial=0) for x in low])
    last = np.array([x.max(initial=1) for x in high])
    scale = SIDE / float((last - first).max() * 1.0001)
    inside, cell = [], np.arange(SIDE)[:, None]
    for lo, hi, start in zip(low, high, first):
        inside.append((np.floor((lo - start) * scale) <= cell) & (np.floor((hi - start) * scale) >= cell))
    cell_of, item = np.nonzero((inside[1][:, None] & inside[0][None]).reshape(SIDE * SIDE, -1))
    starts = np.searchsorted(cell_of, np.arange(SIDE * SIDE + 1)).astype(np.int32)
    return np.array([*e1, *e2, *first, scale, SIDE]), starts, casting[item].astype(np.int32)


def bounding_boxes(shapes: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Bounding boxes of shapes in the world: centres N x 3 and three half edges each, N x 3 x 3."""
    half = shapes[:, k.HALF : k.HALF + 3].copy()
    tube = shapes[:, k.KIND] == k.TUBE
    half[tube, 0] = half[tube, 2] = np.maximum(half[tube, 0], half[tube, 2])
    return shapes[:, k.CENTRE : k.CENTRE + 3], shapes[:, k.TURN : k.TURN + 9].reshape(-1, 3, 3) * half[..., None]
