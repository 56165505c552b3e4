"""Pictures B x 3 x H x W in 0..1, output and truth, in -> the high receptive field perceptual loss (equation 5) out.

The paper's weight (30) was found for the published trunk, whose batch norms keep activations near 1. Those of the random trunk
are far larger, and would outweigh every other term; so its layers are scaled to mean square 1 on one picture.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from dlama.errors import FileError
from dlama.models.cache import user_path
from dlama.training.losses.lpips import LpipsLoss
from dlama.training.losses.pixels import widen_half
from dlama.training.losses.trunks import IMAGENET_MEAN, IMAGENET_STD, random_trunk, read_trunk
from dlama.training.settings import LossSettings


class PerceptualLoss(nn.Module):
    """Mean squared difference of a frozen trunk's activations; always in eval mode. Its weights are not kept in checkpoints.

    Args:
        trunk: B x 3 x H x W (ImageNet-normalised) -> a list of activations.
        name: for `note`.
        scaled: whether each layer is divided by the mean square of its activations at `reference_picture`.
    """

    mean: Tensor
    std: Tensor
    scales: Tensor

    def __init__(self, trunk: nn.Module, name: str, scaled: bool = False) -> None:
        super().__init__()
        self.trunk, self.name = trunk.eval().requires_grad_(False), name
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(1, 3, 1, 1), persistent=False)
        self.register_buffer("scales", self._scales() if scaled else torch.ones(()), persistent=False)

    def forward(self, output: Tensor, truth: Tensor) -> Tensor:
        """Equation 5: the mean over layers of the mean squared difference of activations; a scalar.

        output, truth: B x 3 x H x W in 0..1; `truth` gets no gradient.
        """
        with torch.no_grad():
            true = self.trunk((truth - self.mean) / self.std)
        found = self.trunk((output - self.mean) / self.std)
        layers = torch.stack([mse_loss(widen_half(one), widen_half(other)) for one, other in zip(found, true)])
        return (layers * self.scales).mean()

    @torch.no_grad()
    def _scales(self) -> Tensor:
        """One over the mean square of each layer's activations."""
        found = self.trunk((reference_picture() - self.mean) / self.std)
        return 1 / torch.stack([layer.square().mean() for layer in found])

    def train(self, mode: bool = True) -> PerceptualLoss:
        """Stays in eval mode: its batch norms, where it has any, keep their statistics."""
        return super().train(False)

    @property
    def note(self) -> str:
        """For the log and the model card."""
        if self.name == "random":
            return "perceptual trunk random: frozen, drawn from a fixed seed, never trained on pictures"
        return f"perceptual trunk {self.name}"


def reference_picture(size: int = 128) -> Tensor:
    """1 x 3 x size x size: noise with the spectrum of photographs (amplitude 1 / frequency), always the same."""
    generator = torch.Generator().manual_seed(0)
    spectrum = torch.fft.rfft2(torch.randn(1, 3, size, size, generator=generator))
    rows, columns = torch.fft.fftfreq(size)[:, None], torch.fft.rfftfreq(size)[None]
    frequency = (rows.square() + columns.square()).sqrt().clamp(min=1 / size)
    noise = torch.fft.irfft2(spectrum / frequency, s=(size, size))
    return (0.45 + 0.25 * (noise - noise.mean()) / noise.std()).clamp(0, 1)


def perceptual_loss(settings: LossSettings) -> PerceptualLoss | LpipsLoss:
    """As the settings say; FileError where their weight file is not there or is no such trunk."""
    if settings.trunk == "lpips":
        return LpipsLoss()
    if settings.trunk_weights is None:
        return PerceptualLoss(random_trunk(settings.trunk_width), "random", scaled=True)
    path = user_path(settings.trunk_weights)
    if not path.is_file():
        raise FileError(f"{path}: no such file (loss.trunk_weights)")
    return PerceptualLoss(read_trunk(path), "resnet50-dilated")
