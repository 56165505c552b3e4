"""Metres from estimated depth (oracles: closed forms: the scale that was taken away comes back)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.projection import rays
from dlama.perception.depth_scale import Scale, estimate_scale

CAMERA = Camera.from_fov(96, 72, 80)
ROWS, COLUMNS = np.mgrid[:72, :96]
Z = (2 + 0.05 * COLUMNS + 0.11 * ROWS).astype(np.float32)


def known(*places: tuple[int, int]) -> list[tuple[float, float, float]]:
    """(x, y, true metres) of pixels."""
    return [(x + 0.5, y + 0.5, float(Z[y, x])) for x, y in places]


def test_factor_and_shift_of_relative_inverse_depth_come_back() -> None:
    """Closed form: 1 / z = factor * value + shift, from two pixels on, and from many with errors that cancel."""
    values = ((1 / Z - 0.02) / 0.7).astype(np.float32)
    for places in ([(5, 5), (90, 60)], [(5, 5), (90, 60), (50, 30), (10, 65)]):
        scale = estimate_scale(values, True, False, CAMERA, known(*places))
        assert (scale.factor, scale.shift) == (pytest.approx(0.7, rel=0.02), pytest.approx(0.02, abs=2e-3))
        np.testing.assert_allclose(scale.metres(values, None), Z, rtol=0.02)
        assert scale.rule == "metres_at" and len(scale.about["points"]) == len(places)


def test_a_known_distance_that_contradicts_the_others_is_named() -> None:
    """Closed form: of a metric map a factor fits alone; half the true distance of one pixel cannot be that of the others."""
    true = known((5, 5), (90, 60), (50, 30))
    (x, y, metres), values = known((10, 65))[0], Z / np.float32(0.4)
    with pytest.warns(
        UserWarning, match=rf"`metres_at` 10\.5,65\.5={metres / 2:g}: the depth fitted there is .*look the pixel up"
    ):
        estimate_scale(values, False, True, CAMERA, [*true, (x, y, metres / 2)])
    estimate_scale(values, False, True, CAMERA, true)  # without a word


def test_two_known_distances_that_make_most_of_the_picture_sky_are_named() -> None:
    """Closed form: 1 / z = factor * value + shift through two pixels, the farther one given four times as far; the share is that
    of the picture where that is below 1/1000. True distances get no word."""
    places = known((5, 5), (30, 5))
    near, far = sorted(places, key=lambda place: place[2])
    with pytest.warns(
        UserWarning, match=r"`metres_at` puts \d+% of the picture beyond 1000 m.*or give one alone"
    ) as caught:
        scale = estimate_scale((1 / Z).astype(np.float32), True, False, CAMERA, [near, (*far[:2], 4 * far[2])])
    lost = np.isinf(scale.metres((1 / Z).astype(np.float32), None)).mean()
    assert lost > 0.5 and f"puts {lost:.0%} of" in str(caught[0].message)
    estimate_scale((1 / Z).astype(np.float32), True, False, CAMERA, places)


@pytest.mark.parametrize(("inverse", "metric"), [(True, False), (True, True), (False, False), (False, True)])
def test_one_known_distance_gives_the_factor(inverse: bool, metric: bool) -> None:
    """Closed form: all that is known up to a factor; metric depth is corrected, too. Two equal distances say no more than one."""
    values = (0.4 / Z if inverse else Z / 0.4).astype(np.float32)
    for places in ([(50, 30)], [(50, 30), (51, 30)]):
        scale = estimate_scale(values, inverse, metric, CAMERA, known(*places))
        assert scale.shift == 0
        np.testing.assert_allclose(scale.metres(values, None), Z, rtol=0.01)


@pytest.mark.parametrize("inverse", [True, False])
@pytest.mark.parametrize("tilt", [0, 20])
def test_the_height_of_the_camera_gives_the_factor(inverse: bool, tilt: float) -> None:
    """Closed form: ground 1.6 m below a camera that looks down by `tilt`, a wall behind it, noise of 1 %; cm are warned of."""
    turn = np.radians(tilt)
    down = rays(CAMERA)[..., 1] * np.cos(turn) + rays(CAMERA)[..., 2] * np.sin(turn)
    ground = np.divide(1.6, down, out=np.full(down.shape, np.inf), where=down > 1e-6)
    truth = np.minimum(ground, 9 / rays(CAMERA)[..., 2]).astype(np.float32)
    noisy = truth * np.random.default_rng(2).normal(1, 0.01, truth.shape)
    values = (0.3 / noisy if inverse else noisy / 0.3).astype(np.float32)
    scale = estimate_scale(values, inverse, False, CAMERA, camera_height=1.6)
    np.testing.assert_allclose(np.median(scale.metres(values, None) / truth), 1, atol=0.03)
    assert scale.about["ground_tilt_deg"] == pytest.approx(tilt, abs=2)
    with pytest.warns(UserWarning, match=r"camera_height. is 160 m .* centimetres, give .camera_height=1\.6"):
        estimate_scale(values, inverse, False, CAMERA, camera_height=160)


def test_a_wall_is_no_ground() -> None:
    """Law: a plane that stands upright gives no height."""
    wall = np.full((72, 96), 4, np.float32)
    with pytest.raises(InputError, match=r"no ground is seen.*give metres_at"):
        estimate_scale(wall, False, False, CAMERA, camera_height=1.6)


def test_beyond_a_kilometre_is_far() -> None:
    """Closed form: inverse depth that the fit puts at 0 or below, and depth beyond 1000 m; and what the network calls sky."""
    values = np.float32([[0, 0.1, 0.2, 1]])
    np.testing.assert_allclose(Scale(True, 1, -0.1).metres(values, None), [[np.inf, np.inf, 10, 1 / 0.9]], rtol=1e-5)
    sky = np.array([[False, False, False, True]])
    np.testing.assert_array_equal(Scale(False, 1e4).metres(values, sky), [[0, np.inf, np.inf, np.inf]])


def test_metric_values_are_not_touched() -> None:
    """Law: bit for bit."""
    np.testing.assert_array_equal(estimate_scale(Z, False, True, CAMERA).metres(Z, None), Z)
