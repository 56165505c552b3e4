"""A weight file, or none, in -> a frozen network whose activations compare pictures, out.

`resnet50-dilated` has the structure and the tensor names of the encoder of CSAIL's ADE20K segmentation network (ResNet-50
with a deep stem, its last two stages dilated instead of halved), which big-lama was trained with. Loading is strict.
`random` needs no file: its weights are drawn from a fixed seed.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from dlama.errors import FileError, any_error

IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
STAGES = ((3, 64, 1, 1), (4, 128, 2, 1), (6, 256, 1, 2), (3, 512, 1, 4))
"""ResNet-50: blocks, width, stride, dilation of each stage; the first block of a dilated stage has half its dilation."""
SEED = 20240301


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
