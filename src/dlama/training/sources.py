"""Settings and --data in -> where samples come from, out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from dlama.errors import InputError
from dlama.training.settings import TrainSettings

Split = Literal["train", "held_out"]


class SampleSource(Protocol):
    """Makes samples. Picklable, since it travels to worker processes; holds no state that a sample changes."""

    def __len__(self) -> int:
        """How many different indices there are (worlds, photos, frames)."""

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample, see `batches.Batch`: the same for the same index and the same state of `rng`, on any day."""


def source_for(settings: TrainSettings, data: Sequence[Path], split: Split) -> SampleSource:
    """The source of a run's samples; the held-out ones share no world, photo or frame with the trained ones.

    Raises:
        InputError: `data` names nothing that can be read, or the mixture needs files and there are none.
    """
    if set(settings.data.mixture) == {"sketch"}:
        from dlama.training.sketches import Sketches

        if data:
            raise InputError(f"data.mixture is only sketches, which need no files, but --data names {data[0]}")
        return Sketches(settings.network, settings.data.size, split)
    raise InputError(f"data.mixture {dict(settings.data.mixture)}: only sketches can be drawn yet")
