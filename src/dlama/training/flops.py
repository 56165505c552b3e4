"""Settings in -> parameters and FLOP of the networks, and an ESTIMATE of samples/s on a data-centre GPU, out; needs no torch.

The estimate: samples/s = share of the peak rate x nominal peak rate / FLOP per sample of a step, and at most what the processes
that make samples deliver. `benchmarks/step_cost.py` counts the FLOP of real steps, `benchmarks/samples.py` times sample making.
A multiply-add is two FLOP.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dlama.errors import InputError
from dlama.nets.architecture import (
    JUDGE_STRIDE,
    DiscriminatorSettings,
    GeneratorSettings,
    JudgeSettings,
    discriminator_shapes,
    generator_shapes,
    judge_shapes,
)
from dlama.training.kinds import SAMPLES
from dlama.training.settings import TrainSettings

FFT_FLOP = 2.5
"""Times n log2 n: a real transform of n numbers, as FFT benchmarks count it (fftw.org/speed/method.html)."""
TRAINED = 3
"""Forward and backward pass over the forward pass alone."""
GPU_FLOP = 990e12
"""Per second: dense bf16 of an H100-class GPU, as its data sheet has it; no network reaches it."""
GPU_SHARE = (0.10, 0.20)
"""Reached share of it, ASSUMED: small convolutions, batch norms and transforms keep a GPU waiting for its memory. On a CPU the
same steps reach 21 % to 37 % of a matrix product (`python benchmarks/training.py`)."""
CORES = 15
"""Cores that make samples for a GPU: 16 less the one that trains."""
MEASURED_SIZE = 256
"""Pixels of the sides of samples that `SampleKind.per_core` was measured at; other sizes are scaled by their pixels."""
TRUNK_STRIDES = (1, 2, 2, 1, 1, 1, 1)
"""Strides of the convolutions of `losses.trunks.random_trunk`."""


@dataclass(frozen=True)
class NetworkCost:
    """Parameters and FLOP of a generator and its discriminator for one picture of `side` x `side` pixels, forward."""

    parameters: int
    """Trained numbers of the generator."""
    discriminator_parameters: int
    """Trained numbers of the discriminator."""
    flop: float
    """FLOP of the generator."""
    discriminator_flop: float
    """FLOP of the discriminator."""
    side: int
    """Height and width in pixels."""

    def __str__(self) -> str:
        return (
            f"{self.parameters / 1e6:.2f} M parameters, {self.flop / 1e9:.1f} GFLOP at {self.side}x{self.side} "
            f"(discriminator {self.discriminator_parameters / 1e6:.2f} M, {self.discriminator_flop / 1e9:.1f} GFLOP)"
        )

    @property
    def flop_per_sample(self) -> float:
        """FLOP of a training step by both networks, without trunk and penalty.

        The generator forward and back; the discriminator forward and back at real and output for its own step, and once
        forward and back for the generator's.
        """
        return TRAINED * self.flop + (2 * TRAINED + TRAINED) * self.discriminator_flop


def network_cost(settings: TrainSettings, side: int | None = None) -> NetworkCost:
    """The cost of a run's networks at `side` x `side` pixels (default: those it is trained at)."""
    size = side or settings.data.size
    if settings.network.kind.guesses:
        judge = settings.network.judge
        flop = judge_flop(judge, settings.network.kind.guesses, size, size)
        return NetworkCost(parameters(judge_shapes(judge)), 0, flop, 0.0, size)
    generator, discriminator = settings.network.generator, settings.network.discriminator
    return NetworkCost(
        parameters(generator_shapes(generator)),
        parameters(discriminator_shapes(discriminator)),
        generator_flop(generator, size, size),
        discriminator_flop(discriminator, size, size),
        size,
    )


def parameters(shapes: dict[str, tuple[int, ...]]) -> int:
    """Number of trained parameters of tensors by name; running statistics of batch norms are not trained."""
    return sum(math.prod(shape) for name, shape in shapes.items() if name.endswith(("weight", "bias")))


def generator_flop(s: GeneratorSettings, height: int, width: int) -> float:
    """FLOP of convolutions and transforms for one picture, forward; norms and activations (about 1 %) are left out."""
    pixels = height * width
    total = _conv(s.in_channels, s.width, 7, pixels) + _conv(s.width, s.out_channels, 7, pixels)
    for level in range(s.downsamplings):
        below = pixels / 4 ** (level + 1)
        total += 2 * _conv(s.channels_at(level), s.channels_at(level + 1), 3, below)  # down, and up again
    coarse = (height // s.multiple, width // s.multiple)
    return total + 2 * s.blocks * _ffc(s.local_channels, s.global_channels, *coarse)


def judge_flop(s: JudgeSettings, guesses: int, height: int, width: int) -> float:
    """FLOP of the judge's convolutions for one picture with so many guesses, forward."""
    total = 0.0
    for name, shape in judge_shapes(s).items():
        if name.endswith("weight"):
            middle = name.startswith(("trunk.down1", "trunk.block1", "trunk.blend1", "trunk.up2"))
            coarse = name.startswith(("trunk.down2", "trunk.block2", "trunk.block3", "trunk.up1"))
            side = JUDGE_STRIDE * (2 if middle else 4 if coarse else 1)
            shared = name.startswith(("trunk", "of_context", "errors")) or ".shared" in name
            total += 2.0 * math.prod(shape) * (height // side) * (width // side) * (1 if shared else guesses)
    return total


def discriminator_flop(s: DiscriminatorSettings, height: int, width: int) -> float:
    """FLOP for one picture, forward."""
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


@dataclass(frozen=True)
class Estimate:
    """Samples per second, none of them measured on a GPU."""

    flop: float
    """FLOP per sample of a step."""
    slow: float
    """Samples/s by arithmetic at the lower end of GPU_SHARE."""
    fast: float
    """The same at the upper end."""
    made: float
    """Samples/s that CORES processes make."""

    @property
    def samples_per_second(self) -> tuple[float, float]:
        """Lower and upper bound: the slower of training and sample making."""
        return min(self.slow, self.made), min(self.fast, self.made)

    def __str__(self) -> str:
        low, high = self.samples_per_second
        span = f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"
        limit = "by making samples" if self.made <= self.slow else "by arithmetic"
        return (
            f"{span} (ESTIMATE, not measured: {self.flop / 1e9:.0f} GFLOP per sample and step on a GPU of "
            f"{GPU_FLOP / 1e12:.0f} TFLOP/s bf16 at {GPU_SHARE[0]:.0%} to {GPU_SHARE[1]:.0%}: {self.slow:.0f} to "
            f"{self.fast:.0f}; {CORES} cores make {self.made:.0f}; limited {limit})"
        )


def estimate(settings: TrainSettings) -> Estimate:
    """Of one GPU with CORES cores and the random trunk. InputError for kinds of samples that were not timed."""
    flop, untimed = (
        step_flop(settings),
        [kind for kind in sorted(settings.data.mixture) if SAMPLES[kind].per_core is None],
    )
    if untimed:
        raise InputError(f"data.mixture has {', '.join(untimed)}, whose samples per second were not measured")
    total = sum(settings.data.mixture.values())
    per_sample = sum(share / total / (SAMPLES[kind].per_core or 1) for kind, share in settings.data.mixture.items())
    pixels = (settings.data.size / MEASURED_SIZE) ** 2
    slow, fast = (share * GPU_FLOP / flop for share in GPU_SHARE)
    return Estimate(flop, slow, fast, CORES / (per_sample * pixels))


def step_flop(settings: TrainSettings) -> float:
    """FLOP of one sample of a training step: both networks, the random trunk, R1 and the transforms.

    Trunk: forward at truth and output, back to the output. R1: the gradient at the truth, and twice as much to differentiate it.
    """
    cost, loss = network_cost(settings), settings.loss
    trunk = 3 * settings.network.views * trunk_flop(loss.trunk_width, settings.data.size) if loss.perceptual else 0.0
    penalty = TRAINED * cost.discriminator_flop / loss.penalty_every if loss.gradient_penalty else 0.0
    return cost.flop_per_sample + trunk + penalty


def fourier_flop(settings: TrainSettings) -> float:
    """The part of `step_flop` that is Fourier transforms: forward and back, two for each Fourier unit."""
    s, size = settings.network.generator, settings.data.size
    pixels = (size // s.multiple) ** 2
    return TRAINED * 2 * s.blocks * 2 * (s.global_channels // 2) * FFT_FLOP * pixels * math.log2(pixels)


def trunk_flop(width: int, size: int) -> float:
    """FLOP of the random trunk for one picture of size x size pixels, forward; width: channels of its first layer."""
    widths = (3, width, 2 * width, 2 * width, *4 * (4 * width,))
    total, side = 0.0, float(size)
    for before, after, stride in zip(widths, widths[1:], TRUNK_STRIDES):
        side /= stride
        total += 2.0 * 9 * before * after * side * side
    return total
