"""AlexNet's trunk and the LPIPS v0.1 heads (two .safetensors) in -> one small ONNX file of weighted features out.

LPIPS (Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", CVPR 2018) is a sum of
five terms, sum_c w_c (a_c - b_c)^2 with unit-normalised features a, b of two pictures and weights w >= 0. The graph gives
sqrt(w_c) a_c of one picture, so that the distance is a plain squared difference and the truth's features are
computed once for many pictures. Weights are stored as float16 and cast in the graph: everything is computed in float32.

The file that ships (src/dlama/assets/lpips/alex.onnx) was made by

    python benchmarks/lpips_export.py alexnet_features.safetensors lpips_alex_lin.safetensors alex.onnx

which needs the package onnx. Keys: features.{0,3,6,8,10}.{weight,bias} as torchvision names them, lin{0..4}.weight.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import FileError
from dlama.nets.export.onnx_graph import Graph
from dlama.nets.safetensors_file import read_safetensors
from dlama.training.losses.perceptual import EPSILON
from dlama.writing.atomic_write import write_file

SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
"""Of the network's input, per channel: (x - SHIFT) / SCALE with x in -1..1 (LPIPS's ScalingLayer)."""
CONVOLUTIONS = (
    # torchvision's number, channels in and out, kernel, stride, padding, pooled after
    (0, 3, 64, 11, 4, 2, True),
    (3, 64, 192, 5, 1, 2, True),
    (6, 192, 384, 3, 1, 1, False),
    (8, 384, 256, 3, 1, 1, False),
    (10, 256, 256, 3, 1, 1, False),
)
ABOUT = {
    "dlama.network": "lpips-alex-0.1",
    "dlama.input": "picture: 1 x 3 x H x W, RGB in -1..1, sides of 31 or more",
    "dlama.output": "tap0..tap4: unit-normalised features times the square root of their LPIPS weight",
    "dlama.licence": "trunk BSD-3-Clause (torchvision AlexNet IMAGENET1K_V1), heads BSD-2-Clause (LPIPS v0.1)",
}


def export_lpips(trunk: Path, heads: Path, target: Path) -> Path:
    """Write the ONNX file, first under a temporary name, so that no partial file is left. Equal input gives equal bytes.

    Raises:
        FileError: a tensor is missing or has another shape.
        OutputError: the file cannot be written.
        MissingExtraError: onnx is not installed.
    """
    sources = {f"dlama.sha256 {file.name}": hashlib.sha256(file.read_bytes()).hexdigest() for file in (trunk, heads)}
    tensors = {**_check(trunk, _trunk_shapes()), **_check(heads, _head_shapes())}
    data = _model(tensors, {**ABOUT, **sources}).SerializeToString(deterministic=True)
    write_file(target, data)
    return target


def _trunk_shapes() -> dict[str, tuple[int, ...]]:
    weights = {f"features.{n}.weight": (out, into, kernel, kernel) for n, into, out, kernel, *_ in CONVOLUTIONS}
    return {**weights, **{f"features.{n}.bias": (out,) for n, _, out, *_ in CONVOLUTIONS}}


def _head_shapes() -> dict[str, tuple[int, ...]]:
    return {f"lin{tap}.weight": (1, out, 1, 1) for tap, (_, _, out, *_) in enumerate(CONVOLUTIONS)}


def _check(path: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    tensors = read_safetensors(path)[0]
    for name, shape in shapes.items():
        came = tensors[name].shape if name in tensors else "nothing"
        if came != shape:
            raise FileError(f"{path}: {name} is {came}, expected {shape}")
        if name.startswith("lin") and tensors[name].min() < 0:
            raise FileError(f"{path}: {name} holds {tensors[name].min():.6g}, expected weights >= 0")
    return {name: tensors[name].astype(np.float32) for name in shapes}


def _model(tensors: Mapping[str, np.ndarray], about: Mapping[str, str]) -> Any:
    """The onnx.ModelProto: one picture in, five taps out, height and width free."""
    import onnx

    g = Graph()
    x = g.add("Sub", "picture", g.constant(np.reshape(SHIFT, (1, 3, 1, 1))))
    x = g.add("Div", x, g.constant(np.reshape(SCALE, (1, 3, 1, 1))))
    for tap, (number, _, _, kernel, stride, pad, pooled) in enumerate(CONVOLUTIONS):
        weight, bias = (_store_small(g, tensors[f"features.{number}.{part}"]) for part in ("weight", "bias"))
        layout: dict[str, Any] = {"kernel_shape": [kernel] * 2, "strides": [stride] * 2, "pads": [pad] * 4}
        x = g.add("Relu", g.add("Conv", x, weight, bias, **layout))
        _add_weighted_tap(g, x, tensors[f"lin{tap}.weight"], f"tap{tap}")
        x = g.add("MaxPool", x, kernel_shape=[3, 3], strides=[2, 2]) if pooled else x
    sides = {f"tap{tap}": (1, out, f"height{tap}", f"width{tap}") for tap, (_, _, out, *_) in enumerate(CONVOLUTIONS)}
    model = g.model("lpips", {"picture": (1, 3, "height", "width")}, sides, about)
    onnx.checker.check_model(model)
    return model


def _store_small(g: Graph, array: np.ndarray) -> str:
    """A float16 constant, cast to float32 (1 = TensorProto.FLOAT) where it is used."""
    return str(g.add("Cast", g.constant(array, np.float16), to=1))


def _add_weighted_tap(g: Graph, x: str, head: np.ndarray, name: str) -> None:
    """x / (|x| + eps) over channels, times the square root of the head: an output of the graph."""
    length = g.add("ReduceL2", x, axes=[1], keepdims=1)
    unit = g.add("Div", x, g.add("Add", length, g.constant(EPSILON)))
    g.add_named(name, "Mul", unit, g.constant(np.sqrt(head)))


if __name__ == "__main__":
    export_lpips(*(Path(argument) for argument in sys.argv[1:4]))
