"""Matched points of posed frames in; the poses that fit them best out: Gauss-Newton, robust, with the given poses as prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.camera import Camera, Float64Array


@dataclass(frozen=True, eq=False)
class Matches:
    """N points measured by one frame and matched in another; those of a pair of frames are contiguous."""

    one: np.ndarray
    """N, place of the frame that measured it."""
    other: np.ndarray
    """N, place of the frame that shows it."""
    points: Float64Array
    """N x 3, in the axes of `one`, metres."""
    pixels: Float64Array
    """N x 2, in `other`."""
    depth: Float64Array
    """N depths of `other` there, metres; 0 = none."""
    starts: np.ndarray
    """Where each pair begins."""

    @classmethod
    def concatenate(cls, parts: Sequence[Matches]) -> Matches:
        """Those of several pairs."""
        names = ("one", "other", "points", "pixels", "depth")
        starts = np.cumsum([0, *(len(part.one) for part in parts)])[:-1]
        one, other, points, pixels, depth = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        return cls(one, other, points, pixels, depth, starts)


def measure_offset(matches: Matches, cameras: Sequence[Camera]) -> float:
    """Median over pairs of the median offset in px between points and their matches."""
    lens = np.array([[camera.fx, camera.fy, camera.cx, camera.cy] for camera in cameras])
    poses = np.stack([camera.world_from_cam for camera in cameras])
    apart = np.linalg.norm(_reproject(matches, poses, lens)[2], axis=1)
    return float(np.median([np.median(part) for part in np.split(apart, matches.starts[1:])]))


def adjust_poses(matches: Matches, cameras: Sequence[Camera]) -> list[Float64Array]:
    """The poses (world_from_cam) that fit the matches best: Gauss-Newton with robust weights (Geman-McClure), which narrow."""
    lens = np.array([[camera.fx, camera.fy, camera.cx, camera.cy] for camera in cameras])
    given = np.stack([camera.world_from_cam for camera in cameras])
    poses, scale = given.copy(), 6.0  # px
    for _ in range(12):
        diagonal, blocks, right = _normal_equations(matches, poses, given, lens, scale)
        step = _solve(diagonal, blocks, matches.one[matches.starts], matches.other[matches.starts], -right)
        for pose, (turn, shift) in zip(poses, step.reshape(-1, 2, 3)):
            pose[:3, :3] = cv2.Rodrigues(turn)[0] @ pose[:3, :3]
            pose[:3, 3] += shift
        scale = max(1.0, 0.7 * scale)
    return list(poses)


def _reproject(
    matches: Matches, poses: Float64Array, lens: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """N x 3 points in the world and in the other frame's axes, and N x 2 reprojection errors in px."""
    one, other = poses[matches.one], poses[matches.other]
    world = np.einsum("nab,nb->na", one[:, :3, :3], matches.points) + one[:, :3, 3]
    local = np.einsum("nba,nb->na", other[:, :3, :3], world - other[:, :3, 3])
    its = lens[matches.other]
    return world, local, local[:, :2] / np.maximum(local[:, 2:], 1e-3) * its[:, :2] + its[:, 2:] - matches.pixels


def _normal_equations(
    matches: Matches, poses: Float64Array, given: Float64Array, lens: Float64Array, scale: float
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """The normal equations: K x 6 x 6 of each frame, P x 6 x 6 of each pair, and K x 6 gradients.

    A frame's unknowns: a rotation about its own centre, and a shift, both in the world's axes.
    """
    world, local, miss = _reproject(matches, poses, lens)
    z = np.maximum(local[:, 2], 1e-3)
    focal = lens[matches.other][:, :2]
    by_local = np.zeros((len(z), 3, 3))
    by_local[:, 0, 0], by_local[:, 1, 1] = focal[:, 0] / z, focal[:, 1] / z
    by_local[:, :2, 2] = -focal * local[:, :2] / z[:, None] ** 2
    spread = np.hypot(0.015, 0.006 * z**2)  # standard deviation of two depths' difference
    by_local[:, 2, 2] = 1 / spread
    error = np.concatenate([miss, ((z - matches.depth) / spread)[:, None]], 1)
    by_world = np.einsum("nab,ncb->nac", by_local, poses[matches.other][:, :3, :3])
    weight = _weights(matches, miss, error[:, 2], scale)
    mine = np.concatenate([-by_world @ _cross(world - poses[matches.one][:, :3, 3]), by_world], 2)
    others = -np.concatenate([-by_world @ _cross(world - poses[matches.other][:, :3, 3]), by_world], 2)
    diagonal, right = _prior(poses, given)
    one, other = matches.one[matches.starts], matches.other[matches.starts]
    for place, part in ((one, mine), (other, others)):
        np.add.at(diagonal, place, _sum_products(matches, part * weight[..., None], part))
        np.add.at(right, place, np.add.reduceat(np.einsum("nka,nk->na", part, weight * error), matches.starts))
    return diagonal, _sum_products(matches, mine * weight[..., None], others), right


def _weights(matches: Matches, miss: Float64Array, deep: Float64Array, scale: float) -> Float64Array:
    """N x 3 (x, y, depth) robust weights, normalised by the number of matches of a pair. deep: N, of the depths, in standard
    deviations; beyond four one does not count."""
    fits = 1 / (1 + (miss**2).sum(1) / scale**2) ** 2
    counts = np.diff([*matches.starts, len(miss)])
    fits = fits / np.sqrt(np.repeat(counts, counts))
    known = (matches.depth > 0) & (np.abs(deep) < 4.0)
    return np.stack([fits, fits, fits * known], 1)


def _prior(poses: Float64Array, given: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The prior of the given poses, known to half a degree and 2 cm: K x 6 x 6, and K x 6 gradients."""
    precision = np.array([*[1 / np.radians(0.5) ** 2] * 3, *[1 / 0.02**2] * 3])
    turns = np.stack([cv2.Rodrigues(pose[:3, :3] @ old[:3, :3].T)[0].ravel() for pose, old in zip(poses, given)])
    off = np.concatenate([turns, poses[:, :3, 3] - given[:, :3, 3]], 1)
    return np.broadcast_to(np.diag(precision), (len(poses), 6, 6)).copy(), precision * off


def _sum_products(matches: Matches, left: Float64Array, right: Float64Array) -> Float64Array:
    """P x 6 x 6, of each pair the sum of products of N x 3 x 6."""
    return np.asarray(np.add.reduceat(np.einsum("nka,nkb->nab", left, right), matches.starts))


def _cross(vectors: Float64Array) -> Float64Array:
    """N x 3 x 3, the matrices of cross products with N x 3 vectors."""
    x, y, z = vectors.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], 1).reshape(-1, 3, 3)


def _solve(
    diagonal: Float64Array, blocks: Float64Array, one: np.ndarray, other: np.ndarray, right: Float64Array
) -> Float64Array:
    """K x 6: conjugate gradients, preconditioned by each frame's own block; its cost grows with the number of pairs."""
    inverse = np.linalg.inv(diagonal)
    x = np.zeros_like(right)
    residual = right.copy()
    along = ready = np.einsum("nab,nb->na", inverse, residual)
    size = float((residual * ready).sum())
    first = size
    for _ in range(60):
        if size <= 1e-5**2 * first:
            break
        image = np.einsum("nab,nb->na", diagonal, along)
        np.add.at(image, one, np.einsum("nab,nb->na", blocks, along[other]))
        np.add.at(image, other, np.einsum("nba,nb->na", blocks, along[one]))
        length = size / float((along * image).sum())
        x, residual = x + length * along, residual - length * image
        ready = np.einsum("nab,nb->na", inverse, residual)
        size, last = float((residual * ready).sum()), size
        along = ready + size / last * along
    return x
