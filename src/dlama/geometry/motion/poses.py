"""Poses, and rotations as quaternions or matrices, in; the same checked, turned into each other and inverted, out. No files."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlama.errors import CameraError

Float64Array = NDArray[np.float64]

FARTHEST_M = 1e9
"""Metres: no camera stands farther from the world's origin (geo-referenced ones up to 1e7)."""
QUATERNION_TOLERANCE = 1e-3
"""By how much the length of a quaternion in a file may differ from 1 (six digits are written)."""


def rotation_from_quaternion(quaternion_xyzw: ArrayLike) -> Float64Array:
    """3x3 rotation of a quaternion x, y, z, w of any length > 0: R = I + 2 w [v]x + 2 [v]x [v]x."""
    q = np.asarray(quaternion_xyzw, np.float64)
    x, y, z, w = q / np.linalg.norm(q)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def quaternion_from_rotation(rotation: Float64Array) -> Float64Array:
    """Unit quaternions x, y, z, w (... x 4) of rotations (... x 3 x 3), w >= 0.

    Of the row of 4 q q^T with the largest diagonal (Shepperd 1978): good at every angle.
    """
    (a, d, e), (f, b, g), (h, i, c) = np.moveaxis(rotation, (-2, -1), (0, 1))
    products = np.array([
        [1 + a - b - c, f + d, h + e, i - g],
        [f + d, 1 + b - c - a, i + g, e - h],
        [h + e, i + g, 1 + c - a - b, f - d],
        [i - g, e - h, f - d, 1 + a + b + c],
    ])  # fmt: skip
    largest = np.argmax([a, b, c, a + b + c], axis=0)
    found = np.moveaxis(np.take_along_axis(products, largest[None, None], 0)[0], 0, -1)
    return np.asarray(found / np.copysign(np.linalg.norm(found, axis=-1), found[..., 3])[..., None])


def slerp(start: Float64Array, end: Float64Array, share: float) -> Float64Array:
    """The 3x3 rotation that lies between two, at a constant angular speed, the short way round (Shoemake 1985)."""
    one, other = quaternion_from_rotation(start), quaternion_from_rotation(end)
    cosine = float(one @ other)
    if cosine < 0:  # the same rotation, the short way round
        other, cosine = -other, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if share == 0 or angle < 1e-9:
        return start
    return rotation_from_quaternion((np.sin((1 - share) * angle) * one + np.sin(share * angle) * other) / np.sin(angle))


def rotation_deg(rotations: Float64Array, other: Float64Array) -> Float64Array:
    """Degrees (N), 0..180, between each of N x 3 x 3 rotations and one 3x3 rotation.

    By sine and cosine: exact near 0 and 180 degrees as well, where the cosine alone is not.
    """
    turns = other.T @ rotations
    sine = np.linalg.norm(turns - turns.transpose(0, 2, 1), axis=(1, 2)) / np.sqrt(8)
    return np.degrees(np.arctan2(sine, (np.trace(turns, axis1=1, axis2=2) - 1) / 2))


def as_matrix(values: ArrayLike, called: str, shape: tuple[int, int]) -> Float64Array:
    """A float64 copy. CameraError, which calls it `called`: no numbers, or of another shape."""
    expected = f"a {shape[0]}x{shape[1]} matrix is expected"
    try:
        matrix = np.array(np.asarray(values), np.float64)  # asarray: a tensor is asked once, without a copy
    except (TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise CameraError(f"{called} is of type {type(values).__name__} and holds no numbers; {expected}") from error
    if matrix.shape != shape:
        raise CameraError(f"{called} has shape {matrix.shape}; {expected}")
    return matrix


def make_pose(rotation: ArrayLike, translation: ArrayLike) -> Float64Array:
    """The 4x4 rigid motion of a 3x3 rotation and a translation (3, metres), neither of them checked."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = translation
    return pose


def invert_pose(b_from_a: Float64Array) -> Float64Array:
    """Inverse of a 4x4 rigid motion: R^T and -R^T t, so that there and back is exact to rounding."""
    turn = b_from_a[:3, :3].T
    return make_pose(turn, -turn @ b_from_a[:3, 3])


def transform_points(b_from_a: Float64Array, points: NDArray[Any]) -> Float64Array:
    """Points (... x 3) of the axes a in the axes b, by a 4x4 rigid motion."""
    return np.asarray(points @ b_from_a[:3, :3].T + b_from_a[:3, 3], np.float64)


def check_pose(pose: ArrayLike) -> Float64Array:
    """A read-only float64 copy of a 4x4 rigid motion; raises CameraError when it is none.

    The rotation is replaced by the nearest exact one, so that published poses rounded to a few digits compose cleanly.
    """
    matrix = as_matrix(pose, "world_from_cam", (4, 4))
    if not np.isfinite(matrix).all():
        raise CameraError("world_from_cam holds NaN or infinity; a finite rigid motion is expected")
    if np.abs(matrix[:3, 3]).max() > FARTHEST_M * (1 + 1e-9):  # a product of poses is rounded
        raise CameraError(
            f"world_from_cam moves by {np.abs(matrix[:3, 3]).max():g} m; at most {FARTHEST_M:g} m is expected"
        )
    if not np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-9):
        raise CameraError(f"world_from_cam ends with the row {matrix[3].tolist()}; 0 0 0 1 is expected")
    rotation = matrix[:3, :3]
    error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())  # 7-Scenes' published poses reach 4e-4
    if error > 1e-3 or np.linalg.det(rotation) < 0:
        kind = "a mirroring" if np.linalg.det(rotation) < 0 else f"off by {error:.3g} from orthonormal"
        raise CameraError(f"world_from_cam is not a rigid motion: its 3x3 part is {kind}; a rotation is expected")
    if error > 1e-12:
        u, _, vt = np.linalg.svd(rotation)
        matrix[:3, :3] = u @ vt
    matrix.flags.writeable = False
    return matrix
