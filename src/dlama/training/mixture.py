"""Several sources and their shares in -> one source out: each sample's kind is drawn by its own random numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dlama.training.sources import SampleSource


class Mixture:
    """See `sources.SampleSource`. As long as the longest of its sources; the others begin again."""

    def __init__(self, parts: Mapping[str, tuple[SampleSource, float]]) -> None:
        total = sum(share for _, share in parts.values())
        self.kinds = tuple(parts)
        self.sources = tuple(source for source, _ in parts.values())
        self.until = np.cumsum([share / total for _, share in parts.values()])
        self.run = max(int(getattr(source, "run", 1)) for source in self.sources)

    def __len__(self) -> int:
        return max(len(source) for source in self.sources)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample of one of the kinds."""
        number = self.drawn(rng)
        return self.sources[number].sample(index % len(self.sources[number]), rng)

    def drawn(self, rng: np.random.Generator) -> int:
        """Which source the next sample is of."""
        return min(int(np.searchsorted(self.until, rng.random(), "right")), len(self.sources) - 1)
