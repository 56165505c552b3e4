"""Pictures B x C x H x W in -> patch scores and every activation before them: the PatchGAN discriminator.

Isola et al. 2017, in the configuration of Suvorov et al. 2022; attribute names are the published ones.
"""

from __future__ import annotations

from torch import Tensor, nn

from dlama.nets.architecture import DiscriminatorSettings as DiscriminatorSettings


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
