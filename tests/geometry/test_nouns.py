"""RGBD, View, PointCloud and Scene: checked once, frozen, and what they derive (oracle: the field docstrings)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dlama.errors import DepthError, InputError, InputTypeError, ShapeError
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import Mesh, PointCloud, concatenate
from dlama.geometry.codes import HoleType, Origin, from_source
from dlama.geometry.rgbd import RGBD, check_color, describe_depth_range
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

CAMERA = Camera(3, 2, 2.0, 2.0, 1.5, 1.0)
COLOR = np.arange(18, dtype=np.uint8).reshape(2, 3, 3) + 1
DEPTH = np.array([[1, np.inf, 0], [2, np.nan, 3]], np.float32)


def view_fields() -> dict[str, Any]:
    """A view's fields, all measured."""
    return {
        "camera": CAMERA,
        "color": COLOR,
        "depth": np.ones((2, 3), np.float32),
        "hole": np.zeros((2, 3), np.bool_),
        "hole_type": np.zeros((2, 3), np.uint8),
        "origin": np.ones((2, 3), np.uint8),
        "confidence": np.ones((2, 3), np.float32),
    }


def cloud_of(count: int, start: float = 0) -> PointCloud:
    """Points on a line."""
    return PointCloud(
        np.arange(3 * count, dtype=np.float64).reshape(count, 3) + start,
        np.zeros((count, 3), np.uint8),
        np.ones(count, np.uint8),
        np.ones(count, np.float32),
    )


def test_three_states_of_depth() -> None:
    """Closed form: every pixel is valid, far or missing, never two; NaN becomes missing."""
    rgbd = RGBD(COLOR, DEPTH, CAMERA)
    np.testing.assert_array_equal(rgbd.valid, [[1, 0, 0], [1, 0, 1]])
    np.testing.assert_array_equal(rgbd.far, [[0, 1, 0], [0, 0, 0]])
    np.testing.assert_array_equal(rgbd.missing, [[0, 0, 1], [0, 1, 0]])
    assert rgbd.depth[1, 1] == 0 and rgbd.depth.dtype == np.float32


def test_depth_of_another_dtype_becomes_float32() -> None:
    """Closed form: float64 metres come in, float32 stand there; what was handed in is left alone."""
    given = np.full((2, 3), 0.1)
    given[0, 0] = np.nan
    rgbd = RGBD(COLOR, given, CAMERA)  # type: ignore[arg-type]
    assert rgbd.depth.dtype == np.float32 and np.isnan(given[0, 0])
    assert rgbd.depth[1, 1] == np.float32(0.1)


REFUSED = [
    ({"color": COLOR.astype(np.float32)}, ShapeError, "float32"),
    ({"color": COLOR[..., :2]}, ShapeError, r"\(2, 3, 2\)"),
    ({"color": COLOR[..., 0]}, ShapeError, r"\(2, 3\)"),
    ({"depth": np.ones((3, 2), np.float32)}, ShapeError, "2x3 and the picture 3x2"),
    ({"depth": np.ones((2, 3, 1), np.float32)}, ShapeError, r"\(2, 3, 1\)"),
    ({"camera": Camera(4, 2, 2.0, 2.0, 1.5, 1.0)}, ShapeError, "camera is 4x2 and the picture 3x2"),
    ({"depth": np.full((2, 3), -0.5, np.float32)}, DepthError, "-0.5"),
    *(
        ({"depth": np.ones((2, 3), kind)}, DepthError, r"depth is \S+; metres as numbers are expected")
        for kind in ("bool", "object", "str", "complex")  # a mask handed in as depth would be a wall at 1 m
    ),
    *(
        ({"depth": np.full((2, 3), 100, kind)}, DepthError, rf"{kind}, and nothing says in which unit.*depth / 1000 of")
        for kind in ("uint8", "uint16", "int32", "int64")  # a wall 100 m off, or a hand at .1 m
    ),
    ({"depth": np.ma.masked_equal(DEPTH, DEPTH[0, 0])}, InputTypeError, r"masked array.*filled\(0\)"),
    *(
        ({"color": Image.fromarray(COLOR).convert(mode)}, ShapeError, f"of mode {mode}")
        for mode in ("P", "CMYK", "YCbCr")
    ),
]


@pytest.mark.parametrize(("change", "error", "said"), REFUSED)
def test_rgbd_refuses(change: dict[str, Any], error: type[InputError], said: str) -> None:
    """Oracle: the error of the tree, whose message says what came."""
    fields: dict[str, Any] = {"color": COLOR, "depth": DEPTH, "camera": CAMERA, **change}
    with pytest.raises(error, match=said):
        RGBD(**fields)


def test_arrays_are_read_only() -> None:
    """Law: no array of a noun can be written to, so that nouns made of others share them."""
    rgbd, view, cloud = RGBD(COLOR, DEPTH, CAMERA), View(**view_fields()), cloud_of(2)
    for array in (rgbd.color, rgbd.depth, view.color, view.depth, view.hole, view.origin, cloud.points, cloud.color):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert dataclasses.replace(view, hole=np.ones((2, 3), np.bool_)).color is view.color


@pytest.mark.parametrize("noun", ["view", "cloud"])
def test_fields_of_wrong_shape_or_dtype_are_refused(noun: str) -> None:
    """Oracle: a ShapeError that names the field; each field is tried with another size and with another dtype."""
    fields = view_fields() if noun == "view" else vars(cloud_of(3))
    made = {"view": View, "cloud": PointCloud}[noun]
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            with pytest.raises(ShapeError, match=rf"view\.{name} " if noun == "view" else r"cloud\."):
                made(**{**fields, name: value[:, :2] if noun == "view" else value[:2]})
            with pytest.raises(ShapeError, match=rf"{noun}\.{name} is complex64"):
                made(**{**fields, name: value.astype(np.complex64)})


def test_view_from_rgbd_marks_sensor_holes() -> None:
    """Closed form: missing pixels are SENSOR holes that keep their colour and wait for depth; the rest is MEASURED."""
    view = View.from_rgbd(RGBD(COLOR, DEPTH, CAMERA))
    missing = np.array([[0, 0, 1], [0, 1, 0]], np.bool_)
    np.testing.assert_array_equal(view.hole, missing)
    np.testing.assert_array_equal(view.hole_type, missing * HoleType.SENSOR)
    assert (view.origin == Origin.MEASURED).all()
    np.testing.assert_array_equal(view.depth_hole, missing)
    assert not view.color_hole.any() and view.without(missing, HoleType.SENSOR).color_hole[missing].all()
    np.testing.assert_array_equal(view.confidence, ~missing)
    np.testing.assert_array_equal(view.color, COLOR)
    np.testing.assert_array_equal(view.valid, [[1, 0, 0], [1, 0, 1]])
    np.testing.assert_array_equal(view.far, [[0, 1, 0], [0, 0, 0]])


def test_depth_that_became_known_closes_a_sensor_hole_and_what_is_out_of_view_is_no_such() -> None:
    """Closed form: with 3 m in its holes the view is whole, and otherwise as it was; out of view colour is missing, too."""
    view = View.from_rgbd(RGBD(COLOR, DEPTH, CAMERA))
    missing = view.hole
    known = view.with_known_depth(np.full_like(DEPTH, 3), missing)
    assert not known.hole.any() and (known.depth[missing] == 3).all()
    np.testing.assert_array_equal(known.depth[~missing], view.depth[~missing])
    np.testing.assert_array_equal(known.color, COLOR)
    assert not view.unseen_hole.any() and not view.without(missing, HoleType.OBJECT).unseen_hole.any()
    np.testing.assert_array_equal(view.without(missing, HoleType.OUT_OF_VIEW).unseen_hole, missing)


def test_estimated_depth_has_an_origin_and_a_confidence_of_its_own() -> None:
    """Closed form: where measured depth would be MEASURED and sure it is ESTIMATED and less sure; nothing else differs."""
    measured, estimated = (View.from_rgbd(RGBD(COLOR, DEPTH, CAMERA, about)) for about in (None, {"model": "x"}))
    known = ~measured.hole
    np.testing.assert_array_equal(estimated.origin, np.where(known, Origin.ESTIMATED, measured.origin))
    np.testing.assert_array_equal(estimated.confidence, np.where(known, np.float32(0.6), np.float32(0)))
    np.testing.assert_array_equal(from_source(estimated.origin), from_source(measured.origin))
    for name in ("color", "depth", "hole", "hole_type"):
        np.testing.assert_array_equal(getattr(estimated, name), getattr(measured, name))


def test_view_without_leaves_typed_holes() -> None:
    """Closed form: what is removed is 0 in every field and carries the type; every other pixel is as it was."""
    where = np.array([[1, 0, 0], [0, 0, 1]], np.bool_)
    view = View(**view_fields())
    less = view.without(where, HoleType.OBJECT)
    np.testing.assert_array_equal(less.hole, where)
    np.testing.assert_array_equal(less.hole_type, where * HoleType.OBJECT)
    for name in ("color", "depth", "origin", "confidence"):
        assert not getattr(less, name)[where].any()
        np.testing.assert_array_equal(getattr(less, name)[~where], getattr(view, name)[~where])
        assert getattr(less, name).dtype == getattr(view, name).dtype


def test_codes_are_fixed() -> None:
    """Frozen vector: these numbers stand in files that are already written."""
    origins = ["UNKNOWN", "MEASURED", "REPROJECTED", "DEPTH_FILLED", "FILLED", "ESTIMATED", "ELSEWHERE"]
    holes = ["NONE", "CRACK", "DISOCCLUDED", "FLYING", "OUT_OF_VIEW", "SENSOR", "OBJECT"]
    for codes, names in ((Origin, origins), (HoleType, holes)):
        assert [(kind.name, int(kind)) for kind in codes] == [(name, code) for code, name in enumerate(names)]


def test_concatenated_keeps_order_and_takes_nothing() -> None:
    """Closed form: points one after the other; no clouds give an empty one."""
    both = concatenate([cloud_of(2), cloud_of(0), cloud_of(1, start=100)])
    np.testing.assert_array_equal(both.points[:, 0], [0, 3, 100])
    assert len(both) == 3 and len(concatenate([])) == 0


def test_a_scene_without_frames_or_of_several_sizes_is_refused() -> None:
    """Oracle: the error of the tree; rendering them ended in one of numpy."""
    with pytest.raises(ShapeError, match="frames is empty"):
        Scene(())
    view = View.from_rgbd(RGBD(COLOR, DEPTH, CAMERA))
    with pytest.raises(ShapeError, match="left is 2x2 and right 3x2; both must have the same size"):
        Scene((view, view.cropped(slice(0, 2), slice(0, 2))), names=("right", "left"))


def test_pictures_say_what_they_are_in_one_line() -> None:
    """Closed form: valid depths are 1, 2 and 3 m, two of six pixels lack depth; one more is removed of the view."""
    rgbd = RGBD(COLOR, DEPTH, CAMERA)
    assert repr(rgbd) == "RGBD(3x2, 1 to 3 m, 33 % missing)"
    assert describe_depth_range(np.float32([0, 0.01234, 999.98, 12345, np.inf])) == "0.0123 to 12300 m"
    assert describe_depth_range(np.zeros(1, np.float32)) == "no depth"
    view = View.from_rgbd(rgbd).without(np.array([[1, 0, 0], [0, 0, 0]], np.bool_), HoleType.OBJECT)
    assert repr(view) == "View(3x2, 2 to 3 m, 50 % hole, 0 % filled)"
    assert repr(Scene((view,))) == f"Scene(1 frame, 0 removals, 0 fills, first frame {view!r})"
    assert repr(RGBD(COLOR, np.zeros((2, 3), np.float32), CAMERA)) == "RGBD(3x2, no depth, 100 % missing)"


def test_points_and_triangles_say_what_they_are_in_one_line() -> None:
    """Closed form: points (0 1 2), (3 4 5), (6 7 8) fill a box of 6 m a side."""
    cloud = cloud_of(3)
    assert repr(cloud) == "PointCloud(3 points, 6 x 6 x 6 m)"
    assert repr(concatenate([])) == "PointCloud(0 points, empty)"
    triangle = np.array([[0, 1, 2]], np.int32)
    mesh = Mesh(cloud.points, triangle, cloud.color, cloud.origin, cloud.confidence)
    assert repr(mesh) == "Mesh(3 vertices, 1 triangle, 6 x 6 x 6 m)"


def test_nouns_keep_what_they_were_given() -> None:
    """A buffer that is written to again (a video's) changes no noun made of it, nor does one behind a read-only view."""
    rgb, depth, padding = COLOR.copy(), np.ones((2, 3), np.float32), np.zeros((2, 3), np.bool_)
    estimate = {"estimator": "mine"}
    rgbd = RGBD(rgb, depth, CAMERA, estimate, padding)
    shown = rgb.view()
    shown.flags.writeable = False
    behind = RGBD(shown, depth, CAMERA)
    fields = {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in view_fields().items()}
    view = View(**fields)
    points = np.zeros((4, 3))
    cloud = PointCloud(points, np.zeros((4, 3), np.uint8), np.zeros(4, np.uint8), np.zeros(4, np.float32))
    mesh = Mesh(points, np.array([[0, 1, 2]], np.int32), cloud.color, cloud.origin, cloud.confidence)
    layers = [view]
    scene = Scene(layers)  # type: ignore[arg-type]
    for buffer in (rgb, depth, padding, points, *(value for value in fields.values() if isinstance(value, np.ndarray))):
        buffer[...] = 77 if buffer.dtype != np.bool_ else True
    layers.clear(), estimate.clear()
    assert rgbd.estimate == {"estimator": "mine"}
    assert (rgbd.color == COLOR).all() and (behind.color == COLOR).all() and (rgbd.depth == 1).all()
    assert rgbd.padding is not None and not rgbd.padding.any()
    assert (view.color == COLOR).all() and not view.hole.any() and (view.depth == 1).all()
    assert not cloud.points.any() and not mesh.vertices.any() and scene.frames == (view,)


@pytest.mark.parametrize(
    "usual",
    [
        lambda color: color.transpose(2, 0, 1),
        lambda color: color / 255,
        lambda color: color.astype(np.float32),
        lambda color: np.dstack([color, color[..., :1]]),
    ],
)
def test_what_a_wrong_picture_is_reported_makes_a_right_one(usual) -> None:
    """Round trip: the advice of the message, done to the array that was given, gives the picture back."""
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    with pytest.raises(ShapeError) as refused:
        check_color(usual(picture))
    advice = str(refused.value).rpartition(": ")[2]
    np.testing.assert_array_equal(eval(advice, {"color": usual(picture), "np": np}), picture)
