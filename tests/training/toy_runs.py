"""Runs that take a second or two: settings, a source of four samples, and a source that spoils one batch."""

from __future__ import annotations

import csv
import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dlama.training.data.samples import world_views
from dlama.training.data.sources import SampleSource, source_for
from dlama.training.loop.run_files import METRICS
from dlama.training.settings import (
    DataSettings,
    LoopSettings,
    LossSettings,
    NetworkSettings,
    OptimiserSettings,
    TrainSettings,
)


def toy(planes: str = "rgbd", size: int = 32, **loop: object) -> TrainSettings:
    """The smallest network of those planes; `loop` changes the loop's settings."""
    network = NetworkSettings(planes, width=8, blocks=1, downsamplings=2, discriminator_width=8, discriminator_layers=2)
    quiet = LoopSettings(
        steps=4, batch=2, accelerator="cpu", log_every=1, validate_every=2, sheet_every=100, checkpoint_every=100
    )
    return TrainSettings(
        "toy",
        network=network,
        loss=LossSettings(trunk_width=4),
        optimiser=OptimiserSettings(average=0.9),
        data=DataSettings(size=size, mixture={kind_for(network): 1.0}, held_out=2, workers=0),
        loop=replace(quiet, **loop),
    )


def samples_of(planes: str, size: int = 64, cases: float = 0.5, **mixture: float) -> TrainSettings:
    """Settings with these shares of samples by kind."""
    data = DataSettings(size=size, mixture=mixture, cases=cases)
    return TrainSettings("t", network=NetworkSettings(planes), data=data)


def kind_for(network: NetworkSettings) -> str:
    """Samples of worlds with an object removed, for such a network."""
    return "stereo" if network.kind.views == 2 else "removal"


def world_source(network: NetworkSettings, size: int, split: Literal["train", "held_out"] = "train") -> SampleSource:
    """The samples of a run on worlds alone."""
    return source_for(samples_of(network.planes, size, **{kind_for(network): 1.0}), [], split)


def read_metrics(run: Path) -> list[dict[str, float]]:
    """The rows of a run's metrics.csv, empty cells left out."""
    with (run / METRICS).open(newline="") as stream:
        return [{name: float(text) for name, text in row.items() if name and text} for row in csv.DictReader(stream)]


def keep_worlds() -> None:
    """More of them than usual, in this process."""
    world_views._world_views = functools.lru_cache(maxsize=24)(world_views._world_views.__wrapped__)


class Four:
    """The same four samples again and again; whatever is held out, it is these."""

    def __init__(self, network: NetworkSettings, size: int) -> None:
        source = world_source(network, size)
        self.made = [source.sample(i, np.random.default_rng(i)) for i in range(4)]

    def __len__(self) -> int:
        return len(self.made)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One of them."""
        return self.made[index]


class Spoiled(Four):
    """Samples whose target is NaN in some calls."""

    def __init__(self, settings: TrainSettings, calls: set[int]) -> None:
        super().__init__(settings.network, settings.data.size)
        self.calls, self.count = calls, 0

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Counts its calls, which `dlama.training` never promises: for a run without workers only."""
        made = dict(super().sample(index, rng))
        if self.count in self.calls:
            made["target"] = made["target"] * np.float32(np.nan)
        self.count += 1
        return made


class Exploit:
    """Makes a file when an ordinary unpickler meets it."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.marker,)


def keep_statistics(train: Callable[..., Any]) -> Callable[..., Any]:
    """A module's method `train` with batch norms in eval mode after it: two processes have no other means than one."""

    def train_but_norms(self: Any, mode: bool = True) -> Any:
        train(self, mode)
        for part in self.modules():
            if hasattr(part, "running_mean"):
                part.eval()
        return self

    return train_but_norms
