"""The shadow's network: its contract, and closed forms of the planes that only it sees."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.models.network_file import shipped_network
from dlama.perception.shadows.crop import SIDE
from dlama.perception.shadows.planes import (
    LOG_SHARE,
    MULTIPLE,
    NETWORK,
    PLANES,
    ShadowPlanes,
    darkness_by_hue,
    network_planes,
    network_probability,
)

FLAT = np.zeros((len(PLANES), 96, 128), np.float32)
FLAT[4:6] = 1  # surface all over the picture
FLAT[3, 30:60, 50:70], FLAT[4, 30:60, 50:70] = 1, 0


def test_the_file_that_ships_fits_the_planes() -> None:
    """Contract: it takes the planes that are made, at sides that crops have, and gives one probability a pixel of the surface."""
    assert NETWORK.stat().st_size < 500_000 and SIDE % MULTIPLE == 0
    assert next(iter(shipped_network(NETWORK).inputs.values()))[1][1] == len(network_planes(ShadowPlanes(FLAT)))
    said = network_probability(ShadowPlanes(FLAT))
    assert said.shape == FLAT.shape[1:] and (said >= 0).all() and (said <= 1).all()
    assert not said[FLAT[4] < 0.5].any()


def test_how_common_colours_are() -> None:
    """Closed form: the shares of a surface of two colours are those of their pixels, and what is dark would be as common as the
    lit part if it was lit."""
    planes = FLAT.copy()
    planes[:3, 80:, 64:] = -0.45 / 2  # darker by one of the steps that lit partners are looked for at
    where = planes[4] > 0.5
    dark = planes[0][where] < -0.1
    share, raised, _ = (plane[where] for plane in network_planes(ShadowPlanes(planes))[len(PLANES) :])
    expected = np.log((~dark).sum() / dark.sum())
    assert LOG_SHARE * (share[~dark].mean() - share[dark].mean()) == pytest.approx(expected, abs=0.05)
    assert LOG_SHARE * raised[dark].mean() == pytest.approx(expected, abs=0.05)


def test_darkness_by_hue() -> None:
    """Closed form: a rug that is darker than the floor all over is not dark by its hue; a shadow over both is, by one step."""
    planes = FLAT.copy()
    planes[:3, :, :64] += np.array([-0.1, -0.4, -0.35], np.float32)[:, None, None]  # logarithms / 2
    shadow = np.zeros(FLAT.shape[1:], np.bool_)
    shadow[60:70, 20:110] = True
    planes[:3, shadow] -= 0.2
    found = darkness_by_hue(ShadowPlanes(planes))
    inner = np.zeros_like(shadow)
    inner[64:67] = shadow[64:67]
    rug, floor = np.arange(128) < 60, np.arange(128) > 70
    for side in (rug, floor):
        lit = (planes[4] > 0.5) & side & ~shadow
        lit[56:74] = False
        assert found[inner & side].mean() - found[lit].mean() == pytest.approx(0.4, abs=0.02)
        assert abs(found[lit].mean()) < 0.08
    assert not found[planes[4] < 0.5].any()
