"""Projection: depth or disparity and a camera in, world points out; and the way back (paper, sec. 3.1: P(I, lambda)).

Pixel centres, axes and units are those of `dlama.geometry.camera`. Pure numpy.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlama.arguments import check_arguments
from dlama.geometry.camera import Camera, Float64Array, StereoRig
from dlama.geometry.cloud import PointCloud
from dlama.geometry.motion.poses import transform_points
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.geometry.view import View

SMALLEST_DISPARITY = np.float32(1e-6)
"""Pixels; stands in for a measured disparity of exactly 0, because 0 means missing."""


def depth_from_disparity(disparity: ArrayLike, rig: StereoRig) -> Float32Array:
    """Planar depth in metres, float32 of the same shape: Z = fx * baseline / (disparity + doffs).

    `disparity` in pixels, left x minus right x, any float or integer dtype. A disparity of 0, NaN or infinity is missing and
    gives 0. Other disparities are numbers, negative ones too: d = -doffs is a point at infinity and gives +inf (far); d < -doffs
    lies behind the cameras, no point can do that, and gives 0 (missing).
    """
    doffs = rig.doffs
    measured = np.asarray(disparity, np.float32)
    known = np.isfinite(measured) & (measured != 0)
    # Compared in float32, so that what disparity_from_depth wrote for "far" is recognised for any digits of doffs.
    far = known & (measured == np.float32(-doffs))
    shift = measured.astype(np.float64) + doffs
    front = known & ~far & (shift > 0)
    depth = np.zeros(measured.shape, np.float32)
    with np.errstate(over="ignore"):  # too far for float32: inf, which is what far is called
        depth[front] = rig.left.fx * rig.baseline_m / shift[front]
    depth[far] = np.inf
    return depth


def known_disparity(disparity: Float32Array, rig: StereoRig) -> Float32Array:
    """Pixels, float32 of the same shape; 0 (missing) where it is not finite or lies behind the cameras, as the -1 of OpenCV's
    matchers does. With doffs -1 may be far: one negative number alone is such a code, unless it is that of infinity."""
    found = np.where(np.isfinite(disparity), disparity, 0).astype(np.float32)
    negative = found[found < 0]
    if negative.size and negative.min() == negative.max() != np.float32(-rig.doffs):
        found[found < 0] = 0
    return np.where(depth_from_disparity(found, rig) > 0, found, np.float32(0))


def disparity_from_depth(depth: ArrayLike, rig: StereoRig) -> Float32Array:
    """Disparity in pixels, float32 of the same shape: d = fx * baseline / Z - doffs; 0 = missing.

    Missing depth (0 or NaN) gives 0. Far depth (+inf) gives -doffs; with doffs = 0 that is 0, so far and missing cannot
    be distinguished in such a disparity map. A valid depth that falls exactly on d = 0 is written as 1e-6 px, or it would
    be lost.
    """
    metres = np.asarray(depth, np.float32).astype(np.float64)
    known = metres > 0
    disparity = np.zeros(metres.shape, np.float32)
    with np.errstate(over="ignore"):
        disparity[known] = rig.left.fx * rig.baseline_m / metres[known] - rig.doffs
    disparity[known & np.isfinite(metres) & (disparity == 0)] = SMALLEST_DISPARITY
    return disparity


def inverse_depth(depth: Float32Array) -> Float32Array:
    """1 / depth in 1/m, float32 of the same shape; 0 where depth (metres, 0 = missing, +inf = far) is missing or far."""
    out = np.zeros_like(depth)
    np.divide(1, depth, out=out, where=depth > 0)
    return out


def depth_from_inverse(w: Float32Array) -> Float32Array:
    """Metres from inverse depth (1/m), float32 of the same shape; 0 is far (+inf)."""
    out = np.full(w.shape, np.inf, np.float32)
    np.divide(1, w, out=out, where=w > 0)
    return out


def round_depth(depth: Float32Array, up: bool = False) -> Float32Array:
    """Depth (metres) to 1 part in 100,000, far below the error of any estimate: files of it are half as large. up: never to a
    smaller depth, so that nothing comes to lie in front of what it lay behind."""
    bits = depth.view(np.uint32) + np.uint32(127 if up else 64)
    bits &= np.uint32(0xFFFFFF80)  # infinity has none of the bits that go
    return bits.view(np.float32)


class PixelMap(NamedTuple):
    """What takes a source pixel (u, v, 1) at depth z to z * matrix @ (u, v, 1) + offset: (x, y, 1) * depth in the target, pixels
    and metres. Kernels take it as it is."""

    matrix: Float64Array
    """3x3, K_target R K_source^-1."""
    offset: Float64Array
    """3, K_target t."""


@functools.lru_cache(1024)  # asked for again and again while depth is projected onto the law of many frames
def px_from_px(target: Camera, source: Camera) -> PixelMap:
    """From pixels of the source to those of the target."""
    target_from_source = target.cam_from_world @ source.world_from_cam
    matrix = target.K @ target_from_source[:3, :3] @ np.linalg.inv(source.K)
    return PixelMap(matrix, target.K @ target_from_source[:3, 3])


def rays(camera: Camera) -> Float64Array:
    """H x W x 3, the direction through each pixel's centre in camera axes, with z = 1: ray * depth is a point."""
    directions = np.ones((*camera.hw, 3))
    directions[..., 0], directions[..., 1] = _slopes(camera)
    return directions


def _slopes(camera: Camera) -> tuple[Float64Array, Float64Array]:
    """W and H x 1, how far the rays of columns and of rows go right and down in one metre of depth."""
    column, row = (np.arange(n, dtype=np.float64) + 0.5 for n in camera.wh)
    return (column - camera.cx) / camera.fx, ((row - camera.cy) / camera.fy)[:, None]


def ray_lengths(camera: Camera) -> Float32Array:
    """H x W, length of the ray to each pixel's centre for one metre of depth: 1 at the principal point, more towards the rim."""
    x, y = _slopes(camera)
    return np.sqrt(1 + x**2 + y**2).astype(np.float32)


def lift(source: RGBD | View) -> PointCloud:
    """The cloud of all valid pixels (finite depth, no hole), row by row, in world coordinates.

    Far and missing pixels have no point. An RGBD's points are MEASURED with confidence 1, or ESTIMATED; a View's carry its own.

    Examples:
        >>> import dlama
        >>> folder = dlama.example()
        >>> rgbd = dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90)
        >>> len(dlama.lift(rgbd).points) == int(rgbd.valid.sum())
        True
    """
    check_arguments(lift, locals())
    if isinstance(source, RGBD):
        source = View.from_rgbd(source)
    valid = source.valid
    rows, columns = np.nonzero(valid)
    points = unproject(source.camera, columns + 0.5, rows + 0.5, source.depth[valid])
    return PointCloud(points, source.color[valid], source.origin[valid], source.confidence[valid])


def world_points(view: View) -> Float64Array:
    """H x W x 3, each pixel's point in the world; pixels without depth at the camera."""
    depth = np.where(view.valid, view.depth, 0)
    return transform_points(view.camera.world_from_cam, rays(view.camera) * depth[..., None])


def unproject(camera: Camera, x: NDArray[Any], y: NDArray[Any], depth: NDArray[Any]) -> Float64Array:
    """N x 3 points in the world at places x, y of the picture (N px, a pixel's centre ends in .5) and depths (N metres)."""
    points = np.empty((len(depth), 3))
    points[:, 0] = (x - camera.cx) / camera.fx * depth
    points[:, 1] = (y - camera.cy) / camera.fy * depth
    points[:, 2] = depth
    return transform_points(camera.world_from_cam, points)


def project(points: Float64Array, camera: Camera) -> tuple[Float64Array, Float64Array]:
    """Where world points (N x 3, metres) land in a camera: (N x 2 pixel coordinates x, y; N planar z in metres).

    A point on a pixel's centre has coordinates ending in .5; floor gives its pixel. Coordinates may lie outside the
    picture. A point at z <= 0 is not in front of the camera: its coordinates are NaN, its z is returned as it is.
    """
    pose = camera.world_from_cam
    # R^T (p - t), not R^T p - R^T t: far from the world's origin the difference keeps its digits.
    in_camera = (points - pose[:3, 3]) @ pose[:3, :3]
    z = in_camera[:, 2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        pixels = in_camera[:, :2] / z[:, None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    pixels[~(z > 0)] = np.nan
    return pixels, z


def project_to_pixels(
    points: Float64Array, camera: Camera
) -> tuple[NDArray[np.intp], NDArray[np.intp], Float64Array, BoolArray]:
    """Row, column and depth in metres of world points (... x 3), and whether each is in the camera's picture.

    Of points that are not, row and column are those of the nearest pixel; of points that do not lie in front of the camera, 0.
    """
    pixels, z = project(points.reshape(-1, 3), camera)
    inside = np.asarray((pixels >= 0).all(1) & (pixels < camera.wh).all(1))  # NaN, behind the camera, is neither
    column, row = np.clip(np.nan_to_num(pixels), 0, np.array(camera.wh) - 1).astype(np.intp).T
    shape = points.shape[:-1]
    return row.reshape(shape), column.reshape(shape), z.reshape(shape), inside.reshape(shape)
