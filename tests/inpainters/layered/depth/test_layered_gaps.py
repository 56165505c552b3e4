"""A surface behind all that surrounds a gap: sooner than the sky, no nearer than the law lets it, not far behind."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import HoleType, View
from dlama.geometry.visibility import Law
from dlama.inpainters.layered.depth.gaps import DEEPEST, surface_behind
from dlama.inpainters.layered.filler import continue_lawfully
from dlama.perception.planes import SKY, SMOOTH
from worlds import moved

CAMERA = Camera.from_fov(96, 96, 60)
WALL, BOTTOM = 8.0, 9.0
GAP = np.zeros(CAMERA.hw, bool)
GAP[30:80, 45:52] = True


def two_houses(bottom: float) -> tuple[np.ndarray, np.ndarray]:
    """Two walls 8 m off below the sky, between them a hole through which the source saw `bottom` (m); a post on the wall has no
    plane. Labels and depth (m) of the gap's pixels, as filled."""
    depth = np.full(CAMERA.hw, WALL, np.float32)
    depth[:8] = np.inf
    rng = np.random.default_rng(0)
    depth[40:60, 10:16] = 7 + rng.random((20, 6))
    view = View.from_rgbd(RGBD(np.zeros((*CAMERA.hw, 3), np.uint8), depth, CAMERA)).without(GAP, HoleType.DISOCCLUDED)
    aside = moved(CAMERA, turn=(0, 90, 0))
    measured = (CAMERA, np.where(GAP, np.float32(bottom), depth)), (aside, np.full(aside.hw, np.inf, np.float32))
    surfaces, filled, _ = continue_lawfully(view, Law(measured, np.zeros(3, np.uint8)), seed=0)
    return surfaces.label[GAP], filled[GAP]


def test_between_two_houses_there_is_a_wall_and_no_sky() -> None:
    """Law: what the source saw 1 m behind both walls hides nothing nearer, so there is a surface there, not before it."""
    label, depth = two_houses(BOTTOM)
    assert (label == SMOOTH).all()
    np.testing.assert_allclose(depth, BOTTOM, rtol=2e-3)


@pytest.mark.parametrize("bottom", [np.inf, 2 * DEEPEST * WALL])
def test_sky_that_the_source_saw_in_the_gap_and_what_is_far_behind_stay_sky(bottom: float) -> None:
    """Law: nothing hides a far pixel; and closed form: farther back than DEEPEST times what surrounds it there is no surface."""
    assert (two_houses(bottom)[0] == SKY).all()


def test_a_gap_is_where_the_sky_alone_is_lawful() -> None:
    """Closed form, cell by cell: 4 m interpolated, 4.5 m seen; not where a plane is lawful or the sky is not."""
    camera = Camera.from_fov(4, 1, 60)
    law = Law(((camera, np.full((1, 4), 4.5, np.float32)),))
    allowed = np.zeros((3, 1, 4), bool)
    allowed[1] = [[True, True, True, False]]
    allowed[2] = [[False, True, False, False]]
    w, gap = surface_behind(camera, np.full((1, 4), 0.25, np.float32), np.ones((1, 4), bool), law, allowed)
    np.testing.assert_array_equal(gap, [[True, False, True, False]])
    np.testing.assert_allclose(1 / w, [[4.5, 4, 4.5, 4]], rtol=2e-3)
