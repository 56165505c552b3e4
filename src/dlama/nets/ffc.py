"""A pair of tensors (local, global) in -> a pair out: fast Fourier convolution with the published module names.

Chi et al. 2020, "Fast Fourier Convolution"; Suvorov et al. 2022 (the configuration without the local Fourier unit);
figure 6 of the paper. Tensors are B x C x H x W, float32. Attribute names are the published ones: they are the
names in everybody's weight files.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


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

        def path(source: int, target: int) -> nn.Conv2d | None:
            if not source or not target:
                return None
            return nn.Conv2d(source, target, kernel, stride, padding, bias=False, padding_mode="reflect")

        (in_local, in_global), (out_local, out_global) = in_split, out_split
        self.convl2l = path(in_local, out_local)
        self.convl2g = path(in_local, out_global)
        self.convg2l = path(in_global, out_local)
        self.convg2g = SpectralTransform(in_global, out_global) if in_global and out_global else None

    def forward(self, local: Tensor, wide: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """(B x l x H x W, B x g x H x W or None) -> the same pair after the layer; padding is by reflection."""
        to_local = _sum(_through(self.convl2l, local), _through(self.convg2l, wide))
        to_global = _sum(_through(self.convl2g, local), _through(self.convg2g, wide))
        assert to_local is not None  # every layer of this network keeps a local branch
        return to_local, to_global


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

    def forward(self, pair: tuple[Tensor, Tensor | None]) -> tuple[Tensor, Tensor | None]:
        """(local, global) -> (local, global)."""
        local, wide = self.conv2(self.conv1(pair))
        return pair[0] + local, _sum(pair[1], wide)


def _through(path: nn.Module | None, x: Tensor | None) -> Tensor | None:
    return None if path is None or x is None else path(x)


def _sum(a: Tensor | None, b: Tensor | None) -> Tensor | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b
