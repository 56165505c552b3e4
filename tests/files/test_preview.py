"""The contact sheet: every panel is on it, unscaled where it fits; colours mean what the palettes say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.errors import ShapeError
from dlama.files import preview
from dlama.files.preview import HATCH, HOLE_PALETTE, ORIGIN_PALETTE, SKY, depth_picture, write_preview
from dlama.geometry.view import HoleType, Origin


def test_palettes_have_a_colour_for_every_code() -> None:
    assert len(HOLE_PALETTE) == len(HoleType) and len(set(HOLE_PALETTE)) == len(HOLE_PALETTE)
    assert len(ORIGIN_PALETTE) == len(Origin) and len(set(ORIGIN_PALETTE)) == len(ORIGIN_PALETTE)


def test_depth_picture_states() -> None:
    """Sky pale, missing and holes hatched, near redder than far (oracle: the first and last colours of turbo)."""
    depth = np.array([[0, np.inf, np.nan, 1, 2, 4, 8]], np.float32)
    hole = np.zeros(depth.shape, bool)
    hole[0, 4] = True
    seen = depth_picture(depth, hole, lo=1, hi=8)
    assert tuple(seen[0, 1]) == SKY
    assert all(tuple(seen[0, i]) in HATCH for i in (0, 2, 4))
    assert seen[0, 3, 0] > 2 * seen[0, 3, 2] and seen[0, 6, 2] > seen[0, 6, 1]
    assert np.array_equal(
        depth_picture(depth, hole, 1, 8)[:, 3:6], depth_picture(depth[:, :6], hole[:, :6], 1, 8)[:, 3:6]
    )


@pytest.mark.parametrize("value", [0, np.inf, 2])
def test_depth_picture_of_one_value(value: float) -> None:
    assert depth_picture(np.full((3, 4), value, np.float32)).shape == (3, 4, 3)
    lo, hi = preview.depth_limits(np.full((3, 4), value, np.float32))
    assert 0 < lo < hi < np.inf


def test_hole_picture_and_legend() -> None:
    color = np.full((10, 10, 3), 77, np.uint8)
    types = np.zeros((10, 10), np.uint8)
    types[:2], types[9, 0] = HoleType.OUT_OF_VIEW, HoleType.OBJECT
    seen = preview.hole_picture(color, types)
    assert (seen[3:9] == 77).all() and tuple(seen[0, 0]) == HOLE_PALETTE[HoleType.OUT_OF_VIEW]
    assert preview.hole_legend(types) == [
        ("out of view 20.0 %", HOLE_PALETTE[HoleType.OUT_OF_VIEW]),
        ("object 1.0 %", HOLE_PALETTE[HoleType.OBJECT]),
    ]
    assert preview.percent(1e-5) == "<0.1 %" and preview.percent(0) == "0.0 %"


@pytest.mark.parametrize(
    ("count", "columns"), [(1, 1), (2, 2), (3, 3), (4, 2), (5, 3), (6, 3), (7, 4), (8, 4), (9, 3), (12, 4)]
)
def test_rows_are_balanced(count: int, columns: int) -> None:
    assert preview.columns_for(count) == columns


def test_every_panel_is_on_the_sheet(tmp_path: Path) -> None:
    """Oracle: each panel of one colour, 100 x 80 drawn in blocks of 4, shows exactly 400 x 320 pixels of it."""
    shades = [(250, 10 * i, 3) for i in range(5)]
    panels = [(f"panel {i}", np.full((80, 100, 3), shade, np.uint8)) for i, shade in enumerate(shades)]
    write_preview(tmp_path / "p.png", "A title " * 30, panels, legend=[(f"entry {i}", (1, 2, 250)) for i in range(40)])
    sheet = np.array(Image.open(tmp_path / "p.png"))
    assert sheet.ndim == 3 and sheet.shape[1] < 1400
    for shade in shades:
        assert (sheet == shade).all(axis=2).sum() == 400 * 320
    assert (sheet == (1, 2, 250)).all(axis=2).sum() > 40 * 100


@pytest.mark.parametrize("hw", [(1, 1), (1, 900), (900, 1), (2160, 3840)])
def test_any_size_of_panel(tmp_path: Path, hw: tuple[int, int]) -> None:
    write_preview(tmp_path / "p.png", "", [("wordwithoutanyspace" * 9, np.zeros((*hw, 3), np.uint8))])
    with Image.open(tmp_path / "p.png") as sheet:
        assert sheet.width <= 460 and sheet.height <= 760


def test_what_is_no_panel_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="no panels"):
        write_preview(tmp_path / "p.png", "t", [])
    with pytest.raises(ShapeError, match="panel 'x' is float32"):
        write_preview(tmp_path / "p.png", "t", [("x", np.zeros((3, 3, 3), np.float32))])  # type: ignore[list-item]
    assert not any(tmp_path.iterdir())
