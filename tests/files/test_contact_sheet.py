"""The contact sheet: every panel is on it, unscaled where it fits, in balanced rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.files.results.contact_sheet import write_contact_sheet


def test_every_panel_is_on_the_sheet(tmp_path: Path) -> None:
    """Oracle: each panel of one colour, 100 x 80 drawn in blocks of 4, shows exactly 400 x 320 pixels of it."""
    shades = [(250, 10 * i, 3) for i in range(5)]
    panels = [(f"panel {i}", np.full((80, 100, 3), shade, np.uint8)) for i, shade in enumerate(shades)]
    legend = [(f"entry {i}", (1, 2, 250)) for i in range(40)]
    write_contact_sheet(tmp_path / "p.png", "A title " * 30, panels, legend)
    sheet = np.array(Image.open(tmp_path / "p.png"))
    assert sheet.ndim == 3 and sheet.shape[1] < 1400
    for shade in shades:
        assert (sheet == shade).all(axis=2).sum() == 400 * 320
    assert (sheet == (1, 2, 250)).all(axis=2).sum() > 40 * 100


@pytest.mark.parametrize("hw", [(1, 1), (1, 900), (900, 1), (2160, 3840)])
def test_any_size_of_panel(tmp_path: Path, hw: tuple[int, int]) -> None:
    write_contact_sheet(tmp_path / "p.png", "", [("wordwithoutanyspace" * 9, np.zeros((*hw, 3), np.uint8))])
    with Image.open(tmp_path / "p.png") as sheet:
        assert sheet.width <= 460 and sheet.height <= 760
