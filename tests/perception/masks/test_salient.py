"""What stands out, by the network that ships: balls on a plain lawn (closed form), and a picture with nothing in it."""

from __future__ import annotations

import numpy as np
import pytest

from dlama import MaskError, MaskSession, find_mask
from dlama.geometry.holes import iou


def two_balls() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture with a red and a yellow ball on a lawn, and where each is."""
    rng = np.random.default_rng(0)
    v, u = np.mgrid[:200, :300]
    red, yellow = ((u - middle) ** 2 + (v - 110) ** 2 < 35**2 for middle in (80, 220))
    color = np.where(red[..., None], (210, 40, 30), (90, 150, 70))
    color = np.where(yellow[..., None], (240, 220, 40), color) + rng.integers(-8, 9, (200, 300, 3))
    return np.clip(color, 0, 255).astype(np.uint8), red, yellow


def test_clicks_choose_among_what_stands_out() -> None:
    """The clicked ball alone; without the ball that a pixel next to the object lies on; on the lawn nothing stands out."""
    color, red, yellow = two_balls()
    session = MaskSession(color, masker="salient")
    assert iou(session.find().mask, red | yellow) > 0.85 and session.find().masker == "salient"
    assert iou(session.find(clicks=[(80, 110)]).mask, red) > 0.85
    assert iou(session.find(not_clicks=[(80, 110)]).mask, yellow) > 0.85
    with pytest.raises(MaskError, match="clicks holds 150,20, where there is no salient object"):
        session.find(clicks=[(150, 20)])


def test_a_picture_of_one_colour_is_refused() -> None:
    """The network stretches what it says to 0..1, and would find something in nothing."""
    with pytest.raises(MaskError, match="nearly one colour"):
        find_mask(np.full((60, 80, 3), 90, np.uint8), masker="salient")
