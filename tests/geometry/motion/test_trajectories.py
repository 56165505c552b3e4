"""Orbit, dolly and pivot: closed forms, laws, and poses rendered by somebody else's code (Blender, street set)."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.errors import DepthError, InputError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import dolly, median_pivot, orbit
from dlama.geometry.projection import project
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

ANYWHERE = Camera.from_fov(64, 48, 70, [[0, 0, 1, 3], [1, 0, 0, -2], [0, 1, 0, 5], [0, 0, 0, 1]])


def test_orbit_agrees_with_the_street_renderings() -> None:
    """Oracle: somebody else's code; the 13 poses that Blender rendered scene s03 from."""
    if "DLAMA_DATA" not in os.environ:
        pytest.skip("DLAMA_DATA is not set; it must name the folder that holds street/")
    reported = json.loads((Path(os.environ["DLAMA_DATA"]) / "street/s03/poses.json").read_text())
    frames = reported["sequences"]["with"]["frames"]
    source = Camera.from_fov(512, 512, 90, frames[0]["world_from_cam"])
    assert len(frames) == 13
    for frame in frames:
        turned = orbit(source, frame["yaw_deg"])
        np.testing.assert_allclose(turned.world_from_cam, frame["world_from_cam"], rtol=0, atol=1e-5)


def test_signs_of_yaw_and_pitch() -> None:
    """Closed form at the identity pose: yaw > 0 goes right (+x) and looks left; pitch > 0 goes up (-y), looks down."""
    camera = Camera.from_fov(64, 48, 70)
    right = orbit(camera, 90, pivot=2).world_from_cam
    np.testing.assert_allclose(right[:3, 3], [2, 0, 2], atol=1e-12)
    np.testing.assert_allclose(right[:3, 2], [-1, 0, 0], atol=1e-12)
    above = orbit(camera, 0, 90, pivot=2).world_from_cam
    np.testing.assert_allclose(above[:3, 3], [0, -2, 2], atol=1e-12)
    np.testing.assert_allclose(above[:3, 2], [0, 1, 0], atol=1e-12)


def test_pitch_is_about_the_turned_cameras_own_x_axis() -> None:
    """Law: yaw then pitch is a pitch orbit of the yawed camera, and keeps its horizon level."""
    both = orbit(ANYWHERE, 30, 20)
    np.testing.assert_allclose(
        both.world_from_cam, orbit(orbit(ANYWHERE, 30), 0, 20).world_from_cam, rtol=0, atol=1e-12
    )
    down_of_source = ANYWHERE.world_from_cam[:3, 1]
    assert abs(both.world_from_cam[:3, 0] @ down_of_source) < 1e-12


angles = st.floats(-180, 180)


@settings(max_examples=60, deadline=None)
@given(angles, angles, st.floats(0, 100))
def test_orbit_keeps_lens_distance_and_aim(yaw: float, pitch: float, pivot_m: float) -> None:
    """Law: the pivot stays on the principal point at the same depth, and the lens stays the same."""
    turned = orbit(ANYWHERE, yaw, pitch, pivot_m)
    assert turned.same_lens_as(ANYWHERE)
    pivot = ANYWHERE.world_from_cam @ [0, 0, pivot_m, 1]
    pixels, z = project(pivot[None, :3], turned)
    np.testing.assert_allclose(z, pivot_m, rtol=0, atol=1e-12)
    if pivot_m > 1e-3:
        np.testing.assert_allclose(pixels, [[turned.cx, turned.cy]], rtol=0, atol=1e-8)


def test_no_orbit_and_no_dolly_leave_the_pose_bit_exact() -> None:
    """Law: zero is zero, so that a view from the source camera is recognised as such."""
    np.testing.assert_array_equal(orbit(ANYWHERE, 0).world_from_cam, ANYWHERE.world_from_cam)
    np.testing.assert_array_equal(dolly(ANYWHERE, 0).world_from_cam, ANYWHERE.world_from_cam)


def test_dolly_moves_along_the_optical_axis() -> None:
    """Closed form: going 0.5 m back makes a point ahead 0.5 m deeper and leaves it on the axis."""
    back = dolly(ANYWHERE, -0.5)
    ahead = ANYWHERE.world_from_cam @ [0, 0, 2, 1]
    pixels, z = project(ahead[None, :3], back)
    np.testing.assert_allclose(z, 2.5)
    np.testing.assert_allclose(pixels, [[back.cx, back.cy]])


def test_median_pivot_counts_valid_depth_only() -> None:
    """Closed form: the median of 1, 2 and 9 is 2, whatever is missing or far."""
    assert median_pivot(np.array([[0, np.inf, np.inf], [1, 2, 9], [0, 0, np.nan]], np.float32)) == 2


@pytest.mark.parametrize("depth", [np.zeros((2, 2)), np.full((2, 2), np.inf)])
def test_median_pivot_without_valid_depth_is_refused(depth: np.ndarray) -> None:
    """Oracle: the error of the tree."""
    with pytest.raises(DepthError, match="no valid value"):
        median_pivot(depth)


def test_a_picture_turns_about_its_median_depth() -> None:
    """Closed form; of a view as of its picture; about 2.5 m where nothing is near, and where there is a camera alone."""
    camera = Camera.from_fov(8, 6, 60)
    depth = np.full(camera.hw, 4, np.float32)
    depth[0], depth[1, :3] = np.inf, 0
    color = np.zeros((*camera.hw, 3), np.uint8)
    picture, sky = (RGBD(color, each, camera) for each in (depth, np.full_like(depth, np.inf)))
    for source, pivot in ((picture, 4.0), (View.from_rgbd(picture), 4.0), (sky, 2.5), (camera, 2.5)):
        np.testing.assert_array_equal(orbit(source, 20, 5).world_from_cam, orbit(camera, 20, 5, pivot).world_from_cam)
    np.testing.assert_array_equal(
        orbit(picture, 20, pivot=1.5).world_from_cam, orbit(camera, 20, pivot=1.5).world_from_cam
    )


def test_wishes_that_are_no_numbers_are_refused() -> None:
    """Oracle: the message names the field and what came."""
    with pytest.raises(InputError, match=r"yaw is nan"):
        orbit(ANYWHERE, np.nan)
    with pytest.raises(InputError, match=r"pitch is inf"):
        orbit(ANYWHERE, 0, np.inf)
    with pytest.raises(InputError, match=r"yaw is 700; an angle of -360 to 360 degrees"):
        orbit(ANYWHERE, 700)
    with pytest.raises(InputError, match=r"pivot is -1"):
        orbit(ANYWHERE, 10, pivot=-1)
    with pytest.raises(InputError, match=r"dolly is nan"):
        dolly(ANYWHERE, np.nan)
