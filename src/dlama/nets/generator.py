"""Stacked planes B x C x H x W in -> filled planes out: the FFC ResNet generator with the published module names.

Suvorov et al. 2022. The input is colour (and depth), already zeroed in the hole, then the mask (1 = fill) as the
last plane; values 0..1. The discriminator of its training: patch scores and every activation before them, a PatchGAN
(Isola et al. 2017) in the configuration of Suvorov et al.; attribute names are the published ones.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from dlama.errors import ShapeError
from dlama.nets.architecture import DiscriminatorSettings, GeneratorSettings, settings_from_state
from dlama.nets.ffc import FFC_BN_ACT, FFCResnetBlock


class Generator(nn.Module):
    """The whole network; `model.<i>` are the published indices."""

    def __init__(self, settings: GeneratorSettings | None = None) -> None:
        super().__init__()
        self.settings = s = settings or GeneratorSettings()
        layers: list[nn.Module] = [_PadAndSplit(), FFC_BN_ACT((s.in_channels, 0), (s.width, 0), kernel=7)]
        for level in range(s.downsamplings):
            last = level == s.downsamplings - 1
            split = (s.local_channels, s.global_channels) if last else (s.channels_at(level + 1), 0)
            layers.append(FFC_BN_ACT((s.channels_at(level), 0), split, kernel=3, stride=2, padding=1))
        layers += [FFCResnetBlock((s.local_channels, s.global_channels)) for _ in range(s.blocks)]
        layers.append(_ConcatBranches())
        for level in reversed(range(s.downsamplings)):
            wide, narrow = s.channels_at(level + 1), s.channels_at(level)
            up = nn.ConvTranspose2d(wide, narrow, 3, stride=2, padding=1, output_padding=1)
            layers += [up, nn.BatchNorm2d(narrow), nn.ReLU(inplace=True)]
        layers += [nn.ReflectionPad2d(3), nn.Conv2d(s.width, s.out_channels, 7)]
        layers += [layer() for name, layer in (("sigmoid", nn.Sigmoid), ("tanh", nn.Tanh)) if name == s.activation]
        self.model = nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        """B x in_channels x H x W -> B x out_channels x H x W; H and W multiples of `settings.multiple`.

        Raises ShapeError for other channel counts and for sizes off the multiple or below the minimum.
        """
        if not torch.jit.is_tracing():  # a trace would keep this one picture's answer
            self._refuse_size(tuple(x.shape))
        return self.model(x)

    def _refuse_size(self, shape: tuple[int, ...]) -> None:
        s = self.settings
        if len(shape) != 4 or shape[1] != s.in_channels:
            raise ShapeError(f"generator: input is {shape}, expected B x {s.in_channels} x H x W")
        if any(side % s.multiple or side < s.minimum for side in shape[2:]):
            expected = f"multiples of {s.multiple}, {s.minimum} or more"
            raise ShapeError(f"generator: height and width are {shape[2]} and {shape[3]}, expected {expected}")


class _PadAndSplit(nn.Module):
    """The published reflection by 3 pixels, and the entry into the two branches: the global one is empty still."""

    def forward(self, x: Tensor) -> tuple[Tensor, None]:
        return nn.functional.pad(x, (3, 3, 3, 3), mode="reflect"), None


class _ConcatBranches(nn.Module):
    """The published ConcatTupleLayer: local channels first, then global."""

    def forward(self, pair: tuple[Tensor, Tensor]) -> Tensor:
        return torch.cat(pair, dim=1)


def generator_from_state(state: Mapping[str, np.ndarray], activation: str = "sigmoid") -> Generator:
    """A generator in eval mode that holds those float32 arrays, loaded strictly.

    Raises ShapeError where the names or shapes are not those of one generator.
    """
    settings = settings_from_state({name: array.shape for name, array in state.items()}, activation)
    net = Generator(settings)
    net.load_state_dict({name: torch.from_numpy(np.array(array)) for name, array in state.items()}, strict=True)
    return net.eval()


class Discriminator(nn.Module):
    """4x4 convolutions with leaky ReLU; `model<i>` are the published names."""

    def __init__(self, settings: DiscriminatorSettings | None = None) -> None:
        super().__init__()
        self.settings = s = settings or DiscriminatorSettings()
        before = s.in_channels
        for layer in range(s.layers + 1):
            here = s.channels_at(layer)
            stride = 1 if layer == s.layers else 2
            parts: list[nn.Module] = [nn.Conv2d(before, here, 4, stride, padding=2)]
            parts += [nn.BatchNorm2d(here)] if layer else []
            setattr(self, f"model{layer}", nn.Sequential(*parts, nn.LeakyReLU(0.2, inplace=True)))
            before = here
        setattr(self, f"model{s.layers + 1}", nn.Sequential(nn.Conv2d(before, 1, 4, 1, padding=2)))

    def forward(self, x: Tensor) -> tuple[Tensor, list[Tensor]]:
        """B x in_channels x H x W, values 0..1 -> (scores B x 1 x h x w, higher = real; activations of each layer)."""
        features = []
        for layer in range(self.settings.layers + 1):
            x = getattr(self, f"model{layer}")(x)
            features.append(x)
        return getattr(self, f"model{self.settings.layers + 1}")(x), features
