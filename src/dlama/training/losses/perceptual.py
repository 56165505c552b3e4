"""Pictures B x 3 x H x W in 0..1, output and truth, in -> the high receptive field perceptual loss (equation 5) out.

The paper's weight (30) was found for the published trunk, whose batch norms keep activations near 1. Those of the random trunk
are far larger, and would outweigh every other term; so its layers are scaled to mean square 1 on one picture.
LPIPS (AlexNet v0.1) is a scalar; its weights ship.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from dlama.errors import FileError, import_extra
from dlama.evaluation.metrics.lpips import NETWORK
from dlama.models.cache import user_path
from dlama.training.losses.pixels import widen_half
from dlama.training.losses.trunks import IMAGENET_MEAN, IMAGENET_STD, random_trunk, read_trunk
from dlama.training.settings import LossSettings

EPSILON = 1e-10


def convolution(node: Any, weight: Tensor, bias: Tensor) -> nn.Conv2d:
    """The layer of a node of an ONNX graph."""
    about: dict[str, Any] = {each.name: list(each.ints) for each in node.attribute}
    layer = nn.Conv2d(weight.shape[1], weight.shape[0], about["kernel_shape"], about["strides"], about["pads"][:2])
    layer.load_state_dict({"weight": weight, "bias": bias})
    return layer


class LpipsLoss(nn.Module):
    """The distance that the evaluation measures, with gradients; no parameter of it is trained or kept in checkpoints."""

    shift: Tensor
    scale: Tensor
    note = "perceptual term LPIPS (AlexNet v0.1), the measure of the evaluation itself, which flatters this network's LPIPS"

    def __init__(self) -> None:
        super().__init__()
        onnx = import_extra("onnx", "the perceptual term LPIPS", "onnx", "onnx")
        graph = onnx.load(NETWORK).graph
        stored = {one.name: onnx.numpy_helper.to_array(one).astype(np.float32) for one in graph.initializer}
        stored |= {node.output[0]: stored[node.input[0]] for node in graph.node if node.op_type == "Cast"}
        constants = {name: torch.from_numpy(array) for name, array in stored.items()}
        layers = [node for node in graph.node if node.op_type == "Conv"]
        self.convolutions = nn.ModuleList(
            convolution(each, *(constants[name] for name in each.input[1:])) for each in layers
        )
        self.pool = nn.MaxPool2d(3, 2)
        shift, scale, *_ = graph.node
        taps = sorted(
            (node for node in graph.node if node.output[0].startswith("tap")), key=lambda node: node.output[0]
        )
        weighted = {"shift": shift, "scale": scale} | {f"head{number}": node for number, node in enumerate(taps)}
        for name, node in weighted.items():
            self.register_buffer(name, constants[node.input[1]], persistent=False)
        self.requires_grad_(False)

    def forward(self, output: Tensor, truth: Tensor) -> Tensor:
        """Mean over the batch; `truth` gets no gradient."""
        with torch.no_grad():
            true = self.taps(widen_half(truth))
        found = self.taps(widen_half(output))
        return torch.stack([(a - b).square().sum(1).mean() for a, b in zip(found, true)]).sum()

    def taps(self, picture: Tensor) -> list[Tensor]:
        """Unit-normalised features times the square roots of their weights, of five layers."""
        x, found = (2 * picture - 1 - self.shift) / self.scale, []
        for number, layer in enumerate(self.convolutions):
            x = self.pool(x) if number in (1, 2) else x
            x = layer(x).relu()
            length = (x.square().sum(1, keepdim=True) + EPSILON).sqrt()  # a gradient at 0, too
            found.append(x / (length + EPSILON) * getattr(self, f"head{number}"))
        return found


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


def reference_picture() -> Tensor:
    """1 x 3 x 128 x 128: noise with the spectrum of photographs (amplitude 1 / frequency), always the same."""
    size, generator = 128, torch.Generator().manual_seed(0)
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
