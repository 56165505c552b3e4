"""Settings in -> FLOP of a training step, and an ESTIMATE of samples/s on a data-centre GPU, out; no torch.

The formula: samples/s = share of the rate x nominal rate / FLOP per sample of a step; and no more than the processes that make
samples make. `benchmarks/step_cost.py` counts the FLOP, `benchmarks/samples.py` times the making.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dlama.errors import InputError
from dlama.training.flops import FFT_FLOP, TRAINED, budget
from dlama.training.settings import TrainSettings

GPU_FLOP = 990e12
"""Per second: dense bf16 of an H100-class GPU, as its data sheet has it; no network reaches it."""
GPU_SHARE = (0.10, 0.20)
"""Of that, ASSUMED: small convolutions, batch norms and transforms keep a GPU waiting for its memory. On a CPU the same steps
reach 21 % to 37 % of a matrix product (docs/training.md)."""
CORES = 15
"""That make samples beside it: of 16, less the one that trains."""
MADE_PER_CORE = {"world": 17.0, "removal": 19.0, "stereo": 17.0}
"""Samples/s of 256 x 256 pixels that one EPYC core makes of one kind: MEASURED, worlds with photos on them, indices in runs
(`benchmarks/samples.py`). Other sizes are reckoned by their pixels, which is too little for larger ones."""
MEASURED_SIZE = 256
TRUNK_STRIDES = (1, 2, 2, 1, 1, 1, 1)
"""Of the random trunk's convolutions, see `trunks.random_trunk`."""


@dataclass(frozen=True)
class Estimate:
    """Samples per second, none of them measured on a GPU."""

    flop: float
    """Per sample of a step."""
    slow: float
    """By arithmetic, at the lower share of GPU_SHARE."""
    fast: float
    made: float
    """That CORES processes make."""

    @property
    def reached(self) -> tuple[float, float]:
        """From, to: what the slower of training and making allows."""
        return min(self.slow, self.made), min(self.fast, self.made)

    def __str__(self) -> str:
        low, high = self.reached
        span = f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"
        limit = "by making samples" if self.made <= self.slow else "by arithmetic"
        return (
            f"{span} (ESTIMATE, not measured: {self.flop / 1e9:.0f} GFLOP per sample and step on a GPU of "
            f"{GPU_FLOP / 1e12:.0f} TFLOP/s bf16 at {GPU_SHARE[0]:.0%} to {GPU_SHARE[1]:.0%}: {self.slow:.0f} to "
            f"{self.fast:.0f}; {CORES} cores make {self.made:.0f}; limited {limit})"
        )


def estimate(settings: TrainSettings) -> Estimate:
    """Of one GPU with CORES cores beside it and the random trunk. InputError for kinds of samples nobody has timed."""
    flop, untimed = step_flop(settings), set(settings.data.mixture) - set(MADE_PER_CORE)
    if untimed:
        raise InputError(
            f"data.mixture has {', '.join(sorted(untimed))}; known is how fast {', '.join(MADE_PER_CORE)} are made"
        )
    total = sum(settings.data.mixture.values())
    per_sample = sum(share / total / MADE_PER_CORE[kind] for kind, share in settings.data.mixture.items())
    pixels = (settings.data.size / MEASURED_SIZE) ** 2
    slow, fast = (share * GPU_FLOP / flop for share in GPU_SHARE)
    return Estimate(flop, slow, fast, CORES / (per_sample * pixels))


def step_flop(settings: TrainSettings) -> float:
    """FLOP of one sample of a training step: both networks, the random trunk, R1 and the transforms.

    Trunk: forward at truth and output, back to the output. R1: the gradient at the truth, and twice as much to differentiate it.
    """
    cost, loss = budget(settings), settings.loss
    trunk = 3 * settings.network.views * trunk_flop(loss.trunk_width, settings.data.size) if loss.perceptual else 0.0
    penalty = TRAINED * cost.discriminator_flop / loss.penalty_every if loss.gradient_penalty else 0.0
    return cost.flop_per_sample + trunk + penalty


def fourier_flop(settings: TrainSettings) -> float:
    """Of those, the transforms': forward and back, two for each Fourier unit."""
    s, size = settings.network.generator, settings.data.size
    pixels = (size // s.multiple) ** 2
    return TRAINED * 2 * s.blocks * 2 * (s.global_channels // 2) * FFT_FLOP * pixels * math.log2(pixels)


def trunk_flop(width: int, size: int) -> float:
    """The random trunk at one picture, forward."""
    widths = (3, width, 2 * width, 2 * width, *4 * (4 * width,))
    total, side = 0.0, float(size)
    for before, after, stride in zip(widths, widths[1:], TRUNK_STRIDES):
        side /= stride
        total += 2.0 * 9 * before * after * side * side
    return total
