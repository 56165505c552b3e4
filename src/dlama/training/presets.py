"""A preset's name in -> settings, and what to expect of them, out. `training.budget` counts parameters and FLOP."""

from __future__ import annotations

from dataclasses import dataclass, replace

from dlama.training.estimate import estimate
from dlama.training.settings import (
    DataSettings,
    LoopSettings,
    LossSettings,
    NetworkSettings,
    OptimiserSettings,
    TrainSettings,
)


@dataclass(frozen=True)
class Preset:
    """A run somebody has thought about."""

    what: str
    """What it is for."""
    settings: TrainSettings
    samples_per_second: str
    """Training speed, where and how it was measured; or an estimate, which says so and how it was reckoned."""


MINI = "3 per core in fp32, 5 in bf16 (CPU time of one EPYC core with AVX-512 bf16; a core for making samples comes on top)"
BIG_SCREEN = DataSettings(size=512, held_out=32)
FINISH = OptimiserSettings(warm_up=200, decay="cosine")


def _tiny() -> TrainSettings:
    network = NetworkSettings("rgbd", width=8, blocks=1, downsamplings=2, discriminator_width=8, discriminator_layers=2)
    rhythm = LoopSettings(log_every=5, validate_every=20, sheet_every=20, checkpoint_every=20, guard_every=10)
    return TrainSettings(
        "tiny",
        network=network,
        loss=LossSettings(trunk="random", trunk_width=8),
        optimiser=OptimiserSettings(average=0.9),
        data=DataSettings(size=64, mixture={"sketch": 1.0}, held_out=4, workers=0),
        loop=replace(rhythm, steps=40, batch=4, accelerator="cpu"),
    )


def _mini(planes: str, kind: str) -> TrainSettings:
    rhythm = LoopSettings(log_every=10, validate_every=100, sheet_every=200, checkpoint_every=200)
    network = NetworkSettings(
        planes,  # type: ignore[arg-type]
        width=16,
        blocks=4,
        discriminator_width=16,
        discriminator_layers=3,
    )
    return TrainSettings(
        f"mini-{planes}",
        network=network,
        loss=LossSettings(trunk_width=16, penalty_every=4),
        optimiser=OptimiserSettings(warm_up=50, decay="cosine", average=0.99),
        data=DataSettings(size=256, mixture={kind: 1.0}, held_out=16),
        loop=replace(rhythm, steps=1000, batch=8, accelerator="cpu"),
    )


def _small(planes: str, kind: str) -> TrainSettings:
    return TrainSettings(
        f"small-{planes}",
        network=NetworkSettings(planes),  # type: ignore[arg-type]
        loss=LossSettings(penalty_every=4),
        optimiser=FINISH,
        data=DataSettings(size=256, mixture={kind: 1.0}, held_out=32),
        loop=LoopSettings(steps=20_000, batch=32, precision="bf16"),
    )


def _big() -> TrainSettings:
    return TrainSettings(
        "big-rgbd",
        network=NetworkSettings("rgbd", width=64, blocks=18),
        optimiser=FINISH,
        data=BIG_SCREEN,
        loop=LoopSettings(steps=300_000, batch=8, precision="bf16"),
    )


def _on_a_gpu(what: str, settings: TrainSettings) -> Preset:
    """Nobody has timed it there."""
    return Preset(what, settings, str(estimate(settings)))


PRESETS: dict[str, Preset] = {
    "tiny": Preset("one minute on a CPU: does the whole loop work?", _tiny(), "60 on one EPYC core"),
    "mini-rgbd": Preset("colour and depth, on a CPU", _mini("rgbd", "world"), MINI),
    "mini-stereo": Preset("both pictures of a pair, on a CPU", _mini("stereo", "stereo"), MINI),
    "small-rgbd": _on_a_gpu("colour and depth, on one GPU", _small("rgbd", "world")),
    "small-stereo": _on_a_gpu("both pictures of a pair, on one GPU", _small("stereo", "stereo")),
    "big-rgbd": _on_a_gpu("colour and depth in big-lama's shape; start from its weights", _big()),
}
"""In the order of their size."""
