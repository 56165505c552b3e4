"""Rotations (oracle: closed forms; quaternions and matrices there and back)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.motion.poses import quaternion_from_rotation, rotation_deg, rotation_from_quaternion, slerp


def about(axis: list[float], degrees: float) -> np.ndarray:
    """A quaternion x, y, z, w: sin(half) times the axis, cos(half)."""
    half = np.radians(degrees) / 2
    return np.array([*(np.sin(half) * np.array(axis) / np.linalg.norm(axis)), np.cos(half)])


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 10.0, 90.0, 179.999999, 180.0])
def test_angles_are_exact_at_both_ends(degrees: float) -> None:
    """The angle of a turn about any axis, where arccos alone would be off by 1e-6 degrees."""
    axes = ([1.0, 0, 0], [0, 1.0, 0], [0.3, -0.8, 0.52])
    start = rotation_from_quaternion(about([0.2, 0.5, -0.4], 37))
    turned = np.stack([start @ rotation_from_quaternion(about(axis, degrees)) for axis in axes])
    np.testing.assert_allclose(rotation_deg(turned, start), degrees, atol=1e-9)


@pytest.mark.parametrize("degrees", [0.0, 33.0, 180.0, 200.0])
def test_quaternions_there_and_back(degrees: float) -> None:
    """Each alone, and all at once: about the axes, and about random ones."""
    axes = [*np.eye(3), *np.random.default_rng(0).normal(size=(20, 3))]
    rotations = np.array([rotation_from_quaternion(about(axis, degrees)) for axis in axes])
    for rotation, quaternion in zip(rotations, quaternion_from_rotation(rotations)):
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
        assert quaternion[3] >= 0 and np.linalg.norm(quaternion) == pytest.approx(1)
        np.testing.assert_allclose(quaternion_from_rotation(rotation), quaternion, atol=1e-15)
        np.testing.assert_allclose(rotation_from_quaternion(quaternion), rotation, atol=1e-12)
        np.testing.assert_allclose(rotation_from_quaternion(3 * quaternion), rotation, atol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 1e-7, 20.0, 179.0, -120.0])
def test_between_two_rotations(degrees: float) -> None:
    """Closed form: a share of the turn about one axis is a turn by that share of its angle; its ends are the two."""
    start, axis = rotation_from_quaternion(about([0.2, 0.5, -0.4], 37)), [0.3, -0.8, 0.52]
    end = start @ rotation_from_quaternion(about(axis, degrees))
    for share in (0.0, 0.25, 0.7, 1.0):
        expected = start @ rotation_from_quaternion(about(axis, share * degrees))
        np.testing.assert_allclose(slerp(start, end, share), expected, atol=1e-12)


def test_a_quarter_turn() -> None:
    """Closed form: about z it is (0, 0, sin 45, cos 45)."""
    found = quaternion_from_rotation(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    np.testing.assert_allclose(found, (0, 0, 0.5**0.5, 0.5**0.5), atol=1e-12)
