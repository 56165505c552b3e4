"""MASK on the square before the wall: a click and a box find it (closed form), and the removal is scored as ORI scores it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from square_world import FILLED, SOURCE, SQUARE_IN_SOURCE, WALL, constant_filler, frame, rectangle, values

from dlama.datasets.frames import Case, Dataset, RemovalTruth, ViewTruth
from dlama.errors import InputError
from dlama.evaluation.protocols import PROTOCOLS, mask
from dlama.evaluation.protocols.mask import shadow_measures
from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.evaluation.protocols.pointing import CLICKS

__all__ = ["constant_filler"]
QUICK = ProtocolSettings(lpips=False, mask_changes=(), ring_px=8)
TRUTH = RemovalTruth(frame(SOURCE, SQUARE_IN_SOURCE), frame(SOURCE, None), SQUARE_IN_SOURCE)


@pytest.mark.slow
def test_the_square_is_found_and_removed(constant_filler: str) -> None:
    """IoU and border F of 1 by every click and by the box; the region of the true mask is off by what the filler wrote."""
    (plain,) = PROTOCOLS["mask"](TRUTH, Method("paper", constant_filler), QUICK)
    found = values(plain.measures)
    for name in (*CLICKS, "box"):
        assert found[name, "mask", "iou"] == found[name, "mask", "border_f"] == 1
    assert found["mask", "rgb", "mse"] == (WALL - FILLED) ** 2
    assert found["shadow", "mask", "false_alarm"] == 0
    assert {
        ("grabcut-box", "mask", "iou"),
        ("click-estimated-depth", "mask", "iou"),
        ("box-estimated-depth", "mask", "iou"),
    } <= set(found)


@pytest.mark.slow
def test_variants_remove_with_other_masks(constant_filler: str) -> None:
    """The found mask is the true one and there is no shadow: all runs score alike."""
    settings = dataclasses.replace(QUICK, mask_changes=(3,))
    runs = PROTOCOLS["mask"](TRUTH, Method("paper", constant_filler), settings)
    assert [run.variant for run in runs] == ["", "clicks-2", "true-mask", "with-shadow"]
    errors = {values(run.measures)["mask", "rgb", "mse"] for run in runs}
    assert len(errors) == 1


def test_a_shadow_that_is_not_found_is_not_recalled() -> None:
    """A dark strip far from the square, which nothing casts: recall 0, and no precision where nothing was found."""
    color = TRUTH.source.color.copy()
    color[rectangle((56, 64))] = 50
    dark = dataclasses.replace(TRUTH, source=dataclasses.replace(TRUTH.source, color=color))
    assert [(one.metric, one.value) for one in shadow_measures(dark)] == [("recall", 0)]


def test_the_contact_line_is_neither_right_nor_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lower half of a shadow is found, and two pixels beside the square: precision 1; they alone are no alarm.

    The true shadow is the strip of 8 x 20 px and, by means of 3 x 3 px, what touches a side of it: 10 x 22 but for the corners.
    """
    color, strip = TRUTH.source.color.copy(), rectangle((52, 60), (20, 40))
    color[strip] = 50
    dark = dataclasses.replace(TRUTH, source=dataclasses.replace(TRUTH.source, color=color))
    contact, lower = rectangle((48, 50), (16, 48)), rectangle((52, 60), (30, 40))
    monkeypatch.setattr(mask, "detect_shadow", lambda truth: contact | lower)
    found = {one.metric: one.value for one in shadow_measures(dark)}
    assert found == {"recall": 8 * 10 / (10 * 22 - 4), "precision": 1}
    monkeypatch.setattr(mask, "detect_shadow", lambda truth: contact)
    assert [(one.metric, one.value) for one in shadow_measures(TRUTH)] == [("false_alarm", 0)]


def test_every_removal_is_a_case_of_masks() -> None:
    case = Case("ori", "toy", "room", "one", lambda: TRUTH)
    (pointed,) = Dataset("toy", "made-up", None, (), (case,)).of("mask")
    assert pointed.protocol == "mask" and pointed.key == "mask__toy__room__one" and pointed.load() is TRUTH


def test_what_is_no_removal_is_refused() -> None:
    with pytest.raises(InputError, match="mask: the case holds a ViewTruth"):
        PROTOCOLS["mask"](ViewTruth(TRUTH.source, TRUTH.without), Method("paper", "telea"), QUICK)
    empty = dataclasses.replace(TRUTH, mask=np.zeros_like(TRUTH.mask))
    with pytest.raises(InputError, match="a RemovalTruth with a mask"):
        PROTOCOLS["mask"](empty, Method("paper", "telea"), QUICK)
