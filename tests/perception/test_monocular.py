"""Depth of a single picture (oracles: the exact depth itself, fed through an estimator that knows it; closed forms; laws)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlama
from box_frame import CAMERA, WORLD
from dlama.errors import DepthError, FileError, InputError, ShapeError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.drawing import grid_mesh
from dlama.geometry.rgbd import RGBD, UInt8Array
from dlama.models.records import CATALOGUE
from dlama.perception.depth_networks import DepthPrediction
from dlama.perception.monocular import (
    DEFAULT,
    ESTIMATORS,
    SHIPPED,
    Estimator,
    describe_bars,
    estimate_depth,
    find_estimator,
)

RGBD_OF_WORLD = WORLD.rgbd(CAMERA)


def knowing(rgbd: RGBD, gives: str = "depth", metric: bool = True) -> Estimator:
    """An estimator that knows the answer."""

    def fake(color: UInt8Array) -> DepthPrediction:
        assert color is not None
        values = rgbd.depth if gives == "depth" else (1 / rgbd.depth).astype(np.float32)
        return DepthPrediction(values, gives, metric)  # type: ignore[arg-type]

    return fake


def quiet(color: UInt8Array, camera: Camera | None = CAMERA, **options: Any) -> dlama.DepthEstimate:
    """estimate_depth, whatever it warns of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return estimate_depth(color, camera, **options)


@pytest.fixture
def no_halo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Estimated depth is drawn as measured depth is, halos behind its edges as well."""
    monkeypatch.setattr(grid_mesh, "behind_edges", lambda view: np.zeros(view.hole.shape, np.bool_))


@pytest.mark.usefixtures("no_halo")
def test_exact_depth_through_an_estimator_gives_what_depth_gives() -> None:
    """Oracle: the same depth, given as measured: every pixel of every result bit for bit; only origin and confidence differ.

    With one filler for both: `auto` takes another one for estimated depth.
    """
    color = RGBD_OF_WORLD.color
    estimate = estimate_depth(color, CAMERA, depth_model=knowing(RGBD_OF_WORLD), sharpen=False)
    np.testing.assert_array_equal(estimate.depth, RGBD_OF_WORLD.depth)
    mask = WORLD.trace(CAMERA)[1] == 1
    for make in (
        lambda one: dlama.view(one, yaw=12, filler="layered"),
        lambda one: dlama.remove(one, mask, yaw=5, filler="layered"),
    ):
        ours, theirs = make(estimate.rgbd), make(RGBD_OF_WORLD)
        for name in ("color", "depth", "hole", "hole_type"):
            np.testing.assert_array_equal(getattr(ours.view, name), getattr(theirs.view, name), err_msg=name)
        for cloud in ("background", "completed"):
            np.testing.assert_array_equal(getattr(ours, cloud).points, getattr(theirs, cloud).points)
        seen = np.isin(theirs.view.origin, (Origin.MEASURED, Origin.REPROJECTED))
        np.testing.assert_array_equal(ours.view.origin == Origin.ESTIMATED, seen)
        np.testing.assert_array_equal(ours.view.origin[~seen], theirs.view.origin[~seen])
        assert (ours.view.confidence[seen] < theirs.view.confidence[seen]).all()
        assert (ours.meta["depth"], theirs.meta["depth"]) == ("estimated", "measured")
        assert ours.meta["depth_estimate"]["scale"]["rule"] == "metric model" and "depth_estimate" not in theirs.meta
        assert ours.meta["law_violations"] == theirs.meta["law_violations"] == 0


@pytest.mark.usefixtures("no_halo")
def test_the_paper_recipe_clips_estimated_depth_and_stays_estimated() -> None:
    """Oracle: the measured twin under the same recipe."""
    estimate = estimate_depth(RGBD_OF_WORLD.color, CAMERA, depth_model=knowing(RGBD_OF_WORLD), sharpen=False)
    ours, theirs = (dlama.view(one, yaw=12, recipe="paper", filler="telea") for one in (estimate.rgbd, RGBD_OF_WORLD))
    np.testing.assert_array_equal(ours.view.color, theirs.view.color)
    assert (ours.source.origin == Origin.ESTIMATED).all()


def test_nothing_known_is_said_and_written() -> None:
    """Closed form: 60 degrees across the longer side, median 3 m; a warning for each."""
    for hw, fx in (((48, 64), 32), ((64, 48), 32)):
        color = np.random.default_rng(0).integers(0, 256, (*hw, 3), np.uint8)
        flat = RGBD(color, np.full(hw, 0.25, np.float32), Camera.from_fov(hw[1], hw[0], 60))
        with pytest.warns(UserWarning) as reported:
            found = estimate_depth(color, depth_model=knowing(flat, "inverse depth", metric=False))
        assert [word in str(one.message) for word, one in zip(("field of view is assumed", "scale of"), reported)] == [
            True,
            True,
        ]
        assert found.camera.fx == found.camera.fy == pytest.approx(fx / np.tan(np.radians(30)))
        assert float(np.median(found.depth)) == pytest.approx(3)
        assert found.meta["scale"]["rule"] == "assumed" and found.meta["field_of_view"]["from"] == "assumed"


def test_the_network_that_ships_sees_near_ground_and_far_wall() -> None:
    """Law, loosely: on the street that ships nearer is below; the file is what `benchmarks/depth_export.py` makes."""
    color = dlama.read_color(dlama.example() / "street.jpg")
    found = quiet(color, Camera.from_fov(512, 512, 90))
    assert np.median(found.depth[450:]) < 0.5 * np.median(found.depth[:200])
    assert found.meta["model_sha256"] == "c451d57c351064b4ef6d1d37a3dd03f30da74bcc63b2542fa5b5a018a537a3a1"
    assert found.meta["estimator"] == DEFAULT and SHIPPED.with_name("LICENSE.txt").is_file()
    again = quiet(color, Camera.from_fov(512, 512, 90))
    np.testing.assert_array_equal(again.depth, found.depth)


def test_smaller_maps_are_enlarged_in_inverse_depth() -> None:
    """Closed form: a plane is affine in inverse depth, so a quarter of its pixels gives it back between their centres."""
    w = np.linspace(0.2, 0.6, 12, dtype=np.float32)[:, None] * np.ones((1, 16), np.float32)
    color = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
    for values, gives in ((w, "inverse depth"), (1 / w, "depth")):
        found = estimate_depth(
            color, CAMERA, depth_model=lambda _, v=values, g=gives: DepthPrediction(v, g, True), sharpen=False
        )
        centre = (np.arange(48) + 0.5) / 4 - 0.5
        inside = (centre >= 0) & (centre <= 11)
        np.testing.assert_allclose(1 / found.depth[inside, 30], 0.2 + 0.4 / 11 * centre[inside], rtol=1e-5)


@pytest.mark.parametrize(
    ("options", "kind", "reported"),
    [
        ({"depth_model": "nonsense"}, InputError, "depth_model is 'nonsense'; one of tcmonodepth, .*an ONNX file"),
        ({"depth_model": "depth-anything-small"}, FileError, "dlama models pull depth-anything-small"),
        ({"depth_model": Path("none.onnx")}, FileError, r"none\.onnx: no such model file"),
        ({"metres_at": [(70, 5, 2.0)]}, InputError, "metres_at 70,5=2: lies outside the 64x48 picture; x of 0 to 63"),
        ({"metres_at": [(7, 5, -2.0)]}, InputError, "metres_at 7,5=-2: -2 m is no distance"),
        ({"metres_at": [(7, 5, 2.0)], "camera_height": 1.5}, InputError, "metres_at and camera_height contradict"),
        ({"camera_height": "1.5"}, InputError, "camera_height is '1.5'; a number is expected"),
        ({"camera_height": 0.0}, InputError, "camera_height is 0 m; a number above 0"),
        ({"camera_height": 1.5}, InputError, "no ground is seen.*give metres_at"),
        ({"metres_at": [(2, 2, 1.0), (31, 24, 9.0)]}, InputError, "metres_at contradicts the picture"),
        ({"camera": Camera.from_fov(60, 48, 60)}, ShapeError, "the camera is 60x48 and the picture 64x48"),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_bad_options_get_one_line(
    options: dict[str, Any], kind: type[Exception], reported: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: what came, what was expected, which parameter."""
    monkeypatch.setenv("DLAMA_MODELS", str(tmp_path))
    ready = {"depth_model": knowing(RGBD_OF_WORLD, "inverse depth", metric=False), "camera": CAMERA, **options}
    with pytest.raises(kind, match=reported):
        quiet(RGBD_OF_WORLD.color, **ready)


def test_bad_pictures_and_predictions_get_one_line() -> None:
    """Law: no texture, no depth anywhere, values that are none."""
    flat = np.full((48, 64, 3), 128, np.uint8)
    with pytest.raises(DepthError, match="nearly one colour all over"):
        quiet(flat)
    with pytest.raises(ShapeError, match="uint8 H x W x 3 is expected"):
        quiet(flat[..., 0])
    zeros = np.zeros((48, 64), np.float32)
    for prediction, reported in (
        (lambda _: DepthPrediction(zeros, "inverse depth"), "sees no depth in this picture"),
        (lambda _: DepthPrediction(zeros, "depth", True), "values that are not positive"),
        (lambda _: DepthPrediction(zeros * np.nan), "not numbers"),
        (
            lambda _: DepthPrediction(zeros + np.inf, "inverse depth"),
            "holds infinity, as of depth 0; 0 for what is far",
        ),
        (lambda _: DepthPrediction(zeros[0]), "shape .64,.; h x w is expected"),
        (lambda _: DepthPrediction(np.full((48, 64), 1e-9, np.float32), "inverse depth", True), "nothing but sky"),
        (
            lambda _: DepthPrediction(np.full((48, 64), 4000, np.float32), "depth", True),  # millimetres
            r"nothing is nearer than 1000 m \(scale as the network says\)",
        ),
    ):
        with pytest.raises(DepthError, match=reported):
            quiet(RGBD_OF_WORLD.color, depth_model=prediction)


@pytest.mark.parametrize("level", [0, 255])
def test_bars_of_a_film_or_scan_are_warned_of(level: int) -> None:
    """Oracle: the bars that were put there; a picture off the middle, a small thing on white and the picture itself have none."""
    color = RGBD_OF_WORLD.color
    boxed = np.pad(color, ((7, 7), (0, 0), (0, 0)), constant_values=level)
    prediction = DepthPrediction(np.ones((62, 64), np.float32), "depth", True)
    with pytest.warns(UserWarning, match=r"has bars, 7 px above and 7 px below: .*: crop them off"):
        estimate_depth(boxed, Camera.from_fov(64, 62, 60), depth_model=lambda _: prediction)
    assert describe_bars(boxed.transpose(1, 0, 2)) == "the picture has bars, 7 px left and 7 px right"
    assert describe_bars(color) == describe_bars(np.pad(color, ((7, 12), (3, 9), (0, 0)), constant_values=level)) == ""
    thing = np.pad(color, ((40, 40), (50, 50), (0, 0)), constant_values=level)
    assert describe_bars(thing) == describe_bars(np.full((9, 9, 3), level, np.uint8)) == ""


def test_names_are_those_of_the_catalogue() -> None:
    """Law: the default ships; every other estimator can be pulled by its name, and is of the contract that says so."""
    first, *others = ESTIMATORS
    assert first == DEFAULT
    for name in others:
        assert CATALOGUE[name].contract == "depth-network" and CATALOGUE[name].file.endswith(".onnx")
    assert {name for name, record in CATALOGUE.items() if record.contract == "depth-network"} == set(others)
    assert find_estimator(DEFAULT)[0] == DEFAULT


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((0, 0, 3), np.uint8),
        np.zeros((8, 8), np.uint8),
        np.zeros((8, 8, 4), np.uint8),
        np.zeros((8, 8, 3)),
        [[1, 2], [3, 4]],
        None,
    ],
)
@pytest.mark.parametrize("use", [estimate_depth, lambda picture: dlama.find_mask(picture, masker="salient")])
def test_what_is_no_picture_is_refused(use: Callable[[Any], object], picture: Any) -> None:
    """Law: one message for whatever takes a picture without depth; what is no array at all is of a wrong type."""
    of_shape, of_type = r"is \w+ \(.*\); uint8 H x W x 3 is expected", "is of type .*; a picture is expected"
    with pytest.raises(
        InputError, match=f"(colour|picture) {of_shape if isinstance(picture, np.ndarray) else of_type}"
    ):
        use(picture)
