"""Values of a coarse grid at the pixels of a picture (oracle: OpenCV's bilinear resizing)."""

from __future__ import annotations

import cv2
import numpy as np

from dlama.geometry.kernels.enlarging import enlarge_at


def test_as_opencv_enlarges() -> None:
    """Oracle: OpenCV, at some pixels and at the border, by another factor along each side."""
    rng = np.random.default_rng(3)
    grid = rng.uniform(-20, 275, (5, 6, 3)).astype(np.float32)
    pixels = np.flatnonzero(rng.random((40, 66)) < 0.4)
    expected = cv2.resize(grid, (66, 40), interpolation=cv2.INTER_LINEAR).reshape(-1, 3)[pixels]
    np.testing.assert_allclose(enlarge_at(grid, pixels, 66, (40 / 5, 66 / 6)), expected, atol=1e-3)


def test_nothing_is_asked_for() -> None:
    """Law: no pixel, no value."""
    assert enlarge_at(np.zeros((2, 2, 3), np.float32), np.zeros(0, np.intp), 9, (4, 4)).shape == (0, 3)
