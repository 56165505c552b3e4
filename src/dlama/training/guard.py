"""A training module whose numbers are good in -> a state in memory to go back to when they are not."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dlama.training.module import TrainingModule


class Guard:
    """Holds one good state: networks, moving average, optimisers. Counters and random numbers are not turned back."""

    def __init__(self) -> None:
        self._state: dict[str, Any] | None = None
        self.step = 0

    def keep(self, module: TrainingModule) -> None:
        """Copy the state as it is, on the device where it lies."""
        self._state = {
            "networks": {name: _copied(network.state_dict()) for name, network in module.networks.items()},
            "optimisers": [_copied(optimiser.state_dict()) for optimiser in module.raw_optimisers],
        }
        self.step = module.step

    def restore(self, module: TrainingModule) -> None:
        """Back to the state that was kept last."""
        assert self._state is not None  # `on_train_start` keeps the first
        for name, network in module.networks.items():
            network.load_state_dict(self._state["networks"][name])
        for optimiser, state in zip(module.raw_optimisers, self._state["optimisers"]):
            optimiser.load_state_dict(_copied(state))  # Adam would go on writing into the kept tensors


def _copied(state: dict[str, Any]) -> dict[str, Any]:
    return copy.deepcopy(dict(state))
