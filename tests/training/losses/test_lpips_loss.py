"""The perceptual term that is the evaluation's own distance (`loss.trunk` lpips)."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")


from dlama.evaluation.metrics.lpips import distance, features  # noqa: E402
from dlama.training.losses.perceptual import perceptual_loss  # noqa: E402
from dlama.training.settings import LossSettings  # noqa: E402


def test_the_loss_is_the_measure() -> None:
    """Oracle: LPIPS as the evaluation runs it; and its gradient is finite where a picture equals the truth."""
    rng = np.random.default_rng(0)
    one, other = (rng.integers(0, 256, (64, 80, 3), np.uint8) for _ in range(2))
    mine, theirs = (torch.from_numpy(p.transpose(2, 0, 1)[None] / np.float32(255)) for p in (one, other))
    loss = perceptual_loss(LossSettings(trunk="lpips"))
    assert float(loss(mine, theirs)) == pytest.approx(distance(*map(features, (one, other))), rel=1e-3)
    same = theirs.clone().requires_grad_(True)
    loss(same, theirs).backward()
    assert torch.isfinite(same.grad).all()
