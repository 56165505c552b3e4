"""Pictures B x 3 x H x W in 0..1, output and truth, in -> LPIPS (AlexNet v0.1), a scalar, out; its weights ship."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from dlama.errors import MissingExtraError
from dlama.nets.export.lpips import CONVOLUTIONS, EPSILON, SCALE, SHIFT
from dlama.training.losses.pixels import widen_half

FILE = Path(__file__).parents[2] / "assets" / "lpips" / "alex.onnx"


class LpipsLoss(nn.Module):
    """The distance that the evaluation measures, with gradients; no parameter of it is trained or kept in checkpoints."""

    note = "perceptual term LPIPS (AlexNet v0.1), the measure of the evaluation itself, which flatters this network's LPIPS"

    def __init__(self) -> None:
        super().__init__()
        self.convolutions, self.pool = nn.ModuleList(), nn.MaxPool2d(3, 2)
        weights, heads = shipped_weights()
        for (_, before, after, kernel, stride, padding, _), (weight, bias) in zip(CONVOLUTIONS, weights):
            layer = nn.Conv2d(before, after, kernel, stride, padding)
            layer.load_state_dict({"weight": torch.from_numpy(weight), "bias": torch.from_numpy(bias)})
            self.convolutions.append(layer)
        for number, head in enumerate(heads):
            self.register_buffer(f"head{number}", torch.from_numpy(head), persistent=False)
        self.requires_grad_(False)

    def forward(self, output: Tensor, truth: Tensor) -> Tensor:
        """Mean over the batch; `truth` gets no gradient."""
        with torch.no_grad():
            true = self.taps(widen_half(truth))
        found = self.taps(widen_half(output))
        return torch.stack([(a - b).square().sum(1).mean() for a, b in zip(found, true)]).sum()

    def taps(self, picture: Tensor) -> list[Tensor]:
        """Unit-normalised features times the square roots of their weights, of five layers."""
        shift, scale = (picture.new_tensor(numbers).view(1, 3, 1, 1) for numbers in (SHIFT, SCALE))
        x, found = (2 * picture - 1 - shift) / scale, []
        for number, (layer, (*_, pooled)) in enumerate(zip(self.convolutions, CONVOLUTIONS)):
            x = layer(x).relu()
            length = (x.square().sum(1, keepdim=True) + EPSILON).sqrt()  # a gradient at 0, too
            found.append(x / (length + EPSILON) * getattr(self, f"head{number}"))
            x = self.pool(x) if pooled else x
        return found


def shipped_weights() -> tuple[list[tuple[np.ndarray, np.ndarray]], list[np.ndarray]]:
    """Weight and bias of each convolution, and the square roots of the heads (1 x C x 1 x 1), of the file that ships."""
    try:
        import onnx
        from onnx import numpy_helper
    except ImportError as error:
        raise MissingExtraError("the perceptual term LPIPS", "onnx", "onnx") from error
    graph = onnx.load(FILE).graph
    constants = {one.name: numpy_helper.to_array(one).astype(np.float32) for one in graph.initializer}
    for node in graph.node:
        if node.op_type == "Cast" and node.input[0] in constants:
            constants[node.output[0]] = constants[node.input[0]]
    layers = [node for node in graph.node if node.op_type == "Conv"]
    taps = {node.output[0]: node for node in graph.node}
    weights = [(constants[node.input[1]], constants[node.input[2]]) for node in layers]
    return weights, [constants[taps[f"tap{number}"].input[1]] for number in range(len(layers))]
