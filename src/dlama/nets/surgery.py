"""Trained weights in -> the same network with more planes in and out, which at step 0 fills colour exactly as before.

The way from the published 4 -> 3 network to 5 -> 4 (colour, depth, mask) and 7 -> 6 (two colours, mask): new input
planes get zero weights, new output planes get zero weights and bias, so a sigmoid says 0.5 there. Gradients reach
both from the first step on.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dlama.errors import ShapeError
from dlama.nets.architecture import STEM, settings_from_state


def widen(state: Mapping[str, np.ndarray], in_channels: int, out_channels: int) -> dict[str, np.ndarray]:
    """The generator with that many planes; colour stays first and the mask stays the last input plane.

    Args:
        state: published name -> array, one whole generator.
        in_channels: expected input planes, the mask counted; not fewer than there are.
        out_channels: expected output planes; not fewer than there are.
    Raises:
        ShapeError: fewer planes expected than there are, or the state is no generator.
    """
    settings = settings_from_state({name: array.shape for name, array in state.items()})
    more_in, more_out = in_channels - settings.in_channels, out_channels - settings.out_channels
    if more_in < 0 or more_out < 0:
        had = f"{settings.in_channels} -> {settings.out_channels}"
        raise ShapeError(f"surgery: {had} planes cannot become {in_channels} -> {out_channels}: planes are only added")
    stem, head = state[STEM], f"model.{settings.head_index}"
    new_planes = np.zeros((stem.shape[0], more_in, *stem.shape[2:]), stem.dtype)
    widened = {name: array.copy() for name, array in state.items()}
    widened[STEM] = np.concatenate([stem[:, :-1], new_planes, stem[:, -1:]], axis=1)
    for name in (f"{head}.weight", f"{head}.bias"):
        old = state[name]
        widened[name] = np.concatenate([old, np.zeros((more_out, *old.shape[1:]), old.dtype)])
    return widened
