"""Rotations as quaternions or matrices in; matrices, quaternions and angles out. Numbers only, no files."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dlama.geometry.camera import Float64Array

QUATERNION_TOLERANCE = 1e-3
"""By how much the length of a quaternion in a file may differ from 1 (six digits are written)."""


def rotation_from_quaternion(quaternion_xyzw: ArrayLike) -> Float64Array:
    """3x3 rotation of a quaternion x, y, z, w of any length > 0: R = I + 2 w [v]x + 2 [v]x [v]x."""
    q = np.asarray(quaternion_xyzw, np.float64)
    x, y, z, w = q / np.linalg.norm(q)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def quaternion_from_rotation(rotation: Float64Array) -> Float64Array:
    """Unit quaternion x, y, z, w of a 3x3 rotation, w >= 0.

    The eigenvector for the largest eigenvalue of a symmetric 4x4 matrix (Bar-Itzhack 2000): good at every angle.
    """
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], 0],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    quaternion = np.linalg.eigh(k)[1][:, -1]  # eigh reads the lower triangle
    return quaternion if quaternion[3] >= 0 else -quaternion


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
