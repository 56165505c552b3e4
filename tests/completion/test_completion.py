"""What a completion gives back: what is computed from the scene is computed once, one line says what it is, and what is less sure
stays open if asked for (oracles: counts, and the same completion without the option)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from small_street import CAMERA, MASK, completed, street

import dlama
from dlama.completion.pipeline import complete
from dlama.completion.report import hole_shares
from dlama.completion.verbs import remove, view
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.motion.trajectories import orbit

LEAST = 0.6
"""Confidence."""


def test_clouds_and_mesh_are_computed_once() -> None:
    """Law: asked for twice they are the same objects."""
    done = remove(street(), MASK, filler="telea")
    for name in ("completed", "background", "mesh"):
        assert getattr(done, name) is getattr(done, name)
    assert len(done.completed) > len(done.background)


def test_one_line_says_what_it_is() -> None:
    """Frozen: type, views and their size, what share lacked colour, filler and recipe; no arrays."""
    done = completed("dlama", "telea", True, 0.0)
    share = 100 * done.meta["hole_share"][0]
    assert repr(done) == f"Completion(1 view of 128x96, {share:.1f} % was unknown, filled by 'telea', recipe 'dlama')"
    two = complete(street(), [CAMERA, orbit(CAMERA, 5)], filler="telea")
    assert repr(two).startswith("Completion(2 views of 128x96, ")
    assert repr(complete(street(), [], mask=MASK, filler="telea")) == (
        "Completion(0 views, filled by 'telea', recipe 'dlama')"
    )


def test_shares_by_type() -> None:
    """Closed form: 3 of 12 pixels out of view, 1 an object, and NONE is not listed."""
    shares = hole_shares(np.array([[4, 4, 4, 0], [0, 6, 0, 0], [0, 0, 0, 0]], np.uint8))
    assert shares.pop("out_of_view") == 0.25 and shares.pop("object") == 1 / 12
    assert set(shares) == {"crack", "disoccluded", "flying", "sensor"} and not any(shares.values())


def test_no_camera_is_refused_where_there_is_nothing_to_do() -> None:
    """Without a mask; with one the scene is there, and a view that is not says so."""
    with pytest.raises(InputError, match="cameras is empty; one camera or more is expected"):
        complete(street(), [])
    done = complete(street(), [], mask=MASK, filler="telea")
    assert len(done.mesh.vertices) > 100
    with pytest.raises(InputError, match="the completion has no view"):
        print(done.view)


@pytest.mark.parametrize("verb", [view, lambda color, **move: remove(color, np.eye(8, dtype=bool), **move)])
def test_a_picture_without_depth_is_refused_with_advice(verb: Callable[..., object]) -> None:
    """Law: the first thing that people try, an array of colours, gets the names of what makes an RGBD of it."""
    with pytest.raises(InputError, match=r"rgbd is of type ndarray; an RGBD.* expected.*read_rgbd.*estimate_depth"):
        verb(np.zeros((8, 8, 3), np.uint8), yaw=5)
    with pytest.raises(
        InputError, match=r"rgbd is of type ndarray; an RGBD, a Scene or a list of RGBDs or functions is expected"
    ):
        complete(np.zeros((8, 8, 3), np.uint8), [Camera.from_fov(8, 8, 60)])  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def completions() -> tuple[dlama.Completion, dlama.Completion]:
    """A removal seen from elsewhere, whole and with a least confidence."""
    whole = completed("dlama", "telea", True, 14.0)
    return whole, remove(street(), MASK, yaw=14, filler="telea", min_confidence=LEAST)


def test_views_lose_what_is_less_sure_and_nothing_else(
    completions: tuple[dlama.Completion, dlama.Completion],
) -> None:
    """Law: open exactly where a filled pixel had less; there depth and origin are 0; all other pixels keep their bits."""
    whole, sure = (done.view for done in completions)
    filled = np.isin(whole.origin, (Origin.FILLED, Origin.DEPTH_FILLED))
    unsure = filled & (whole.confidence < LEAST)
    assert 0.05 < unsure.sum() / filled.sum() < 0.95
    np.testing.assert_array_equal(sure.hole, unsure)
    assert (sure.depth[unsure] == 0).all() and (sure.origin[unsure] == Origin.UNKNOWN).all()
    assert (sure.confidence[unsure] == 0).all() and (sure.color[unsure & whole.filled] == 0).all()
    for name in ("color", "depth", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(sure, name)[~unsure], getattr(whole, name)[~unsure])
    np.testing.assert_array_equal(sure.hole_type, whole.hole_type)


def test_clouds_and_meshes_lose_it_too(completions: tuple[dlama.Completion, dlama.Completion]) -> None:
    """Law: no filled point below it is left; measured points are all there."""
    whole, sure = completions
    for noun in ("completed", "background", "mesh"):
        every, kept = getattr(whole, noun), getattr(sure, noun)
        assert (kept.confidence[np.isin(kept.origin, (Origin.FILLED, Origin.DEPTH_FILLED))] >= LEAST).all()
        if noun != "mesh":
            filled = np.isin(every.origin, (Origin.FILLED, Origin.DEPTH_FILLED))
            assert len(kept.points) == int((~filled | (every.confidence >= LEAST)).sum()) < len(every.points)


def test_meta_says_it_and_bad_values_are_refused(completions: tuple[dlama.Completion, dlama.Completion]) -> None:
    """Count: the share of the view; a probability is expected; 0 changes nothing."""
    whole, sure = completions
    assert sure.meta["min_confidence"] == LEAST and "min_confidence" not in whole.meta
    assert sure.meta["left_open_share"] == [round(float(sure.view.hole.mean()), 6)]
    assert whole.with_min_confidence(0) is whole
    by_steps = whole.with_min_confidence(LEAST / 2).with_min_confidence(LEAST)
    for other in (by_steps, by_steps.with_min_confidence(LEAST / 2)):  # what is open stays open
        assert other.meta["min_confidence"] == LEAST
        assert other.meta["left_open_share"] == pytest.approx([other.view.hole.mean()], abs=2e-6)
    for wrong in (-0.1, 1.5, float("nan")):
        with pytest.raises(InputError, match=f"min_confidence is {wrong}; a probability from 0 to 1 is expected"):
            whole.with_min_confidence(wrong)


def test_measured_colours_are_no_holes_where_depth_is_left_open() -> None:
    """Law: a sensor hole whose filled depth is less sure than asked for keeps its colour and lacks depth alone."""
    frame = street()
    done = dlama.view(frame, filler="telea")
    opened = done.with_min_confidence(0.99).view
    assert opened.hole.any() and frame.missing[opened.hole].all() and not opened.color_hole.any()
    np.testing.assert_array_equal(opened.color, frame.color)
