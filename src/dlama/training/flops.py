"""Settings in -> parameters and FLOP of the networks, counted; no torch."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dlama.nets.architecture import (
    DiscriminatorSettings,
    GeneratorSettings,
    discriminator_shapes,
    generator_shapes,
)
from dlama.training.settings import TrainSettings

FFT_FLOP = 2.5
"""Times n log2 n: a real transform of n numbers, as FFT benchmarks count it (fftw.org/speed/method.html)."""
TRAINED = 3
"""A backward pass costs twice its forward pass."""


@dataclass(frozen=True)
class Budget:
    """What a network costs. A multiply-add is two FLOP."""

    parameters: int
    """Of the generator."""
    discriminator_parameters: int
    flop: float
    """Of the generator, one picture of `side` x `side` pixels, forward."""
    discriminator_flop: float
    side: int

    def __str__(self) -> str:
        return (
            f"{self.parameters / 1e6:.2f} M parameters, {self.flop / 1e9:.1f} GFLOP at {self.side}x{self.side} "
            f"(discriminator {self.discriminator_parameters / 1e6:.2f} M, {self.discriminator_flop / 1e9:.1f} GFLOP)"
        )

    @property
    def flop_per_sample(self) -> float:
        """Of a training step, by both networks, the trunk not counted.

        The generator forward and back; the discriminator forward and back at real and output for its own step, and once
        forward and back for the generator's; the penalty costs another pass or two, and is not counted either.
        """
        return TRAINED * self.flop + (2 * TRAINED + TRAINED) * self.discriminator_flop


def budget(settings: TrainSettings, side: int | None = None) -> Budget:
    """The cost of a run's networks at `side` x `side` pixels (default: those it is trained at)."""
    size = side or settings.data.size
    generator, judge = settings.network.generator, settings.network.discriminator
    return Budget(
        parameters(generator_shapes(generator)),
        parameters(discriminator_shapes(judge)),
        generator_flop(generator, size, size),
        discriminator_flop(judge, size, size),
        size,
    )


def parameters(shapes: dict[str, tuple[int, ...]]) -> int:
    """Trained numbers among those tensors; batch norms' statistics are not."""
    return sum(math.prod(shape) for name, shape in shapes.items() if name.endswith(("weight", "bias")))


def generator_flop(s: GeneratorSettings, height: int, width: int) -> float:
    """Convolutions and transforms of one picture, forward; norms and activations (about 1 %) are left out."""
    pixels = height * width
    total = _conv(s.in_channels, s.width, 7, pixels) + _conv(s.width, s.out_channels, 7, pixels)
    for level in range(s.downsamplings):
        below = pixels / 4 ** (level + 1)
        total += 2 * _conv(s.channels_at(level), s.channels_at(level + 1), 3, below)  # down, and up again
    coarse = (height // s.multiple, width // s.multiple)
    return total + 2 * s.blocks * _ffc(s.local_channels, s.global_channels, *coarse)


def discriminator_flop(s: DiscriminatorSettings, height: int, width: int) -> float:
    """One picture, forward."""
    total, before = 0.0, s.in_channels
    for layer in range(s.layers + 1):
        stride = 1 if layer == s.layers else 2
        height, width = height // stride + 1, width // stride + 1
        total += _conv(before, s.channels_at(layer), 4, height * width)
        before = s.channels_at(layer)
    return total + _conv(before, 1, 4, (height + 1) * (width + 1))


def _ffc(local: int, wide: int, height: int, width: int) -> float:
    """One layer of a residual block: three 3x3 paths and the spectral transform."""
    pixels, half, half_plane = height * width, wide // 2, height * (width // 2 + 1)
    paths = _conv(local, local, 3, pixels) + 2 * _conv(local, wide, 3, pixels)
    ends = _conv(wide, half, 1, pixels) + _conv(half, wide, 1, pixels)
    transforms = 2 * half * FFT_FLOP * pixels * math.log2(pixels)
    return paths + ends + transforms + _conv(2 * half, 2 * half, 1, half_plane)


def _conv(planes_in: int, planes_out: int, kernel: int, pixels: float) -> float:
    return 2.0 * kernel * kernel * planes_in * planes_out * pixels
