"""Stacked planes B x C x H x W in -> filled planes out: the FFC ResNet generator with the published module names.

Suvorov et al. 2022. The input is colour (and depth), already zeroed in the hole, then the mask (1 = fill) as the
last plane; values 0..1. The discriminator of its training: patch scores and every activation before them, a PatchGAN
(Isola et al. 2017) in the configuration of Suvorov et al. Fast Fourier convolutions: Chi et al. 2020, in the configuration
without the local Fourier unit (figure 6 of Suvorov et al.). Attribute names are the published ones: they are the names in
everybody's weight files.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from dlama.errors import ShapeError
from dlama.nets.architecture import DiscriminatorSettings, GeneratorSettings, settings_from_state


class FourierUnit(nn.Module):
    """A 1x1 convolution of the spectrum: B x C x H x W -> the same shape, every output pixel sees the whole picture."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv_layer = nn.Conv2d(2 * channels, 2 * channels, 1, bias=False)
        self.bn = nn.BatchNorm2d(2 * channels)
        self.relu = nn.ReLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """Channels of the spectrum alternate real, imaginary, as in the published weights; float32 also under autocast.

        Half-precision FFTs exist only for powers of two and lose the picture's mean: so this part stays float32.
        """
        batch, channels, height, width = x.shape
        wide = x.float() if x.dtype in (torch.float16, torch.bfloat16) else x
        with torch.autocast(x.device.type, enabled=False):
            spectrum = torch.view_as_real(torch.fft.rfft2(wide, norm="ortho"))
            planes = spectrum.permute(0, 1, 4, 2, 3).reshape(batch, 2 * channels, height, width // 2 + 1)
            planes = self.relu(self.bn(self.conv_layer(planes)))
            pairs = planes.reshape(batch, channels, 2, height, width // 2 + 1).permute(0, 1, 3, 4, 2).contiguous()
            return torch.fft.irfft2(torch.view_as_complex(pairs), s=(height, width), norm="ortho").to(x.dtype)


class SpectralTransform(nn.Module):
    """Global to global: 1x1 down to half the channels, the Fourier unit with a skip connection, 1x1 up again."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        half = out_channels // 2
        self.conv1 = nn.Sequential(
            nn.Conv2d(in_channels, half, 1, bias=False), nn.BatchNorm2d(half), nn.ReLU(inplace=True)
        )
        self.fu = FourierUnit(half)
        self.conv2 = nn.Conv2d(half, out_channels, 1, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        """B x in x H x W -> B x out x H x W."""
        x = self.conv1(x)
        return self.conv2(x + self.fu(x))


class FFC(nn.Module):
    """Four paths between a local and a global branch; a branch of no channels has no path (its weights do not exist)."""

    def __init__(
        self, in_split: tuple[int, int], out_split: tuple[int, int], kernel: int, stride: int = 1, padding: int = 0
    ) -> None:
        super().__init__()

        def path(source: int, target: int) -> nn.Conv2d:
            return nn.Conv2d(source, target, kernel, stride, padding, bias=False, padding_mode="reflect")

        (in_local, in_global), (out_local, out_global) = in_split, out_split
        self.convl2l = path(in_local, out_local)
        self.convl2g = path(in_local, out_global) if out_global else None
        self.convg2l = path(in_global, out_local) if in_global else None
        self.convg2g = SpectralTransform(in_global, out_global) if in_global else None

    def forward(self, local: Tensor, wide: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """(B x l x H x W, B x g x H x W or None) -> the same pair after the layer; padding is by reflection."""
        to_local, to_global = self.convl2l(local), None if self.convl2g is None else self.convl2g(local)
        if wide is None:
            return to_local, to_global
        assert self.convg2l is not None and self.convg2g is not None  # no layer of this network ends the global branch
        return to_local + self.convg2l(wide), to_global + self.convg2g(wide)


class FFC_BN_ACT(nn.Module):
    """FFC, then batch norm and ReLU on each branch; the name is the published one."""

    def __init__(
        self, in_split: tuple[int, int], out_split: tuple[int, int], kernel: int, stride: int = 1, padding: int = 0
    ) -> None:
        super().__init__()
        self.ffc = FFC(in_split, out_split, kernel, stride, padding)
        self.bn_l = nn.BatchNorm2d(out_split[0])
        self.bn_g = nn.BatchNorm2d(out_split[1]) if out_split[1] else None
        self.act_l = nn.ReLU(inplace=True)
        self.act_g = nn.ReLU(inplace=True) if out_split[1] else None

    def forward(self, pair: tuple[Tensor, Tensor | None]) -> tuple[Tensor, Tensor | None]:
        """(local, global or None) -> (local, global or None)."""
        local, wide = self.ffc(*pair)
        local = self.act_l(self.bn_l(local))
        if self.bn_g is not None and self.act_g is not None and wide is not None:
            wide = self.act_g(self.bn_g(wide))
        return local, wide


class FFCResnetBlock(nn.Module):
    """Two FFC layers with a skip around them; the activation stays before the sum, as published."""

    def __init__(self, split: tuple[int, int]) -> None:
        super().__init__()
        self.conv1 = FFC_BN_ACT(split, split, kernel=3, padding=1)
        self.conv2 = FFC_BN_ACT(split, split, kernel=3, padding=1)

    def forward(self, pair: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
        """(local, global) -> (local, global)."""
        local, wide = self.conv2(self.conv1(pair))
        return pair[0] + local, pair[1] + wide


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
        s, shape = self.settings, tuple(x.shape)
        if len(shape) != 4 or shape[1] != s.in_channels:
            raise ShapeError(f"generator: input is {shape}, expected B x {s.in_channels} x H x W")
        if any(side % s.multiple or side < s.minimum for side in shape[2:]):
            expected = f"multiples of {s.multiple}, {s.minimum} or more"
            raise ShapeError(f"generator: height and width are {shape[2]} and {shape[3]}, expected {expected}")
        return self.model(x)


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
