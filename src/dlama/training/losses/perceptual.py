"""Pictures B x 3 x H x W in 0..1, output and truth, in -> the high receptive field perceptual loss (equation 5) out.

The trunk `random` needs no file: its weights are drawn from a fixed seed. The paper's weight (30) was found for the published
trunk, whose batch norms keep activations near 1. Those of the random trunk are far larger, and would outweigh every other term;
so its layers are scaled to mean square 1 on one picture. LPIPS (AlexNet v0.1) is a scalar; its weights ship.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from dlama.errors import import_extra
from dlama.evaluation.metrics.lpips import NETWORK
from dlama.perception.depth_networks import IMAGENET
from dlama.training.losses.pixels import widen_half
from dlama.training.settings import LossSettings

EPSILON = 1e-10
IMAGENET_MEAN, IMAGENET_STD = IMAGENET
SEED = 20240301


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
    """Mean squared difference of a frozen trunk's activations, each layer divided by the mean square of its activations at
    `reference_picture`. Its weights are not kept in checkpoints.

    trunk: layers one after the other, of pictures B x 3 x H x W (ImageNet-normalised).
    """

    mean: Tensor
    std: Tensor
    scales: Tensor
    note = "perceptual trunk random: frozen, drawn from a fixed seed, never trained on pictures"

    def __init__(self, trunk: nn.Sequential) -> None:
        super().__init__()
        self.trunk = trunk.requires_grad_(False)
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(1, 3, 1, 1), persistent=False)
        with torch.no_grad():
            scales = 1 / torch.stack([layer.square().mean() for layer in self.activations(reference_picture())])
        self.register_buffer("scales", scales, persistent=False)

    def forward(self, output: Tensor, truth: Tensor) -> Tensor:
        """Equation 5: the mean over layers of the mean squared difference of activations; a scalar.

        output, truth: B x 3 x H x W in 0..1; `truth` gets no gradient.
        """
        with torch.no_grad():
            true = self.activations(truth)
        found = self.activations(output)
        layers = torch.stack([mse_loss(widen_half(one), widen_half(other)) for one, other in zip(found, true)])
        return (layers * self.scales).mean()

    def activations(self, picture: Tensor) -> list[Tensor]:
        """B x 3 x H x W in 0..1 -> the output of every layer of the trunk."""
        x, found = (picture - self.mean) / self.std, []
        for layer in self.trunk:
            x = layer(x)
            found.append(x)
        return found


def reference_picture() -> Tensor:
    """1 x 3 x 128 x 128: noise with the spectrum of photographs (amplitude 1 / frequency), always the same."""
    size, generator = 128, torch.Generator().manual_seed(0)
    spectrum = torch.fft.rfft2(torch.randn(1, 3, size, size, generator=generator))
    rows, columns = torch.fft.fftfreq(size)[:, None], torch.fft.rfftfreq(size)[None]
    frequency = (rows.square() + columns.square()).sqrt().clamp(min=1 / size)
    noise = torch.fft.irfft2(spectrum / frequency, s=(size, size))
    return (0.45 + 0.25 * (noise - noise.mean()) / noise.std()).clamp(0, 1)


def perceptual_loss(settings: LossSettings) -> PerceptualLoss | LpipsLoss:
    """As the settings say."""
    return LpipsLoss() if settings.trunk == "lpips" else PerceptualLoss(random_trunk(settings.trunk_width))


def random_trunk(width: int) -> nn.Sequential:
    """Seven 3x3 convolutions, two of them halving, then dilated 1, 2, 4, 8: the last sees about 130 pixels.

    Weights are orthogonal with ReLU's gain, drawn from a fixed seed by torch's CPU generator.
    """
    widths = (3, width, 2 * width, 2 * width, *4 * (4 * width,))
    steps = ((1, 1), (2, 1), (2, 1), (1, 1), (1, 2), (1, 4), (1, 8))
    layers: list[nn.Module] = []
    generator = torch.Generator().manual_seed(SEED)
    for (before, after), (stride, dilation) in zip(itertools.pairwise(widths), steps, strict=True):
        convolution = nn.Conv2d(before, after, 3, stride, dilation, dilation)
        nn.init.orthogonal_(convolution.weight, 2**0.5, generator)
        nn.init.zeros_(convolution.bias)
        layers.append(nn.Sequential(convolution, nn.LeakyReLU(0.2)))
    return nn.Sequential(*layers)
