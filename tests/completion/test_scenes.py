"""Views of a closed-form scene: what was measured stays, settings do what they say, odd input does not crash."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from small_street import CAMERA, MASK, completed, fillers, recipes, street

from dlama.completion.pipeline import complete
from dlama.completion.verbs import remove, target_camera, view
from dlama.errors import InputError, MaskError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.holes import dilate_mask
from dlama.geometry.kernels import jit
from dlama.geometry.motion.trajectories import dolly, orbit
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, violations
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill
from reference import law as twin
from whole_picture import assert_same_view
from worlds import moved


@fillers
@recipes
@pytest.mark.parametrize(("removing", "yaw"), [(True, 0.0), (False, 14.0), (True, -14.0)])
def test_outside_the_hole_nothing_changes_and_inside_the_law_holds(
    recipe: str, filler: str, removing: bool, yaw: float
) -> None:
    """Law: pixels outside the hole of the warped view are the completed view's, bit for bit; inside all are filled, typed, and
    less sure than measured. The visibility law holds, by the checker and by its twin, over all filled pixels, those filled in the
    source view and adopted from there included (surfaces are drawn between lawful pixel centres, so they need not be lawful of
    themselves); the meta says so too."""
    done = completed(recipe, filler, removing, yaw)
    before, after = done.warped[0], done.view
    known = ~before.hole
    for name in ("color", "depth", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(after, name)[known], getattr(before, name)[known], err_msg=name)
    np.testing.assert_array_equal(after.hole_type, before.hole_type)
    assert before.hole.any() and not after.hole.any() and (after.depth > 0).all()
    assert np.isin(after.origin[before.hole], (Origin.FILLED, Origin.DEPTH_FILLED)).all()
    assert (after.confidence[before.hole] < 1).all()
    law = Law.of(Scene((done.source,)))
    assert done.meta["law_violations"] == 0 and not violations(after, law).any()
    wrong, unsure = twin.broken(after.camera, after.depth, after.filled, CAMERA, law.measured[0][1])
    assert not (wrong & ~unsure).any()


@fillers
@recipes
def test_the_same_seed_gives_the_same_bits(recipe: str, filler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: a removal seen from aside, again with one thread, bit for bit; meta data too but for the clock."""
    first = completed(recipe, filler, True, -14.0)
    monkeypatch.setattr(jit, "_most_threads", [1])
    again = remove(street(), MASK, yaw=-14.0, filler=filler, recipe=recipe)
    assert_same_view(again.view, first.view)
    assert {**again.meta, "seconds": 0} == {**first.meta, "seconds": 0}


@fillers
@recipes
def test_meta_is_json_and_adds_up(recipe: str, filler: str) -> None:
    """Round trip through JSON without NaN; shares by type add up to what lacks colour and what lacks depth only; names and
    stages are there."""
    done = completed(recipe, filler, True, -14.0)
    meta = json.loads(json.dumps(done.meta, allow_nan=False))
    assert meta == done.meta
    assert meta["recipe"]["name"] == recipe and meta["filler"] == filler and meta["seed"] == 0
    unknown = meta["hole_share"][0] + meta["depth_only_share"][0]
    assert sum(meta["hole_share_by_type"][0].values()) == pytest.approx(unknown, abs=1e-5)
    assert unknown == pytest.approx((done.warped[0].hole_type > 0).mean(), abs=1e-5)
    assert meta["filled_pixels"] >= done.warped[0].hole.mean() and meta["law_violations"] == 0
    assert set(meta["seconds"]) == {"prepare", "render", "fill", "fuse"} and min(meta["seconds"].values()) >= 0
    assert meta["nothing_visible"] is False


def test_a_pixel_that_lacks_depth_only_is_not_unknown() -> None:
    """Closed form: at the source's own camera the sensor holes keep their colour, so nothing is unknown and their share stands
    apart; with an object out, exactly the grown mask lacks colour."""
    frame = street()
    own = completed("dlama", "telea", False, 0.0)
    assert own.meta["hole_share"] == [0.0]
    assert own.meta["depth_only_share"] == [pytest.approx(frame.missing.mean(), abs=1e-6)]
    removed, taken = completed("dlama", "telea", True, 0.0), dilate_mask(MASK, 3)
    assert removed.meta["hole_share"] == [pytest.approx(taken.mean(), abs=1e-6)]
    assert removed.meta["depth_only_share"] == [pytest.approx((frame.missing & ~taken).mean(), abs=1e-6)]


def test_flying_pixels_are_counted_only_when_the_camera_moves() -> None:
    """Closed form: one row of mixed depths between two walls; 12 of them, none at the source's own camera."""
    depth = np.full((12, 16), 2, np.float32)
    depth[:, 8:], depth[:, 8] = 4, 2.8
    frame = RGBD(np.zeros((12, 16, 3), np.uint8), depth, Camera.from_fov(16, 12, 60))
    assert view(frame, yaw=5, filler="telea").meta["flying_pixels_rejected"] == 12
    assert view(frame, filler="telea").meta["flying_pixels_rejected"] == 0


@recipes
def test_a_target_that_sees_nothing_says_so(recipe: str) -> None:
    """Law: no crash; the view stays a hole, the meta says nothing_visible, the cloud is what was measured."""
    away = moved(CAMERA, (0, 180, 0), (0, 0, -1))
    frame = street(sensor_holes=False)
    with pytest.warns(UserWarning, match=r"visible from the camera, .*`world_from_cam` .* x right, y down") as seen:
        done = view(frame, away, recipe=recipe, filler="telea")
    assert [Path(one.filename).name for one in seen] == [Path(__file__).name]  # not a line within dlama
    assert done.meta["nothing_visible"] is True and done.meta["filled_pixels"] == 0
    assert done.view.hole.all() and (done.view.hole_type == HoleType.OUT_OF_VIEW).all()
    assert len(done.scene.layers) == 1 and len(done.completed) == done.source.valid.sum()
    json.dumps(done.meta, allow_nan=False)
    with pytest.warns(UserWarning, match="nothing of the scene is visible from the camera 1 of 2"):
        both = complete(frame, [away, orbit(CAMERA, 10)], recipe=recipe, filler="telea")
    assert both.views[0].hole.all() and not both.views[1].hole.any()


@pytest.mark.parametrize("yaw", [0, 5])
def test_a_removal_that_leaves_no_depth_says_so(yaw: float) -> None:
    """Closed form: a depth camera reached the object alone; the warning names that, not the camera's place."""
    mask = np.zeros((12, 16), bool)
    mask[4:8, 5:10] = True
    frame = RGBD(np.full((12, 16, 3), 99, np.uint8), np.where(mask, np.float32(2), 0), Camera.from_fov(16, 12, 60))
    with pytest.warns(UserWarning, match="no pixel next to the removed object has a depth, so nothing could be filled"):
        done = remove(frame, mask, yaw=yaw, filler="telea")
    assert done.view.hole.all() and done.meta["nothing_visible"] is True


@fillers
@recipes
@pytest.mark.parametrize("metres", [0, np.inf])
@pytest.mark.filterwarnings("ignore:no pixel has a depth")
def test_pictures_of_nothing_and_of_sky_only(recipe: str, filler: str, metres: float) -> None:
    """Law: without any depth nothing is visible; with nothing but sky (10 m to the paper) the rest is filled."""
    frame = RGBD(np.full((12, 16, 3), 99, np.uint8), np.full((12, 16), metres, np.float32), Camera.from_fov(16, 12, 60))
    done = view(frame, yaw=20, filler=filler, recipe=recipe)
    assert done.meta["nothing_visible"] is (metres == 0)
    assert done.view.hole.all() == (metres == 0)
    if metres:
        assert done.view.far.all() if recipe == "dlama" else (done.view.depth < 30).all()


@fillers
@recipes
@pytest.mark.parametrize("wh", [(1, 1), (1, 9), (9, 1), (2, 1)])
def test_pictures_one_pixel_wide_or_high(recipe: str, filler: str, wh: tuple[int, int]) -> None:
    """Law: a step back and aside leaves no hole; the object of one pixel goes where there is another to fill from."""
    color = np.random.default_rng(0).integers(0, 256, (wh[1], wh[0], 3), np.uint8)
    frame = RGBD(color, np.full((wh[1], wh[0]), 2, np.float32), Camera(*wh, 9, 9, wh[0] / 2, wh[1] / 2))
    for target in (frame.camera, moved(frame.camera, shift=(0, 0, -0.5))):
        done = view(frame, target, filler=filler, recipe=recipe)
        assert not done.view.hole.any()
    np.testing.assert_array_equal(view(frame, filler=filler, recipe=recipe).view.color, color)
    mask = np.zeros((wh[1], wh[0]), bool)
    mask.flat[0] = True
    if wh == (1, 1):
        with pytest.raises(MaskError, match="full"):
            remove(frame, mask, filler=filler, recipe=recipe, dilate=0)
        return
    done = remove(frame, mask, filler=filler, recipe=recipe, dilate=0)
    np.testing.assert_array_equal(done.view.filled, mask)
    assert done.view.depth.flat[0] >= 2 * (1 - 1.1e-3)


def test_settings_change_what_they_say() -> None:
    """Closed form: dilate_holes grows the warped hole by so many px, dilate the mask, clip cuts, mode draws points."""
    plain = completed("dlama", "telea", False, 14.0).warped[0]
    wider = view(street(), yaw=14.0, filler="telea", dilate_holes=2)
    np.testing.assert_array_equal(wider.warped[0].hole, dilate_mask(plain.hole, 2))
    assert not wider.warped[0].depth[wider.warped[0].hole].any()
    exact = remove(street(), MASK, filler="telea", dilate=0)
    np.testing.assert_array_equal(exact.view.filled, MASK)
    assert view(street(sensor_holes=False), filler="telea", clip=4.0).view.depth.max() == 4
    by_points = view(street(), yaw=14.0, filler="telea", mode="points")
    assert (by_points.warped[0].hole_type == HoleType.CRACK).any() and not (plain.hole_type == HoleType.CRACK).any()
    assert by_points.meta["recipe"]["mode"] == "points"


def test_a_filler_of_ones_own() -> None:
    """Law: any callable (view, context, seed) -> Fill; it gets the seed, its notes are in the meta, and its name."""
    seeds = []

    def seven(view: View, context: FillContext, seed: int) -> Fill:
        seeds.append(seed)
        return Fill(np.full_like(view.color, 7), np.full_like(view.depth, 50), notes={"sevens": 7})

    done = view(street(sensor_holes=False), yaw=14.0, filler=seven, seed=11)
    assert seeds == [11] and done.meta["filler"] == "seven" and done.meta["notes"] == {"sevens": 7}
    assert (done.view.color[done.view.filled] == 7).all()


def test_target_cameras() -> None:
    """Closed form: orbit about the pivot, then dolly; `auto` is the median depth; a camera and an orbit contradict."""
    frame = street()
    camera = target_camera(frame, yaw=10, pitch=-5, pivot=2.5, dolly=0.3)
    assert camera.same_view_as(dolly(orbit(CAMERA, 10, -5, 2.5), 0.3))
    median = float(np.median(frame.depth[frame.valid]))
    assert target_camera(frame, yaw=10).same_view_as(orbit(CAMERA, 10, 0, median))
    assert target_camera(frame).same_view_as(CAMERA)
    assert target_camera(frame, camera) is camera
    for given in ({"yaw": 1.0}, {"pitch": 1.0}, {"dolly": 0.1}):
        with pytest.raises(InputError, match="both given"):
            target_camera(frame, camera, **given)
    nothing = RGBD(frame.color, np.zeros_like(frame.depth), CAMERA)
    assert target_camera(nothing, yaw=10).same_view_as(
        orbit(CAMERA, 10, 0, 2.5)
    )  # where nothing is near, any pivot will do


def test_pil_pictures_and_tensors_are_arrays() -> None:
    """Law: what has `__array__` gives the same bits as the array that it gives; what gives none is named."""

    class Tensor:
        """As torch's: not an array, and gives one."""

        def __init__(self, values: np.ndarray) -> None:
            self.values = values

        def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
            if self.values.dtype == np.float64:
                raise RuntimeError("of a graphics card")
            return self.values if dtype is None else self.values.astype(dtype)

    frame = street(sensor_holes=False)
    plain = remove(frame, MASK, filler="telea").view
    for make, mask in ((Image.fromarray, Image.fromarray(MASK)), (Tensor, Tensor(MASK)), (Tensor, {0: Tensor(MASK)})):
        rgbd = RGBD(make(frame.color), Tensor(frame.depth), CAMERA)  # type: ignore[arg-type]
        found = remove(rgbd, mask, filler="telea").view  # type: ignore[arg-type]
        np.testing.assert_array_equal(found.color, plain.color)
        np.testing.assert_array_equal(found.depth, plain.depth)
    with pytest.raises(
        TypeError, match=r"depth is of type Tensor \(of a graphics card\); an array of metres is expected"
    ):
        RGBD(frame.color, Tensor(np.ones(CAMERA.hw)), CAMERA)  # type: ignore[arg-type]
