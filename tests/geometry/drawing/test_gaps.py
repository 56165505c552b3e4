"""Closing gaps: what is closed, with which surface, and what stays open (oracles: closed forms, pixel by pixel)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.drawing.canvas import Canvas
from dlama.geometry.drawing.gaps import SEAM_CONFIDENCE, SKY, SKY_CONFIDENCE, WIDEST, close_gaps

WIDTH, HEIGHT = 50, 9


def canvas_of(depth: np.ndarray) -> Canvas:
    """A canvas that shows this depth (0 = empty), measured; red counts columns, green rows."""
    canvas = Canvas.empty(Camera.from_fov(depth.shape[1], depth.shape[0], 60))
    known = depth > 0
    rows, columns = np.indices(depth.shape)
    canvas.depth[:] = depth
    canvas.color[..., 0], canvas.color[..., 1] = columns * 4 * known, rows * 20 * known
    canvas.origin[known], canvas.confidence[known] = Origin.REPROJECTED, 1
    return canvas


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_seam_of_one_surface_is_closed_between_its_sides(width: int, turned: bool) -> None:
    """Closed form: up to WIDEST px inverse depth and colour continue linearly, wider stays open; rows and columns alike."""
    w = np.broadcast_to(0.5 + 0.001 * np.arange(WIDTH), (HEIGHT, WIDTH)).astype(np.float32)
    depth = 1 / w
    depth[:, 20 : 20 + width] = 0
    canvas = canvas_of(depth.T if turned else depth)
    before = canvas.color.copy()
    close_gaps(canvas)
    got, color = (canvas.depth.T, canvas.color.transpose(1, 0, 2)) if turned else (canvas.depth, canvas.color)
    gap = np.s_[:, 20 : 20 + width]
    if width > WIDEST:
        assert (got[gap] == 0).all()
        return
    np.testing.assert_allclose(1 / got[gap], w[gap], rtol=1e-6)
    along = color[gap][..., 1 if turned else 0]
    np.testing.assert_allclose(
        along, np.broadcast_to(np.arange(20, 20 + width) * (20 if turned else 4), along.shape) % 256
    )
    closed = canvas.origin == Origin.FILLED
    assert closed.sum() == width * HEIGHT and (canvas.confidence[closed] == np.float32(SEAM_CONFIDENCE)).all()
    np.testing.assert_array_equal(canvas.color[~closed], before[~closed])


def test_between_two_surfaces_the_farther_one_continues() -> None:
    """Closed form: next to a near post the wall's own depth and colour; next to sky, sky."""
    for farther in (4.0, np.inf):
        depth = np.full((HEIGHT, WIDTH), 2, np.float32)
        depth[:, 22:], depth[:, 20:22] = farther, 0
        canvas = canvas_of(depth)
        close_gaps(canvas)
        assert (canvas.depth[:, 20:22] == farther).all() and (canvas.color[:, 20:22, 0] == 22 * 4).all()


@pytest.mark.parametrize("side", ["left", "right", "both", "border"])
def test_sky_continues_along_its_row_for_a_while(side: str) -> None:
    """Closed form: up to SKY of the width, whichever side it is on; a pixel more stays open, and so does a gap in a wall."""
    most = int(SKY * WIDTH)
    for length in (most, most + 1):
        depth = np.full((HEIGHT, WIDTH), 3, np.float32)
        start = WIDTH - length if side == "border" else 20
        depth[:, start : start + length] = 0
        if side in ("left", "both", "border"):
            depth[:, :start] = np.inf
        if side in ("right", "both"):
            depth[:, start + length :] = np.inf
        depth[0] = np.where(depth[0] == 0, 0, 3)  # a row without sky
        canvas = canvas_of(depth)
        close_gaps(canvas)
        got = canvas.depth[1:, start : start + length]
        assert np.isposinf(got).all() if length == most else (got == 0).all()
        assert (canvas.depth[0, start : start + length] == 0).all()
        if length == most:
            assert (canvas.confidence[1:, start : start + length] == np.float32(SKY_CONFIDENCE)).all()


def test_a_measured_colour_without_depth_stays() -> None:
    """Law: a sensor hole one pixel wide keeps its colour and origin; an empty or a full canvas is no error."""
    depth = np.full((HEIGHT, WIDTH), 2, np.float32)
    depth[:, 20] = 0
    canvas = canvas_of(depth)
    canvas.color[:, 20], canvas.origin[:, 20] = 99, Origin.MEASURED
    close_gaps(canvas)
    assert (canvas.depth[:, 20] == 0).all() and (canvas.color[:, 20] == 99).all()
    for same in (np.zeros((3, 4), np.float32), np.ones((3, 4), np.float32)):
        canvas = canvas_of(same)
        close_gaps(canvas)
        np.testing.assert_array_equal(canvas.depth, same)
