"""How far a mask grows, and what fillers know of depth edges: a closed-form world whose depth is shifted against its picture, and
whose picture is blurred."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

import dlama
from dlama.completion.verbs import remove
from dlama.geometry.camera import Camera
from dlama.geometry.frames.removal import mask_growth
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill
from dlama.inpainters.opencv import telea
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(240, 180, 70)
SHOWN = World((Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1)), Box((-0.5, 0.0, 2.2), (0.5, 0.8, 2.8))))
GREY, BLUE = (240, 240, 240), (30, 40, 120)


def blurred(shift: int) -> tuple[RGBD, BoolArray]:
    """Blue before grey with a soft outline, its depth moved by some rows and columns, and the true pixels of what is blue."""
    depth, shown = SHOWN.trace(CAMERA)
    color = np.array([GREY, GREY, BLUE], np.uint8)[shown]
    soft = cv2.GaussianBlur(color, (0, 0), 2.0)
    return RGBD(soft, np.roll(depth, (shift, shift), (0, 1)).astype(np.float32), CAMERA), shown == 2


@pytest.mark.parametrize("recipe", ["dlama", dlama.Recipe("dlama")])
@pytest.mark.parametrize(("dilate", "grown", "reason"), [(None, 3, "by the picture's longer side"), (6, 6, "as given")])
def test_a_mask_grows_by_three_pixels_or_as_asked(
    recipe: str | dlama.Recipe, dilate: int | None, grown: int, reason: str
) -> None:
    """meta.json says by how many, and why; nothing of a soft outline of that width is kept (the picture without the object is
    grey)."""
    rgbd, mask = blurred(4)
    done = remove(rgbd, mask, filler="telea", dilate=dilate, recipe=recipe)
    growth = done.meta["decisions"]["mask_growth"]
    assert done.meta["recipe"]["dilate"] == growth["px"] == grown and growth["reason"].startswith(reason)
    kept = np.abs(done.view.color.astype(int) - GREY[0])[~done.view.filled].max()
    assert (kept <= 1) == (grown == 6)


def test_masks_of_many_frames_grow_alike() -> None:
    """Two frames, one of them masked: as from one frame, and in the frame it is carried to."""
    rgbd, mask = blurred(4)
    next_to = dataclasses.replace(rgbd.camera, world_from_cam=rgbd.camera.world_from_cam + 0.01 * np.eye(4, k=3))
    frames = [rgbd, RGBD(rgbd.color, rgbd.depth, next_to)]
    done = dlama.complete(frames, [CAMERA], mask={0: mask}, filler="telea")
    assert done.meta["recipe"]["dilate"] == mask_growth(dlama.scene(frames)).px == 3


def test_masks_of_large_pictures_grow_in_proportion() -> None:
    """Closed form: a soft outline of 3 px at 1024 px is one of 12 px at 4096."""
    camera = Camera.from_fov(4096, 64, 60)
    large = RGBD(np.zeros((64, 4096, 3), np.uint8), np.ones((64, 4096), np.float32), camera)
    assert mask_growth(dlama.scene([large])).px == 12


def test_a_path_is_filled_next_to_the_edges_of_its_pictures() -> None:
    """Law: where depth lies next to its picture, views of a path are filled under the law of placed edges, as by `complete`."""
    rgbd, _ = blurred(4)
    cameras = [orbit(rgbd.camera, yaw, 0.0, 2.5) for yaw in (-25.0, 0.0, 25.0)]
    misplaced: list[bool] = []

    def filler(view: View, context: FillContext, seed: int) -> Fill:
        if not view.camera.same_view_as(rgbd.camera):
            misplaced.append(context.law.misplaced_edges)
        return telea(view, context, seed)

    for _ in dlama.render_path(dlama.scene([rgbd]), [cameras[0], orbit(rgbd.camera, -12.0), cameras[2]], filler=filler):
        pass
    assert len(misplaced) >= 3 and all(misplaced)
