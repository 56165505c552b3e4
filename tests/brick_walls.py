"""A wall whose bricks repeat: what patches must continue."""

from __future__ import annotations

import numpy as np

ROWS, COLUMNS = np.indices((96, 128))


def brick_wall() -> np.ndarray:
    """Bricks of 16 x 8 px with joints, every other row half a brick aside, each with its grain."""
    aside = 8 * (ROWS // 8 % 2)
    joint = (ROWS % 8 < 2) | ((COLUMNS + aside) % 16 < 2)
    grain = np.tile(np.random.default_rng(1).normal(0, 6, (16, 16)), (6, 8))
    wall = np.where(joint[..., None], (200, 200, 190), (150, 70, 50)) + grain[..., None]
    return np.clip(wall, 0, 255).astype(np.uint8)
