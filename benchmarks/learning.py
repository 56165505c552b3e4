"""Parameters of a torch network and what computes its loss in; a step each time the next loss is asked for: how all networks of
these scripts learn that have no opponent."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from torch import Tensor, nn, optim


def learn(
    parameters: Iterable[nn.Parameter], loss_of_step: Callable[[], Tensor], steps: int, rate: float, warm: int = 1,
    decay: float = 1e-2, clip: float = np.inf,
) -> Iterator[float]:  # fmt: skip
    """The loss of each step, by AdamW: the rate rises over the first `warm` steps and falls by half a cosine to 0.

    decay: of the weights, times the rate. clip: gradients of a larger norm are shortened to it.
    """
    learnt = list(parameters)
    optimiser = optim.AdamW(learnt, rate, weight_decay=decay)
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1, (step + 1) / warm) * 0.5 * (1 + np.cos(np.pi * step / steps))
        loss = loss_of_step()
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(learnt, clip)
        optimiser.step()
        yield float(loss.detach())
