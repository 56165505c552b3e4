"""What is marked, and the mask it makes (oracles: closed forms, find_mask itself)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from handing_in import completed, open_frame

import dlama
from dlama.errors import InputError, MaskError
from dlama.web import api, pictures
from dlama.web.answers import Blob, PageError, field_of
from dlama.web.completions import results
from dlama.web.form import read_request
from dlama.web.marks import Marks, Stroke, mask_of, read_marks
from dlama.web.visits import Visit


def test_clicks_are_find_mask(visit: Visit, frame: Path) -> None:
    """Oracle: find_mask; the mask picture says the same; undoing the click leaves nothing."""
    open_frame(visit, frame)
    reported = api.mark(visit, {"marks": [{"kind": "click", "at": [30, 24]}, {"kind": "not", "at": [5, 5]}]})
    assert visit.source is not None
    expected = dlama.find_mask(visit.source.rgbd, clicks=[(30, 24)], not_clicks=[(5, 5)]).mask
    np.testing.assert_array_equal(visit.mask, expected)
    assert reported["share"] == pytest.approx(float(expected.mean()))
    blob = api.mask(visit, {})
    assert isinstance(blob, Blob)
    read = cv2.imdecode(np.frombuffer(blob.data, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read == 255, expected)
    assert api.mark(visit, {"marks": []})["share"] == 0 and visit.mask is None


def test_strokes_paint_and_erase() -> None:
    """Closed form: a disc round a point, a line as wide as the brush, and an eraser that takes it away; order counts."""
    rows, columns = np.mgrid[:40, :60]
    disc = mask_of((40, 60), Marks(strokes=(Stroke(((20, 15),), 6, True),)), None)
    away = np.hypot(columns - 20, rows - 15)
    assert disc[away <= 5].all() and not disc[away > 7].any()
    line = mask_of((40, 60), Marks(strokes=(Stroke(((5, 20), (50, 20)), 4, True),)), None)
    assert line[17:24, 10:45].all() and not line[:14].any() and not line[27:].any()
    add, erase = Stroke(((20, 15),), 6, True), Stroke(((20, 15),), 20, False)
    assert not mask_of((40, 60), Marks(strokes=(add, erase)), None).any()
    assert mask_of((40, 60), Marks(strokes=(erase, add)), None).any()


@pytest.mark.parametrize("grow", [-3, 0, 4])
def test_grow_and_shrink(grow: int) -> None:
    """Oracle: OpenCV's distance to the border of the mask."""
    stroke = Stroke(((30, 20),), 9, True)
    plain = mask_of((40, 60), Marks(strokes=(stroke,)), None)
    changed = mask_of((40, 60), Marks(strokes=(stroke,), grow=grow), None)
    outside = cv2.distanceTransform((~plain).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inside = cv2.distanceTransform(plain.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    if grow >= 0:
        assert changed[outside <= grow].all() and not changed[outside > grow + 1].any()
    else:
        assert changed[inside > 1 - grow].all() and not changed[inside < -grow].any()


@pytest.mark.parametrize(
    "fields",
    [
        {"marks": "click"},
        {"marks": [{"kind": "else"}]},
        {"marks": [{"kind": "click", "at": [1]}]},
        {"marks": [{"kind": "click", "at": ["x", 2]}]},
        {"marks": [{"kind": "add", "points": [], "radius": 3}]},
        {"marks": [{"kind": "add", "points": [[0, 0]] * 20_001, "radius": 3}]},
        {"marks": [{"kind": "click", "at": [1, 2]}] * 201},
        {"marks": [], "grow": 100},
    ],
)
def test_marks_that_are_none(fields: dict[str, Any]) -> None:
    """Refused, next to the marks."""
    with pytest.raises(InputError) as caught:
        read_marks(fields)
    assert field_of(caught.value, {}) == "marks"


def test_a_click_on_nothing_is_reported_next_to_the_marks(visit: Visit, frame: Path) -> None:
    """The wall is no object; outside the picture is nowhere; a correction needs something to correct."""
    open_frame(visit, frame)
    for mark in ({"kind": "click", "at": [60, 4]}, {"kind": "click", "at": [600, 4]}, {"kind": "not", "at": [6, 4]}):
        with pytest.raises((MaskError, dlama.InputError)):
            api.mark(visit, {"marks": [mark]})


def test_preview_is_what_the_new_camera_sees(visit: Visit, frame: Path) -> None:
    """Oracle: at the source camera the picture itself, bit for bit; with the object marked its pixels in the colour of
    `object`, and all others as they were."""
    open_frame(visit, frame)
    assert visit.source is not None
    rgbd = visit.source.rgbd
    picture, shares = pictures.Preview(rgbd, None).show({})
    np.testing.assert_array_equal(picture, rgbd.color)
    assert shares == []
    mask = dlama.find_mask(rgbd, clicks=[(30, 24)]).mask
    picture, shares = pictures.Preview(rgbd, mask).show({})
    np.testing.assert_array_equal(picture[~mask], rgbd.color[~mask])
    assert (picture[mask] == pictures.HOLE_PALETTE[6]).all()
    assert [(row["name"], row["share"]) for row in shares] == [("object", pytest.approx(float(mask.mean()), abs=1e-4))]
    moved, _ = pictures.Preview(rgbd, None).show({"yaw": 20})
    assert (moved != rgbd.color).any()


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"yaw": "x"}, "move"),
        ({"yaw": 400}, "move"),
        ({"pivot": -1}, "move"),
        ({"filler": "lama"}, "method"),
        ({"seed": -1}, "method"),
        ({"min_confidence": 2}, "method"),
        ({"recipe": "x"}, "method"),
    ],
)
def test_requests_that_cannot_be(fields: dict[str, Any], field: str) -> None:
    """Next to the camera, or the method."""
    with pytest.raises(InputError) as caught:
        read_request(fields)
    assert field_of(caught.value, {}) == field


def test_a_pixel_tells_what_it_holds(visit: Visit, frame: Path) -> None:
    """Closed form: a pixel of the wall 4 m ahead, through a lens of 60 degrees."""
    open_frame(visit, frame)
    reported = api.source_pixel(visit, {"x": 2, "y": 3})
    rgbd = visit.require_source().rgbd
    camera = rgbd.camera
    assert reported["depth"] == pytest.approx(4)
    assert reported["point"] == pytest.approx(
        [(2.5 - camera.cx) / camera.fx * 4, (3.5 - camera.cy) / camera.fy * 4, 4], abs=1e-3
    )
    assert (reported["origin"], reported["confidence"]) == ("measured", 1.0)
    result = completed(visit, yaw=10)
    view = result.done.view
    reported = results.pixel(visit, {"x": 40, "y": 20})
    assert reported["depth"] == pytest.approx(float(view.depth[20, 40]), abs=1e-4)
    with pytest.raises(PageError, match="outside"):
        results.pixel(visit, {"x": 64, "y": 0})
