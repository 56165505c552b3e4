"""What stands out, by the network that ships: a red ball on a plain lawn (closed form), and a picture with nothing in it."""

from __future__ import annotations

import numpy as np

from dlama import find_mask


def test_a_ball_on_a_lawn_stands_out() -> None:
    rng = np.random.default_rng(0)
    v, u = np.mgrid[:200, :260]
    ball = (u - 120) ** 2 + (v - 110) ** 2 < 45**2
    color = np.where(ball[..., None], (210, 40, 30), (90, 150, 70)) + rng.integers(-8, 9, (200, 260, 3))
    found = find_mask(np.clip(color, 0, 255).astype(np.uint8), masker="salient")
    assert (found.mask & ball).sum() / (found.mask | ball).sum() > 0.9
    assert found.masker == "salient"
