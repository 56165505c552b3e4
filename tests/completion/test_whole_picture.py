"""A view from where the picture was taken is the picture: every pixel of it, by every filler."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_street import completed, recipes, street

from dlama.completion.recipes import RECIPES
from dlama.completion.verbs import target_camera, view
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.inpainters import FILLER_NAMES, FILLERS
from dlama.inpainters.filling import Fill
from tiny_networks import constant
from whole_picture import check_same

RUN_AS_THEY_ARE = [
    name for name in FILLER_NAMES if name not in FILLERS or FILLERS[name].shipped or not FILLERS[name].needs_model
]

FRAME = street()


def refuse(*_: object) -> Fill:
    """A filler for views in which nothing is to be filled."""
    raise AssertionError("a view without a hole was filled")


@st.composite
def frames(draw: st.DrawFn) -> RGBD:
    """Any picture: of any size from 1x1, any lens and pose, far pixels too, also as views into larger arrays."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    h, w = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    depth = np.exp(rng.uniform(np.log(1e-2), np.log(draw(st.sampled_from((2.0, 50.0, 9e4)))), (2 * h, w)))[::2]
    kind = rng.random((h, w))
    depth[kind < draw(st.sampled_from((0.0, 0.3, 1.0)))] = np.inf
    fx, fy, cx, cy = (float(rng.uniform(low, high)) for low, high in ((5, 90), (5, 90), (-w, 2 * w), (-h, 2 * h)))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = turn * np.sign(np.linalg.det(turn))
    pose[:3, 3] = rng.normal(0, draw(st.sampled_from((0.0, 1.0, 5e6))), 3)
    color = rng.integers(0, 256, (h, 2 * w, 3), np.uint8)[:, ::2]
    return RGBD(color, depth.astype(np.float32), Camera(w, h, fx, fy, cx, cy, pose))


@pytest.mark.filterwarnings("ignore:the median depth is")
@settings(max_examples=100, deadline=None)
@given(frames(), st.sampled_from((0.0, 360.0, -360.0)), st.sampled_from((0.0, 360.0)))
def test_any_picture_seen_from_its_own_camera_is_itself(frame: RGBD, yaw: float, pitch: float) -> None:
    """Law, after a whole turn too: nothing is filled, so that no filler can matter."""
    camera = target_camera(frame, yaw=yaw, pitch=pitch)
    np.testing.assert_array_equal(camera.world_from_cam, frame.camera.world_from_cam)
    check_same(view(frame, yaw=yaw, pitch=pitch, filler=refuse), frame)


@settings(deadline=None)
@given(st.integers(0, 179), st.integers(-89, 0))
def test_a_turn_the_other_way_round_is_the_same_camera(yaw: int, pitch: int) -> None:
    """Law, to the last bit."""
    one = target_camera(FRAME, yaw=float(yaw), pitch=float(pitch))
    np.testing.assert_array_equal(
        target_camera(FRAME, yaw=yaw - 360.0, pitch=pitch + 360.0).world_from_cam, one.world_from_cam
    )


@pytest.mark.parametrize("filler", FILLER_NAMES)
def test_no_filler_changes_a_whole_picture(filler: str, tmp_path: Path) -> None:
    """Law; the networks of fillers that ship none paint everything in one colour."""
    planes = {"lama": 3, "joint": 4}
    if filler == "pair":
        pytest.skip("a pair's filler fills two pictures: tests/completion/stereo")
    model = constant(tmp_path / "net.onnx", planes[filler], *[0.3] * planes[filler]) if filler in planes else None
    frame = street(sensor_holes=False)
    check_same(view(frame, filler=filler, model=model), frame)


@pytest.mark.parametrize("filler", RUN_AS_THEY_ARE)
@recipes
def test_every_filler_leaves_measured_pixels(filler: str, recipe: str) -> None:
    """Law: with depth missing in two places that depth alone is filled, and its colour stays."""
    check_same(completed(recipe, filler, removing=False, yaw=0.0), street(), RECIPES[recipe].clip or np.inf)
