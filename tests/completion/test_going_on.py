"""A scene is gone on from: removal after removal, views after a removal, decisions the same however one asks (oracles: laws)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from small_street import CAMERA, MASK, street
from test_halo import blurred

import dlama
from dlama.completion.verbs import remove
from dlama.errors import InputError
from dlama.geometry.camera import StereoRig
from dlama.geometry.codes import HoleType
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.view import View
from dlama.inpainters import find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter
from worlds import moved

ASIDE = orbit(CAMERA, 14)
FRAME = street(sensor_holes=False)


def recording() -> tuple[Inpainter, list[tuple[View, FillContext]]]:
    """A filler that notes what it is given."""
    telea, seen = find_filler("telea"), list[tuple[View, FillContext]]()

    def fill(view: View, context: FillContext, seed: int) -> Fill:
        seen.append((view, context))
        return telea(view, context, seed)

    return fill, seen


def test_a_hole_comes_from_no_frame() -> None:
    """Law: what is removed from a view has the frame 0, "none"."""
    view = dataclasses.replace(View.from_rgbd(FRAME), frame=np.full(CAMERA.hw, 2, np.uint16))
    cut = view.without(MASK, HoleType.OBJECT)
    assert cut.frame is not None
    np.testing.assert_array_equal(cut.frame, np.where(MASK, 0, 2))


def test_measured_colours_are_no_holes_where_depth_is_left_open() -> None:
    """Law: a sensor hole whose filled depth is less sure than asked for keeps its colour and lacks depth alone."""
    frame = street()
    done = dlama.view(frame, filler="telea")
    opened = done.with_min_confidence(0.99).view
    assert opened.hole.any() and frame.missing[opened.hole].all() and not opened.color_hole.any()
    np.testing.assert_array_equal(opened.color, frame.color)


def test_a_recipe_and_its_name_grow_masks_alike() -> None:
    """Law: by 3 px, in both ways of saying `dlama`; meta.json says so, and why."""
    rgbd, mask = blurred(4)
    for recipe in (dlama.Recipe("dlama"), "dlama"):
        meta = remove(rgbd, mask, filler="telea", recipe=recipe).meta
        assert meta["recipe"]["dilate"] == 3
        assert meta["decisions"]["mask_growth"]["px"] == 3
        assert meta["decisions"]["mask_growth"]["reason"].startswith("by the picture's longer side")
    explicit = remove(rgbd, mask, filler="telea", dilate=2).meta["decisions"]["mask_growth"]
    assert explicit == {"px": 2, "reason": "as given"}


def test_auto_takes_no_model_whatever_the_picture() -> None:
    """Message: a model goes with a filler's name; which one `auto` chooses depends on the picture. Everywhere the same."""
    estimated = dataclasses.replace(FRAME, estimate={"model": "any"})
    scene = dlama.scene([FRAME])
    rig = StereoRig(CAMERA, moved(CAMERA, shift=(0.1, 0, 0)))
    for run in (
        lambda: dlama.view(FRAME, yaw=5, model="any.onnx"),
        lambda: dlama.view(estimated, yaw=5, model="any.onnx"),
        lambda: dlama.render_path(scene, [ASIDE], model="any.onnx"),
        lambda: dlama.stereo(FRAME.color, FRAME.color, rig, model="any.onnx"),
    ):
        with pytest.raises(InputError, match=r"model is any.onnx and filler 'auto', which chooses by the depth"):
            run()


def test_a_path_is_filled_beside_the_edges_of_its_pictures() -> None:
    """Law: where depth lies beside its picture, each view of a path is filled under the law of placed edges, as by `complete`."""
    rgbd, _ = blurred(4)
    cameras = [orbit(rgbd.camera, yaw, 0.0, 2.5) for yaw in (-25.0, 0.0, 25.0)]
    filler, seen = recording()
    for _ in dlama.render_path(dlama.scene([rgbd]), [cameras[0], orbit(rgbd.camera, -12.0), cameras[2]], filler=filler):
        pass
    away = [context.law.misplaced_edges for view, context in seen if not view.camera.same_view_as(rgbd.camera)]
    assert len(away) >= 3 and all(away)
