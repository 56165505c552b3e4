"""Numbers in -> the settings of a training run, checked, out; needs no torch.

Defaults are those of Suvorov et al. 2022 where the paper has them (equations 5 to 9). Contradictions raise InputError.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from dlama.arguments import check_word
from dlama.errors import InputError
from dlama.nets.architecture import DiscriminatorSettings, GeneratorSettings, generator_shapes
from dlama.training.kinds import PLANES, SAMPLES, Planes, PlanesKind


@dataclass(frozen=True)
class NetworkSettings:
    """Planes and sizes of the generator and the discriminator."""

    planes: Planes = "rgbd"
    """rgb: 4 -> 3; rgbd: 5 -> 4 (colour, depth, mask last); stereo: 7 -> 6 (left, right, one mask, the union of both);
    stereo-two-masks: 8 -> 6 (left, right, left mask, right mask)."""
    width: int = 32
    """Generator's channels after the stem (ngf)."""
    blocks: int = 6
    """Its FFC residual blocks."""
    downsamplings: int = 3
    """Its halvings of height and width."""
    global_ratio: float = 0.75
    """Share of its blocks' channels that travel the Fourier branch."""
    discriminator_width: int = 64
    """Discriminator's channels after the first layer (ndf)."""
    discriminator_layers: int = 4
    """Its layers with stride 2."""
    start: str | None = None
    """A LaMa checkpoint or safetensors file to start from: planes it lacks are added with zero weights, so that at step
    0 colour is filled as before. Width, blocks and the rest must be its own."""

    def __post_init__(self) -> None:
        check_word(self.planes, "network.planes", PLANES)
        _ = self.generator, self.discriminator  # raises ShapeError on impossible sizes

    @property
    def kind(self) -> PlanesKind:
        """The entry of `planes` in the table of kinds."""
        return PLANES[self.planes]

    @property
    def generator(self) -> GeneratorSettings:
        """The architecture as `dlama.nets` takes it."""
        planes_in, planes_out = self.kind.inputs, self.kind.outputs
        return GeneratorSettings(planes_in, planes_out, self.width, self.downsamplings, self.blocks, self.global_ratio)

    @property
    def discriminator(self) -> DiscriminatorSettings:
        """The architecture as `dlama.nets` takes it; its input are all planes of the output together."""
        return DiscriminatorSettings(self.kind.outputs, self.discriminator_width, self.discriminator_layers)

    @property
    def parameters(self) -> int:
        """How many trained numbers the network that is exported has; running statistics of batch norms are not trained."""
        shapes = generator_shapes(self.generator).items()
        return sum(math.prod(shape) for name, shape in shapes if name.endswith(("weight", "bias")))


@dataclass(frozen=True)
class LossSettings:
    """Weights of the terms; a term of weight 0 is not computed."""

    adversarial: float = 10.0
    """Kappa of equation 9: softplus(-D(output)), equation 7."""
    perceptual: float = 30.0
    """Alpha of equation 9: equation 5, the mean over layers of mean squared differences of the trunk's activations. (The
    published code adds its four layers up instead: its 30 would be 120 here.)"""
    feature_matching: float = 100.0
    """Beta of equation 9: the same of the discriminator's activations."""
    gradient_penalty: float = 0.001
    """Gamma of equation 9: R1, the squared norm of D's gradient at real pictures."""
    penalty_every: int = 1
    """R1 on every n-th step only, n times as strong: it costs a second backward pass."""
    l1_known: float = 10.0
    """Absolute difference of colour where it was known."""
    l1_hole: float = 0.0
    """Absolute difference of colour in the hole; the published recipe leaves it to the other terms."""
    depth_l1: float = 30.0
    """Absolute difference of normalised inverse depth, hole and known alike."""
    depth_gradient: float = 10.0
    """Absolute difference of its gradients on four scales."""
    depth_normal: float = 2.0
    """1 - cosine between normals: planes are flat in inverse depth too."""
    depth_law: float = 30.0
    """By how much filled depth is nearer than the visibility law allows."""
    trunk: Literal["random", "lpips"] = "random"
    """Network of the perceptual term: random (frozen random weights), or lpips (the distance of the evaluation, from the file
    that ships, in place of equation 5)."""
    trunk_width: int = 32
    """First layer's channels of the random trunk."""

    def __post_init__(self) -> None:
        check_word(self.trunk, "loss.trunk", ("random", "lpips"))
        numbers = [each.name for each in fields(self) if isinstance(getattr(self, each.name), (int, float))]
        _check("loss", self, "0 or more", lambda value: 0 <= value < math.inf, *numbers)
        _check("loss", self, "1 or more", lambda value: value >= 1, "penalty_every", "trunk_width")

    @property
    def uses_discriminator(self) -> bool:
        """Whether any term needs a discriminator."""
        return self.adversarial > 0 or self.feature_matching > 0


@dataclass(frozen=True)
class OptimiserSettings:
    """Adam for both networks."""

    generator_rate: float = 1e-3
    """Learning rate of the generator."""
    discriminator_rate: float = 1e-4
    """Learning rate of the discriminator."""
    beta1: float = 0.9
    """Decay of the running mean of gradients."""
    beta2: float = 0.999
    """Decay of the running mean of squared gradients."""
    warm_up: int = 0
    """Steps over which both rates rise from 0."""
    decay: Literal["none", "cosine"] = "none"
    """cosine: both rates fall to a hundredth by the last step."""
    clip: float = 100.0
    """Gradients of a larger norm are shortened to it; 0: never."""
    average: float = 0.999
    """Decay of the moving average of the generator's weights, which is exported; smaller in the first steps."""

    def __post_init__(self) -> None:
        check_word(self.decay, "optimiser.decay", ("none", "cosine"))
        rates = "generator_rate", "discriminator_rate"
        _check("optimiser", self, "a number between 0 and 1", lambda value: 0 < value < 1, *rates)
        decays = "beta1", "beta2", "average"
        _check("optimiser", self, "0 or more and below 1", lambda value: 0 <= value < 1, *decays)
        _check("optimiser", self, "0 or more", lambda value: value >= 0, "warm_up", "clip")


@dataclass(frozen=True)
class DataSettings:
    """Which samples are drawn; the folders of their files are no setting but an argument of `train`."""

    size: int = 256
    """Height and width of a sample in pixels."""
    mixture: Mapping[str, float] = field(default_factory=lambda: {"world": 1.0})
    """Kind of sample -> its share: world, frame, removal, stereo."""
    cases: float = 0.5
    """Share of the samples of kinds removal and stereo that is made of the dataset's cases (frames with and without an object,
    stereo pairs); the rest, and all where the data has no such cases, are made of worlds."""
    held_out: int = 16
    """Number of fixed validation samples, of worlds or files that are never trained on."""
    workers: int | None = None
    """Processes that make samples; None: one per core less one, 0: none but the training itself."""

    def __post_init__(self) -> None:
        _check("data", self, "1 or more", lambda value: value >= 1, "size", "held_out")
        _check("data", self, "0 or more", lambda value: value is None or value >= 0, "workers")
        for kind, share in self.mixture.items():
            check_word(kind, "data.mixture", SAMPLES)
            if not 0 < share < math.inf:
                raise InputError(f"data.mixture gives {kind!r} the share {share}; more than 0 is expected")
        _check("data", self, "more than 0 and 1 at most", lambda value: 0 < value <= 1, "cases")
        if not self.mixture:
            raise InputError("data.mixture is empty; one kind of sample or more is expected")


@dataclass(frozen=True)
class LoopSettings:
    """Length, batch size, devices, and how often what is written."""

    steps: int = 100_000
    """Number of optimiser steps."""
    batch: int = 16
    """Samples of a batch on each device."""
    precision: Literal["bf16", "fp32"] = "fp32"
    """bf16: matrix products in bfloat16; FFT, losses and weights stay float32."""
    devices: int = 1
    """GPUs (or processes, on a CPU) per node."""
    nodes: int = 1
    """Computers."""
    accelerator: Literal["auto", "cpu", "gpu"] = "auto"
    """auto: a GPU where there is one."""
    compiled: bool = False
    """The generator through torch.compile."""
    exact: bool = False
    """On a GPU: deterministic algorithms where torch has them, no TF32 and no search for the fastest convolution, so that
    a resumed run has the same numbers, as it always has on a CPU. Slower."""
    seed: int = 0
    """Of the initial weights and of every sample."""
    log_every: int = 10
    """Steps between two rows of metrics.csv."""
    validate_every: int = 500
    """Steps between two validations on the held-out samples."""
    sheet_every: int = 1000
    """Steps between two sample sheets."""
    checkpoint_every: int = 1000
    """Steps between two checkpoints."""

    def __post_init__(self) -> None:
        check_word(self.precision, "loop.precision", ("bf16", "fp32"))
        check_word(self.accelerator, "loop.accelerator", ("auto", "cpu", "gpu"))
        counts = [each.name for each in fields(self) if each.type == "int" and each.name != "seed"]
        _check("loop", self, "1 or more", lambda value: value >= 1, *counts)
        _check("loop", self, "0 or more", lambda value: value >= 0, "seed")


@dataclass(frozen=True)
class TrainSettings:
    """One training run."""

    name: str = "unnamed"
    """Goes into file names and the model card."""
    licence: str = "unknown"
    """Of the trained weights; written into the exported files."""
    network: NetworkSettings = field(default_factory=NetworkSettings)
    loss: LossSettings = field(default_factory=LossSettings)
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    data: DataSettings = field(default_factory=DataSettings)
    loop: LoopSettings = field(default_factory=LoopSettings)

    def __post_init__(self) -> None:
        net = self.network.generator
        if self.data.size % net.multiple or self.data.size < net.minimum:
            expected = f"a multiple of {net.multiple}, {net.minimum} or more"
            raise InputError(f"data.size is {self.data.size}; {expected} is expected by {net.downsamplings} halvings")
        if not self.name or not all(letter.isalnum() or letter in "-_." for letter in self.name):
            raise InputError(f"name is {self.name!r}; letters, digits, '-', '_' and '.' are expected")
        unfit = [kind for kind in sorted(self.data.mixture) if self.network.kind.views != SAMPLES[kind]]
        if unfit:
            raise InputError(f"data.mixture has {unfit}, which planes {self.network.planes!r} do not learn from")


def _check(group: str, settings: Any, expected: str, fits: Callable[[Any], bool], *names: str) -> None:
    """InputError, which says what is expected, for the first of these settings of a group that does not fit."""
    for name in names:
        value = getattr(settings, name)
        if not fits(value):
            raise InputError(f"`{group}.{name}` is {value}; {expected} is expected")
