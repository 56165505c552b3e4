"""The layers of a scene and a camera in; which of them may be seen there, and the few frames that cover its view best, out.

Cost: each frame is sampled once, at about SAMPLES pixels. Samples of frames whose bounding box is in view are projected into
the camera (some 0.1 ms a frame). Only the chosen frames are rendered, and only their pixels are read.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.frames.stored import BoxedView, Layer
from dlama.geometry.holes import Box, larger_box
from dlama.geometry.projection import lift, project, unproject
from dlama.geometry.rgbd import BoolArray, is_valid

MOST_FRAMES = 4
"""Frames that are rendered for one camera."""
SAMPLES = (24, 32)
"""Rows and columns of a frame's samples, and cells of the camera's picture in which they are counted."""
WORTH = np.array([1.0, 0.35, 0.15, 0.05, 0.02, 0.01])
"""Value of the first, second, ... frame that shows a cell: the first shows it, the next confirm it."""
LEAST_WORTH = 0.5
"""Least value, in cells, that a frame must add."""
MARGIN = 0.05
"""Margin of the frustum, over the picture's size: rims are drawn a little larger."""


def box_of(layer: Layer) -> Float64Array | None:
    """8 x 3, the corners of the box that holds a view's points (NaN where there are none); None: far pixels are in no box."""
    return None if layer.has_far else box_corners(lift(layer.load_part()).points)


def may_show(layer: Layer, camera: Camera) -> bool:
    """False where nothing of a view can be seen from a camera. Its pixels are read once, the box of its points is kept."""
    box = layer.find_once(box_of)
    return box is None or bool(intersects_view(box[None], camera)[0])


def intersects_view(corners: Float64Array, camera: Camera) -> BoolArray:
    """N, False for boxes (N x 8 x 3, corners in the world) entirely outside the camera's frustum."""
    pose = camera.world_from_cam
    local = (corners - pose[:3, 3]) @ pose[:3, :3]
    x, y, z = np.moveaxis(local, -1, 0)
    wide, high = MARGIN * camera.width, MARGIN * camera.height
    sides = (
        z,
        x * camera.fx + (camera.cx + wide) * z,
        (camera.width + wide - camera.cx) * z - x * camera.fx,
        y * camera.fy + (camera.cy + high) * z,
        (camera.height + high - camera.cy) * z - y * camera.fy,
    )
    with np.errstate(invalid="ignore"):
        return np.asarray(np.all([(side >= 0).any(1) for side in sides], axis=0))


def find_box_in_view(corners: Float64Array, camera: Camera) -> Box | None:
    """Rows and columns in which a camera sees a box (8 x 3 corners in the world), all of them where that begins behind it; None:
    it is not in view."""
    pixels, z = project(corners, camera)
    low, high = np.zeros(2), np.array(camera.wh, float)
    if (z > 0).all():
        low, high = np.maximum(low, np.floor(pixels.min(0))), np.minimum(high, np.ceil(pixels.max(0)))
    if (high <= low).any() or not (z > 0).any():
        return None
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def find_part(layer: Layer, camera: Camera) -> tuple[Layer, Box]:
    """What of a layer is drawn into a camera, and the rows and columns in which it may be seen: of a boxed layer of another
    camera its part."""
    box = slice(0, camera.height), slice(0, camera.width)
    if not isinstance(layer, BoxedView) or layer.camera.same_view_as(camera):
        return layer, box
    corners = layer.find_once(box_of)
    found = None if corners is None else find_box_in_view(corners, camera)
    return layer.part, box if found is None else larger_box(found, round(MARGIN * camera.width), camera.hw)


def box_corners(points: Float64Array) -> Float64Array:
    """8 x 3, the corners of the box that holds points (N x 3); NaN for no points, which are in no view."""
    ends = zip(points.min(0), points.max(0)) if len(points) else [(np.nan, np.nan)] * 3
    return np.stack(np.meshgrid(*ends, indexing="ij"), -1).reshape(8, 3)


class Samples(NamedTuple):
    """A frame at every few pixels."""

    rows: NDArray[np.intp]
    """N."""
    columns: NDArray[np.intp]
    """N."""
    points: Float64Array
    """N x 3, in the world."""
    box: Float64Array
    """8 x 3, `box_corners`."""
    removed: NDArray[np.intp]
    """Cells of the picture amid a removed object."""


def sample_view(layer: Layer) -> Samples:
    """The samples of a view."""
    view = layer.load()
    grid = [
        np.minimum((np.arange(n) + 0.5) * size / n, size - 1).astype(np.intp)
        for n, size in zip(SAMPLES, view.camera.hw)
    ]
    rows, columns = (part.ravel() for part in np.meshgrid(*grid, indexing="ij"))
    depth = np.where(view.hole[rows, columns], 0, view.depth[rows, columns]).astype(np.float64)
    removed = np.flatnonzero(view.object_hole[rows, columns])
    known = is_valid(depth)
    rows, columns = rows[known], columns[known]
    points = unproject(view.camera, columns + 0.5, rows + 0.5, depth[known])
    return Samples(rows, columns, points, box_corners(points), removed)


def choose_frames(frames: Sequence[Layer], camera: Camera, most: int = MOST_FRAMES) -> list[int]:
    """Indices of the frames for `camera`, by decreasing gain; at most `most`.

    A frame of the camera itself comes first. A frame's value is the number of cells it shows, less those shown already, reduced
    by the angle between the lines of sight and by coarser resolution.
    """
    if len(frames) == 1:
        return [0]
    own = next((place for place, frame in enumerate(frames) if frame.camera.same_view_as(camera)), None)
    visible, cells = find_visible(frames, camera)
    if own is None:
        return [visible[row] for row in _take_greedily(cells, [], most)] or [0]
    first = [visible.index(own)] if own in visible else []
    others = _take_greedily(cells, first, most - 1, least=LEAST_WORTH)
    return [own, *(visible[row] for row in others)]


def find_visible(frames: Sequence[Layer], camera: Camera) -> tuple[list[int], Float64Array]:
    """Places of the frames that may be seen by a camera, and N x cells, how well each of them shows the cells of its picture; 0
    where another one is clearly nearer."""
    samples = [frame.find_once(sample_view) for frame in frames]
    visible = [int(place) for place in np.flatnonzero(intersects_view(np.stack([one.box for one in samples]), camera))]
    seen = [frames[place] for place in visible], [samples[place] for place in visible]
    quality, nearest = _score_visibility(*seen, camera)
    return visible, quality * (nearest * 0.9 <= nearest.min(0, initial=np.inf))


def count_unseen(frames: Sequence[Layer], place: int) -> tuple[int, int]:
    """Cells of a frame's picture in which a removed object was and no frame shows anything; and in which a removed object was."""
    removed = frames[place].find_once(sample_view).removed
    _, cells = find_visible(frames, frames[place].camera)
    return int((cells[:, removed].max(0, initial=0) == 0).sum()), len(removed)


def _take_greedily(cells: Float64Array, first: Sequence[int], most: int, least: float = 0.0) -> list[int]:
    """Rows of N x cells (how well each frame shows a cell), at most `most`, each of which adds most value to `first` and those
    before it: the first `least` at least, the others LEAST_WORTH."""
    counts = (cells[first] > 0).sum(0)
    left = [row for row in range(len(cells)) if row not in first]
    taken: list[int] = []
    while left and len(taken) < most:
        gains = cells[left] @ WORTH[np.minimum(counts, len(WORTH) - 1)]
        best = int(np.argmax(gains))
        if gains[best] == 0 or gains[best] < (LEAST_WORTH if taken else least):
            break
        taken.append(left.pop(best))
        counts[cells[taken[-1]] > 0] += 1
    return taken


def _score_visibility(
    frames: Sequence[Layer], sampled: Sequence[Samples], camera: Camera
) -> tuple[Float64Array, Float64Array]:
    """N x cells: how well each frame shows a cell of the camera's picture (0..1), and its nearest depth there (inf = none)."""
    rows, columns = SAMPLES
    quality = np.zeros((len(frames), rows * columns))
    nearest = np.full((len(frames), rows * columns), np.inf)
    points = np.concatenate([np.zeros((0, 3)), *(one.points for one in sampled)])
    place = np.repeat(np.arange(len(frames)), [len(one.points) for one in sampled])
    pixels, z = project(points, camera)
    inside = (z > 0) & (pixels >= 0).all(1) & (pixels[:, 0] < camera.width) & (pixels[:, 1] < camera.height)
    place, points, z = place[inside], points[inside], z[inside]
    x, y = (pixels[inside] / camera.wh * (columns, rows)).astype(np.intp).T
    centers = np.array([frame.camera.world_from_cam[:3, 3] for frame in frames]).reshape(-1, 3)
    focal = np.array([frame.camera.fx for frame in frames])
    here, there = points - camera.world_from_cam[:3, 3], points - centers[place]
    far_here, far_there = np.linalg.norm(here, axis=1), np.linalg.norm(there, axis=1)
    cosine = (here * there).sum(1) / np.maximum(far_here * far_there, 1e-9)
    coarser = np.maximum(1.0, far_there * camera.fx / np.maximum(far_here * focal[place], 1e-9))
    np.maximum.at(quality, (place, y * columns + x), np.maximum(0.05, cosine) / coarser)
    np.minimum.at(nearest, (place, y * columns + x), z)
    return quality, nearest
