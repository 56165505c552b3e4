"""Names and shapes of tensors in -> the settings of the network they belong to, and back; numpy-free and torch-free.

The published configuration is Suvorov et al. 2022, "Resolution-robust Large Mask Inpainting with Fourier
Convolutions"; its tensor names are kept so that published weights load strictly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from dlama.errors import ShapeError

Shapes: TypeAlias = Mapping[str, tuple[int, ...]]

STEM = "model.1.ffc.convl2l.weight"
WIDEST_GENERATOR = 1024
WIDEST_DISCRIMINATOR = 512
ACTIVATIONS = ("sigmoid", "tanh", "none")


@dataclass(frozen=True)
class GeneratorSettings:
    """The FFC ResNet generator; the defaults are the published big-lama.

    Raises ShapeError for numbers no generator has.
    """

    in_channels: int = 4
    """Planes of the input: colour, depth, then the mask last."""
    out_channels: int = 3
    """Planes of the output."""
    width: int = 64
    """Channels after the stem (ngf); doubled by every down-sampling, up to 1024."""
    downsamplings: int = 3
    """Halvings of height and width; the input's sides must be multiples of 2 to this power."""
    blocks: int = 18
    """FFC residual blocks, two FFC layers each."""
    global_ratio: float = 0.75
    """Share of the blocks' channels in the Fourier branch."""
    activation: str = "sigmoid"
    """Last layer: sigmoid, tanh or none; not visible in the tensors, so the caller gives it."""

    def __post_init__(self) -> None:
        for name in ("in_channels", "out_channels", "width", "downsamplings", "blocks"):
            if getattr(self, name) < 1:
                raise ShapeError(f"generator: {name} is {getattr(self, name)}, expected 1 or more")
        if self.activation not in ACTIVATIONS:
            raise ShapeError(f"generator: activation is {self.activation!r}, expected one of {', '.join(ACTIVATIONS)}")
        if not 1 <= self.global_channels < self.bottleneck or self.global_channels % 2:
            raise ShapeError(
                f"generator: {self.global_channels} of {self.bottleneck} channels are global, expected an even part"
            )

    @property
    def bottleneck(self) -> int:
        """Channels of the residual blocks, local and global together."""
        return self.channels_at(self.downsamplings)

    @property
    def global_channels(self) -> int:
        """Channels of the Fourier branch in the residual blocks."""
        return round(self.bottleneck * self.global_ratio)

    @property
    def local_channels(self) -> int:
        """Channels of the convolution branch in the residual blocks."""
        return self.bottleneck - self.global_channels

    @property
    def multiple(self) -> int:
        """Height and width of the input must be multiples of this."""
        return int(2**self.downsamplings)

    @property
    def minimum(self) -> int:
        """Smallest height and width: reflection by one pixel needs two pixels at the coarsest level, by three needs four."""
        return max(2 * self.multiple, 4)

    def channels_at(self, level: int) -> int:
        """Channels after `level` halvings."""
        return min(WIDEST_GENERATOR, self.width * int(2**level))

    @property
    def concat_index(self) -> int:
        """Index, in the published Sequential, of the layer that joins the two branches again."""
        return 2 + self.downsamplings + self.blocks

    @property
    def head_index(self) -> int:
        """Index, in the published Sequential, of the last convolution."""
        return self.concat_index + 3 * self.downsamplings + 2


@dataclass(frozen=True)
class DiscriminatorSettings:
    """The PatchGAN discriminator; the defaults are those big-lama was trained with."""

    in_channels: int = 3
    """Planes of the picture that is judged."""
    width: int = 64
    """Channels after the first layer (ndf); doubled by every layer, up to 512."""
    layers: int = 4
    """Layers with stride 2, the first included (n_layers); one with stride 1 and the scores follow."""

    def __post_init__(self) -> None:
        for name in ("in_channels", "width", "layers"):
            if getattr(self, name) < 1:
                raise ShapeError(f"discriminator: {name} is {getattr(self, name)}, expected 1 or more")

    def channels_at(self, layer: int) -> int:
        """Channels after layer `layer` (0 is the first)."""
        return min(WIDEST_DISCRIMINATOR, self.width * int(2**layer))


def generator_shapes(settings: GeneratorSettings) -> dict[str, tuple[int, ...]]:
    """Every published parameter and buffer name of that generator with its shape."""
    return dict(_generator_entries(settings))


def settings_from_state(shapes: Shapes, activation: str = "sigmoid") -> GeneratorSettings:
    """The generator those tensors belong to, read from their shapes alone.

    Args:
        shapes: name -> shape, names as published (`model.1.ffc.convl2l.weight`, ...), nothing else among them.
        activation: the last layer, which is not visible in the tensors.
    Raises:
        ShapeError: the tensors are no such generator, or only half of one; names the first that differ.
    """
    stem = _shape(shapes, STEM)
    downsamplings = 0
    while f"model.{2 + downsamplings}.ffc.convl2l.weight" in shapes:
        downsamplings += 1
    first = 2 + downsamplings
    blocks = 0
    while f"model.{first + blocks}.conv1.ffc.convl2l.weight" in shapes:
        blocks += 1
    to_local = _shape(shapes, f"model.{first - 1}.ffc.convl2l.weight")[0]
    to_global = _shape(shapes, f"model.{first - 1}.ffc.convl2g.weight")[0]
    head = _shape(shapes, f"model.{first + blocks + 3 * downsamplings + 2}.weight")
    ratio = to_global / max(to_local + to_global, 1)  # of none at all no share is one that a generator has
    settings = GeneratorSettings(stem[1], head[0], stem[0], downsamplings, blocks, ratio, activation)
    _refuse_differences(shapes, settings)
    return settings


def _refuse_differences(came: Shapes, settings: GeneratorSettings) -> None:
    """Raise ShapeError unless these are exactly that generator's names and shapes, naming the first of each kind that differ."""
    expected = generator_shapes(settings)
    missing = [name for name in expected if name not in came]
    extra = [name for name in came if name not in expected]
    other = [
        f"{name} is {_text(came[name])}, expected {_text(expected[name])}"
        for name in expected
        if name in came and tuple(came[name]) != tuple(expected[name])
    ]
    parts = [
        f"{len(names)} {kind}: {', '.join(names[:3])}{', ...' if len(names) > 3 else ''}"
        for kind, names in (("missing", missing), ("not part of it", extra), ("of another shape", other))
        if names
    ]
    if parts:
        raise ShapeError(f"the tensors do not make up a generator ({len(expected)} names): {'; '.join(parts)}")


def _generator_entries(s: GeneratorSettings) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield STEM, (s.width, s.in_channels, 7, 7)
    yield from _norm("model.1.bn_l", s.width)
    for level in range(s.downsamplings):
        yield from _down_entries(s, level)
    for block in range(s.blocks):
        for conv in ("conv1", "conv2"):
            yield from _ffc_entries(f"model.{2 + s.downsamplings + block}.{conv}", s)
    for level in reversed(range(s.downsamplings)):
        index = s.concat_index + 1 + 3 * (s.downsamplings - 1 - level)
        wide, narrow = s.channels_at(level + 1), s.channels_at(level)
        yield f"model.{index}.weight", (wide, narrow, 3, 3)
        yield f"model.{index}.bias", (narrow,)
        yield from _norm(f"model.{index + 1}", narrow)
    yield f"model.{s.head_index}.weight", (s.out_channels, s.width, 7, 7)
    yield f"model.{s.head_index}.bias", (s.out_channels,)


def _down_entries(s: GeneratorSettings, level: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    """One down-sampling layer; the last one splits its output into the local and the global branch."""
    last = level == s.downsamplings - 1
    branches = {"l": s.local_channels, "g": s.global_channels} if last else {"l": s.channels_at(level + 1)}
    for branch, channels in branches.items():
        yield f"model.{2 + level}.ffc.convl2{branch}.weight", (channels, s.channels_at(level), 3, 3)
    for branch, channels in branches.items():
        yield from _norm(f"model.{2 + level}.bn_{branch}", channels)


def _ffc_entries(prefix: str, s: GeneratorSettings) -> Iterator[tuple[str, tuple[int, ...]]]:
    """One FFC layer of a residual block: three convolutions, the spectral transform, two batch norms."""
    local, wide, half = s.local_channels, s.global_channels, s.global_channels // 2
    yield f"{prefix}.ffc.convl2l.weight", (local, local, 3, 3)
    yield f"{prefix}.ffc.convl2g.weight", (wide, local, 3, 3)
    yield f"{prefix}.ffc.convg2l.weight", (local, wide, 3, 3)
    yield f"{prefix}.ffc.convg2g.conv1.0.weight", (half, wide, 1, 1)
    yield from _norm(f"{prefix}.ffc.convg2g.conv1.1", half)
    yield f"{prefix}.ffc.convg2g.fu.conv_layer.weight", (2 * half, 2 * half, 1, 1)
    yield from _norm(f"{prefix}.ffc.convg2g.fu.bn", 2 * half)
    yield f"{prefix}.ffc.convg2g.conv2.weight", (wide, half, 1, 1)
    yield from _norm(f"{prefix}.bn_l", local)
    yield from _norm(f"{prefix}.bn_g", wide)


def _norm(prefix: str, channels: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    for name in ("weight", "bias", "running_mean", "running_var"):
        yield f"{prefix}.{name}", (channels,)
    yield f"{prefix}.num_batches_tracked", ()


def _shape(shapes: Shapes, name: str) -> tuple[int, ...]:
    if name not in shapes:
        raise ShapeError(
            f"no tensor {name!r}; the first of {len(shapes)} names: {', '.join(list(shapes)[:3]) or 'none'}"
        )
    if len(shapes[name]) != 4:
        raise ShapeError(f"{name}: shape {_text(shapes[name])}, expected 4 dimensions")
    return tuple(shapes[name])


def _text(shape: tuple[int, ...]) -> str:
    return "x".join(map(str, shape)) or "scalar"
