"""Weights of the shadow's U-Net (`shadow_net`) and metadata in; an ONNX file out. Needs numpy and onnx, no torch.

Input: planes B x C x H x W. Output: logits B x H x W; B, H and W free, H and W multiples of 32. Batch norms are folded into the
convolutions before them (in float64), weights stored in half precision and computed with in single precision. A network of
clicks may have a second output, `object`, B x 1: what two layers make of its maps where the click is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dlama.nets.export.onnx_graph import Graph
from dlama.perception.masks.click_network import SIDE
from dlama.writing.atomic_write import write_file

EPSILON = 1e-5  # of torch's batch norms
PLAIN = ("own", "whole", "head")
LAYERS = (
    *("down1", "down2", "block2", "down3", "block3", "down4", "block4", "down5", "block5", "own", "whole"),
    *("join4", "up4", "join3", "up3", "join2", "up2", "join1", "up1", "head"),
)
"""Layers in the order of the file (of the deeper network), and those without a batch norm."""
OBJECT = ("object1.weight", "object1.bias", "object2.weight", "object2.bias")
"""In the state where there is such an output: F x N, N, N x 1 and 1; F: channels of all maps on the way up."""
MIDDLES = {SIDE // 16: 2, SIDE // 8: 2, SIDE // 4: 4, SIDE // 2: 4}
"""Side of a map on the way up -> side of the square in its middle that is seen as the click's; their channels are joined in this
order."""


def export_shadow(state: Mapping[str, np.ndarray], path: Path, metadata: Mapping[str, str]) -> Path:
    """Write the ONNX file; equal input gives equal bytes. state: name -> float32 array, `ShadowNet.state_dict`, and OBJECT.

    Raises OutputError, MissingExtraError without onnx.
    """
    writer = _Writer(state)
    logits = writer.logits("planes")
    planes = state["down1.0.weight"].shape[1]
    inputs, outputs = {"planes": ("batch", planes, "height", "width")}, {logits: ("batch", "height", "width")}
    if OBJECT[0] in state:
        outputs[writer.object()] = ("batch", state[OBJECT[2]].shape[1])
    model = writer.g.model("generator", inputs, outputs, metadata)
    write_file(path, bytes(model.SerializeToString(deterministic=True)))
    return path


def read_shadow(path: Path) -> dict[str, np.ndarray]:
    """The state that `export_shadow` wrote, of the deeper network; of its batch norms only what they add is left."""
    import onnx

    graph, state = onnx.load(str(path)).graph, dict[str, np.ndarray]()
    stored = {each.name: onnx.numpy_helper.to_array(each).astype(np.float32) for each in graph.initializer}
    stored |= {node.output[0]: stored[node.input[0]] for node in graph.node if node.op_type == "Cast"}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    for name, node in zip(LAYERS, convolutions, strict=True):
        weight, *biases = (stored[each] for each in node.input[1:])
        if name in PLAIN:
            state[f"{name}.weight"] = weight
            state |= {f"{name}.bias": bias for bias in biases}
        else:
            state[f"{name}.0.weight"] = weight
            one, zero = np.ones_like(biases[0]), np.zeros_like(biases[0])
            parts = {"weight": one, "bias": biases[0], "running_mean": zero, "running_var": one - np.float32(EPSILON)}
            state |= {f"{name}.1.{part}": value for part, value in parts.items()}
    layers = [node for node in graph.node if node.op_type == "Gemm"]
    return state | dict(zip(OBJECT, (stored[each] for node in layers for each in node.input[1:])))


class _Writer:
    """Layers by their names in `state`, one after another into a graph."""

    def __init__(self, state: Mapping[str, np.ndarray]) -> None:
        self.state, self.g = state, Graph()
        self.ups: list[str] = []

    def logits(self, planes: str) -> str:
        """Name of the logits."""
        g = self.g
        one = self.block("down1", planes, stride=2)
        two = self.block("block2", self.block("down2", one, stride=2))
        three = self.block("block3", self.block("down3", two, stride=2))
        four = self.optional("block4", self.block("down4", three, stride=2))
        five = self.optional("block5", self.block("down5", four, stride=2))
        most = g.add("ReduceMax", five, axes=[2, 3], keepdims=1)
        both = g.add("Add", self.conv("own", five), self.conv("whole", most))
        h = g.add("Relu", both)
        for number, seen in ((4, four), (3, three), (2, two), (1, one)):
            joined = self.block(f"join{number}", g.add("Concat", self.double_size(h), seen, axis=1))
            h = self.block(f"up{number}", joined)
            self.ups.append(h)
        shuffled = g.add("DepthToSpace", self.conv("head", h), blocksize=2, mode="CRD")
        return g.add_named("logits", "Squeeze", shuffled, g.ints(1))

    def object(self) -> str:
        """Name of the second output."""
        g, seen = self.g, list[str]()
        for map_, (side, middle) in zip(self.ups, MIDDLES.items()):
            low, high = (side - middle) // 2, (side + middle) // 2
            part = g.add("Slice", map_, g.ints(low, low), g.ints(high, high), g.ints(2, 3))
            seen.append(g.add("ReduceMean", part, axes=[2, 3], keepdims=0))
        weights = [g.constant(self.state[name]) for name in OBJECT]
        hidden = g.add("Relu", g.add("Gemm", g.add("Concat", *seen, axis=1), *weights[:2]))
        return g.add_named("object", "Gemm", hidden, *weights[2:])

    def block(self, name: str, x: str, stride: int = 1) -> str:
        """`shadow_net.Block`."""
        weight = self.state[f"{name}.0.weight"].astype(np.float64)
        gain, shift, mean, variance = (
            self.state[f"{name}.1.{part}"].astype(np.float64)
            for part in ("weight", "bias", "running_mean", "running_var")
        )
        scale = gain / np.sqrt(variance + EPSILON)
        return str(self.g.add("Relu", self.layer(x, weight * scale[:, None, None, None], shift - mean * scale, stride)))

    def optional(self, name: str, x: str) -> str:
        """A block, where the network has it."""
        return self.block(name, x) if f"{name}.0.weight" in self.state else x

    def conv(self, name: str, x: str) -> str:
        """A convolution as it is."""
        return self.layer(x, self.state[f"{name}.weight"], self.state.get(f"{name}.bias"), 1)

    def layer(self, x: str, weight: np.ndarray, bias: np.ndarray | None, stride: int) -> str:
        """A convolution whose weights are stored as float16."""
        reach = weight.shape[2] // 2
        stored = self.g.add("Cast", self.g.constant(weight, np.float16), to=1)
        biases = [] if bias is None else [self.g.constant(bias)]
        how: dict[str, Any] = {"kernel_shape": list(weight.shape[2:]), "strides": [stride] * 2, "pads": [reach] * 4}
        return str(self.g.add("Conv", x, stored, *biases, **how))

    def double_size(self, x: str) -> str:
        """Twice the height and width, each pixel four times."""
        how: dict[str, Any] = {
            "mode": "nearest",
            "coordinate_transformation_mode": "asymmetric",
            "nearest_mode": "floor",
        }
        return str(self.g.add("Resize", x, "", self.g.constant([1, 1, 2, 2]), **how))
