"""Checked weights of a generator and metadata in -> an ONNX file out; needs numpy and onnx, no torch.

The graph is the network and nothing more: one input, the stacked planes B x C x H x W, already masked; one output,
the network's own; B, H and W free. Batch norms are folded into the convolutions before them (in float64), and
the two convolutions that share the local input are one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dlama.nets.architecture import STEM, GeneratorSettings
from dlama.nets.checkpoints import GeneratorWeights
from dlama.nets.export.onnx_graph import Graph, PlaneTransform, plane_transform
from dlama.writing.atomic_write import write_file

EPSILON = 1e-5  # of torch's batch norms, which the published network leaves as they are


def export_onnx(weights: GeneratorWeights, path: Path | str, metadata: Mapping[str, str]) -> Path:
    """Write the network as an ONNX file, whole or not at all.

    Args:
        weights: from `checkpoints.read_generator`.
        path: where the file goes.
        metadata: key -> text, what the engine must know (planes, ranges, licence); written into it as it is.
    Raises:
        OutputError: the file cannot be written.
        MissingExtraError: onnx is not installed.
    """
    write_file(path, onnx_bytes(weights.settings, weights.state, metadata))
    return Path(path)


def onnx_bytes(settings: GeneratorSettings, state: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> bytes:
    """The ONNX model, serialized; `state`: published name -> float32 array of that generator."""
    g = Graph()
    output = _generator(g, settings, state, "planes")
    inputs = {"planes": ("batch", settings.in_channels, "height", "width")}
    model = g.model("generator", inputs, {output: ("batch", settings.out_channels, "height", "width")}, metadata)
    return bytes(model.SerializeToString())


def _generator(g: Graph, s: GeneratorSettings, state: Mapping[str, np.ndarray], x: str) -> str:
    x = g.add("Relu", g.conv(g.reflect(x, 3), *_fold(state, STEM, "model.1.bn_l")))
    for level in range(s.downsamplings):  # in the last one a single convolution makes both branches
        at, branches = f"model.{2 + level}", "lg" if level == s.downsamplings - 1 else "l"
        parts = [_fold(state, f"{at}.ffc.convl2{to}.weight", f"{at}.bn_{to}") for to in branches]
        weight, bias = (np.concatenate(pair) for pair in zip(*parts))
        x = g.add("Relu", g.conv(g.reflect(x, 1), weight, bias, stride=2))
    local, wide = g.add("Split", x, g.ints(s.local_channels, s.global_channels), outputs=2, axis=1)
    transform = plane_transform(g, wide, s.global_channels // 2)
    for block in range(s.blocks):
        before = local, wide
        for conv in ("conv1", "conv2"):
            local, wide = _ffc(g, s, state, f"model.{2 + s.downsamplings + block}.{conv}", (local, wide), transform)
        local, wide = (g.add("Add", old, new) for old, new in zip(before, (local, wide)))
    x = g.add("Concat", local, wide, axis=1)
    for level in range(s.downsamplings):
        x = _up(g, state, f"model.{s.concat_index + 1 + 3 * level}", f"model.{s.concat_index + 2 + 3 * level}", x)
    head = f"model.{s.head_index}"
    x = _head(g, state[f"{head}.weight"], state[f"{head}.bias"], x)
    last = {"sigmoid": "Sigmoid", "tanh": "Tanh", "none": "Identity"}[s.activation]
    return g.add_named("filled", last, x)


def _ffc(
    g: Graph, s: GeneratorSettings, state: Mapping[str, np.ndarray], at: str, pair: tuple[str, str], t: PlaneTransform
) -> tuple[str, str]:
    """One FFC layer with its norms folded: what leaves the local branch for both is one convolution."""
    local, wide = pair
    from_local = [_fold(state, f"{at}.ffc.convl2{to}.weight", f"{at}.bn_{to}") for to in "lg"]
    weight, bias = (np.concatenate(parts) for parts in zip(*from_local))
    both = g.conv(g.reflect(local, 1), weight, bias)
    to_local, to_global = g.add("Split", both, g.ints(s.local_channels, s.global_channels), outputs=2, axis=1)
    g2l, _ = _fold(state, f"{at}.ffc.convg2l.weight", f"{at}.bn_l")
    to_local = g.add("Add", to_local, g.conv(g.reflect(wide, 1), g2l))
    spectral = f"{at}.ffc.convg2g"
    x = g.add("Relu", g.conv(wide, *_fold(state, f"{spectral}.conv1.0.weight", f"{spectral}.conv1.1")))
    mixed = g.conv(t.forward(g, x), *_fold(state, f"{spectral}.fu.conv_layer.weight", f"{spectral}.fu.bn"))
    x = g.add("Add", x, t.inverse(g, g.add("Relu", mixed)))
    g2g, _ = _fold(state, f"{spectral}.conv2.weight", f"{at}.bn_g")
    to_global = g.add("Add", to_global, g.conv(x, g2g))
    return g.add("Relu", to_local), g.add("Relu", to_global)


def _up(g: Graph, state: Mapping[str, np.ndarray], conv: str, norm: str, x: str) -> str:
    """Transposed convolution, kernel 3, stride 2: twice the height and width.

    Output row 2i sees the input row i through tap 1, row 2i + 1 sees rows i and i + 1 through taps 2 and 0; so it is
    four small convolutions, one for each parity of row and column, and an interleaving. The same products, in
    convolutions that run at full speed where runtimes' transposed ones do not.
    """
    scale, shift = _affine(state, norm)
    weight = (state[f"{conv}.weight"] * scale[:, None, None]).astype(np.float32).swapaxes(0, 1)
    bias = (state[f"{conv}.bias"] * scale + shift).astype(np.float32)
    taps = ([1], [2, 0])
    parts = [
        g.conv(x, weight[:, :, taps[row]][:, :, :, taps[column]], bias, pads=[0, 0, row, column])
        for row in (0, 1)
        for column in (0, 1)
    ]
    return str(g.add("DepthToSpace", g.add("Relu", g.add("Concat", *parts, axis=1)), blocksize=2))


def _head(g: Graph, weight: np.ndarray, bias: np.ndarray, x: str) -> str:
    """The last convolution, four output pixels at a time: 3 output channels leave most of a vector unit idle, 12 do not.

    Convolution with stride 2 by a kernel one tap larger, its four copies shifted by a row, a column, or both; interleaved.
    """
    size = weight.shape[2] + 1
    shifted = np.zeros((2, 2, *weight.shape[:2], size, size), np.float32)
    for row in (0, 1):
        for column in (0, 1):
            shifted[row, column, :, :, row : size - 1 + row, column : size - 1 + column] = weight
    x = g.conv(g.reflect(x, 3), shifted.reshape(-1, *shifted.shape[3:]), np.tile(bias, 4), stride=2)
    return str(g.add("DepthToSpace", x, blocksize=2))


def _fold(state: Mapping[str, np.ndarray], weight: str, norm: str) -> tuple[np.ndarray, np.ndarray]:
    """Weight and bias of a convolution without bias and the batch norm after it (or after a sum it is part of)."""
    scale, shift = _affine(state, norm)
    return (state[weight] * scale[:, None, None, None]).astype(np.float32), shift.astype(np.float32)


def _affine(state: Mapping[str, np.ndarray], norm: str) -> tuple[np.ndarray, np.ndarray]:
    """A batch norm in eval mode as x * scale + shift, float64."""
    weight, bias, mean, variance = (
        state[f"{norm}.{name}"].astype(np.float64) for name in ("weight", "bias", "running_mean", "running_var")
    )
    scale = weight / np.sqrt(variance + EPSILON)
    return scale, bias - mean * scale
