"""The state of torch's random numbers, which alone a step draws from, out, and back in."""

from __future__ import annotations

from typing import Any

import torch


def random_state() -> dict[str, Any]:
    """State of torch's random numbers, which alone a step draws from."""
    return {
        "torch": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state() if torch.cuda.is_available() else None,
    }


def set_random_state(state: dict[str, Any]) -> None:
    """Restore such a state."""
    torch.set_rng_state(state["torch"].cpu())
    if state["cuda"] is not None and torch.cuda.is_available():
        torch.cuda.set_rng_state(state["cuda"].cpu())
