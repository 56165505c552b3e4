"""Pictures B x 3 x H x W in 0..1, output and truth, in -> the high receptive field perceptual loss (equation 5) out.

The paper's weight (30) was found for the published trunk, whose batch norms keep activations near 1. Those of the random trunk
are far larger, and would outweigh every other term; so its layers are scaled to mean square 1 on one picture.
LPIPS (AlexNet v0.1) is a scalar; its weights ship.

The trunk `resnet50-dilated` has the structure and the tensor names of the encoder of CSAIL's ADE20K segmentation network
(ResNet-50 with a deep stem, its last two stages dilated instead of halved), which big-lama was trained with. Loading is strict.
`random` needs no file: its weights are drawn from a fixed seed.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import load_file
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from dlama.errors import FileError, any_error, import_extra
from dlama.evaluation.metrics.lpips import NETWORK
from dlama.models.cache import user_path
from dlama.perception.depth_networks import IMAGENET
from dlama.training.losses.pixels import widen_half
from dlama.training.settings import LossSettings

EPSILON = 1e-10
IMAGENET_MEAN, IMAGENET_STD = IMAGENET
STAGES = ((3, 64, 1, 1), (4, 128, 2, 1), (6, 256, 1, 2), (3, 512, 1, 4))
"""ResNet-50: blocks, width, stride, dilation of each stage; the first block of a dilated stage has half its dilation."""
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


class Bottleneck(nn.Module):
    """1x1, 3x3, 1x1 with a skip; attribute names are the published ones."""

    def __init__(self, before: int, width: int, stride: int, dilation: int) -> None:
        super().__init__()
        after = 4 * width
        self.conv1 = nn.Conv2d(before, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, dilation, dilation, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, after, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(after)
        self.downsample = None
        if stride > 1 or before != after:
            self.downsample = nn.Sequential(nn.Conv2d(before, after, 1, stride, bias=False), nn.BatchNorm2d(after))

    def forward(self, x: Tensor) -> Tensor:
        """B x before x H x W -> B x 4 width x H / stride x W / stride."""
        y = self.bn1(self.conv1(x)).relu()
        y = self.bn2(self.conv2(y)).relu()
        return (self.bn3(self.conv3(y)) + (x if self.downsample is None else self.downsample(x))).relu()


class DilatedResnet50(nn.Module):
    """B x 3 x H x W, normalised -> four activations, the last three at an eighth of the size."""

    def __init__(self) -> None:
        super().__init__()
        for i, (before, after) in enumerate(((3, 64), (64, 64), (64, 128)), 1):
            setattr(self, f"conv{i}", nn.Conv2d(before, after, 3, 2 if i == 1 else 1, 1, bias=False))
            setattr(self, f"bn{i}", nn.BatchNorm2d(after))
        before = 128
        for i, (blocks, width, stride, dilation) in enumerate(STAGES, 1):
            first = Bottleneck(before, width, stride, max(dilation // 2, 1))
            before = 4 * width
            rest = [Bottleneck(before, width, 1, dilation) for _ in range(blocks - 1)]
            setattr(self, f"layer{i}", nn.Sequential(first, *rest))

    def forward(self, x: Tensor) -> list[Tensor]:
        """The activations of layer1 to layer4."""
        for i in (1, 2, 3):
            x = getattr(self, f"bn{i}")(getattr(self, f"conv{i}")(x)).relu()
        x = nn.functional.max_pool2d(x, 3, 2, 1)
        found = []
        for i in range(1, len(STAGES) + 1):
            x = getattr(self, f"layer{i}")(x)
            found.append(x)
        return found


class Chain(nn.Module):
    """Layers one after the other, each of which gives its activations."""

    def __init__(self, layers: list[nn.Module]) -> None:
        super().__init__()
        self.layers = nn.ModuleList(layers)

    def forward(self, x: Tensor) -> list[Tensor]:
        """B x 3 x H x W, normalised -> the activations of every layer."""
        found = []
        for layer in self.layers:
            x = layer(x)
            found.append(x)
        return found


def random_trunk(width: int) -> Chain:
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
    return Chain(layers)


def read_trunk(path: Path) -> DilatedResnet50:
    """The trunk `resnet50-dilated` of a weight file (.safetensors, .pth). FileError names the tensors that differ."""
    state, trunk = dict(_trunk_tensors(_tensors(path))), DilatedResnet50()
    expected = {key: tensor for key, tensor in trunk.state_dict().items() if not key.endswith("num_batches_tracked")}
    wrong = [key for key in {**expected, **state} if key not in expected or key not in state]
    wrong += [key for key in expected if key in state and state[key].shape != expected[key].shape]
    if wrong:
        raise FileError(
            f"{path}: no trunk 'resnet50-dilated': {len(wrong)} tensors are missing, not part of it or of another shape: "
            f"{', '.join(wrong[:3])}"
        )
    trunk.load_state_dict(state, strict=False)  # the counters alone are left, as checked above
    return trunk


def _trunk_tensors(tensors: Mapping[str, Tensor]) -> Iterator[tuple[str, Tensor]]:
    """Without the classifier, counters and the extra statistics of synchronised batch norms, in float32."""
    for name, tensor in tensors.items():
        if not re.search(r"^(fc|classifier)\.|num_batches_tracked$|_tmp_running_|_running_iter$", name):
            yield name, tensor.float()


def _tensors(path: Path) -> Mapping[str, Tensor]:
    with any_error(FileError, f"{path}: cannot be read as weights"):
        if path.suffix == ".safetensors":
            return load_file(path)
        state = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(state, Mapping) or not all(isinstance(value, Tensor) for value in state.values()):
        raise FileError(f"{path}: holds a {type(state).__name__}; a table of tensors is expected")
    return state
