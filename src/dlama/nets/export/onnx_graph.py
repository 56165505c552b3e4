"""Nodes added one by one in -> an ONNX model out; and the Fourier transform of a whole plane as matrix products.

No torch exporter is used: the graph is written node by node. The
discrete Fourier transform is linear, so `rfft2` and `irfft2` are two matrix products each; their matrices depend on
height and width only, are built inside the graph from the input's own size, once, and serve every layer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dlama.errors import import_extra

OPSET = 17
IR_VERSION = 8
Ends = Mapping[str, Sequence[int | str]]
"""Float32 tensors by name, with their sides; a side of any length has a name."""


@dataclass
class Graph:
    """A graph under construction; every method returns the name of the tensor it made."""

    nodes: list[Any] = field(default_factory=list)
    constants: dict[str, np.ndarray] = field(default_factory=dict)
    small: dict[tuple[str, bytes], str] = field(default_factory=dict)

    def constant(self, value: Any, dtype: Any = np.float32) -> str:
        """A constant tensor; equal small ones are kept once."""
        array = np.ascontiguousarray(value, dtype).reshape(np.shape(value))
        key = (
            f"{array.dtype}{array.shape}",
            array.tobytes() if array.size <= 16 else str(len(self.constants)).encode(),
        )
        if key not in self.small:
            self.small[key] = f"c{len(self.constants)}"
            self.constants[self.small[key]] = array
        return self.small[key]

    def ints(self, *values: int) -> str:
        """A constant vector of int64."""
        return self.constant(list(values), np.int64)

    def add(self, kind: str, *inputs: str, outputs: int = 1, **attributes: Any) -> Any:
        """One node; a name, or a list of names where it has more outputs."""
        names = [f"t{len(self.nodes)}{'abcdef'[i] if outputs > 1 else ''}" for i in range(outputs)]
        self.nodes.append(_onnx().helper.make_node(kind, inputs, names, name=f"{kind}{len(self.nodes)}", **attributes))
        return names[0] if outputs == 1 else names

    def add_named(self, name: str, kind: str, *inputs: str, **attributes: Any) -> str:
        """One node whose only output has that name: for the ends of the graph."""
        self.nodes.append(_onnx().helper.make_node(kind, inputs, [name], name=name, **attributes))
        return name

    def conv(
        self, x: str, weight: np.ndarray, bias: np.ndarray | None = None, stride: int = 1, **attributes: Any
    ) -> str:
        """Convolution without padding (unless `pads` is given) of B x i x H x W with o x i x k x k."""
        biases = [] if bias is None else [self.constant(bias)]
        kernel = list(weight.shape[2:])
        return str(
            self.add("Conv", x, self.constant(weight), *biases, kernel_shape=kernel, strides=[stride] * 2, **attributes)
        )

    def reflect(self, x: str, by: int) -> str:
        """Height and width grown by that many reflected pixels on each side."""
        return str(self.add("Pad", x, self.ints(0, 0, by, by, 0, 0, by, by), mode="reflect"))

    def sides(self, x: str) -> tuple[str, str]:
        """Height and width of B x C x H x W, int64 vectors of one element."""
        shape = self.add("Shape", x)
        height, width = (self.add("Slice", shape, self.ints(axis), self.ints(axis + 1)) for axis in (2, 3))
        return height, width

    def model(self, name: str, inputs: Ends, outputs: Ends, about: Mapping[str, str]) -> Any:
        """The finished onnx.ModelProto, `about` as metadata."""
        onnx = _onnx()
        helper, kind = onnx.helper, onnx.TensorProto.FLOAT
        tensors = [onnx.numpy_helper.from_array(array, name) for name, array in self.constants.items()]
        ends = [
            [helper.make_tensor_value_info(end, kind, list(shape)) for end, shape in each.items()]
            for each in (inputs, outputs)
        ]
        graph = helper.make_graph(self.nodes, name, *ends, tensors)
        opset = [helper.make_opsetid("", OPSET)]
        model = helper.make_model(graph, opset_imports=opset, ir_version=IR_VERSION, producer_name="dlama")
        helper.set_model_props(model, dict(about))
        return model


@dataclass(frozen=True)
class PlaneTransform:
    """Names of the matrices and shapes that transform planes of one size; made by `plane_transform`.

    With n = H or W, the half spectrum has m = W // 2 + 1 columns. The rows of a complex H x m plane are stacked real
    over imaginary where channels are convolved (the order of the published weights), and interleaved row by row
    where the width is transformed, so that every change of layout is a free reshape and never a copy.
    """

    width_in: str
    """W x 2m: real rows to real | imaginary."""
    height_in: str
    """2H x 2H: interleaved rows to stacked ones, forward."""
    height_out: str
    """2H x 2H: stacked rows to interleaved ones, inverse."""
    width_out: str
    """2m x W: real | imaginary to real rows."""
    rows: str
    """Shape B x C x 2H x m."""
    spectrum: str
    """Shape B x 2C x H x m."""
    pairs: str
    """Shape B x C x H x 2m."""

    def forward(self, g: Graph, x: str) -> str:
        """B x C x H x W -> its orthonormal half spectrum B x 2C x H x m, channels real, imaginary, real, ..."""
        x = g.add("Reshape", g.add("MatMul", x, self.width_in), self.rows)
        return str(g.add("Reshape", g.add("MatMul", self.height_in, x), self.spectrum))

    def inverse(self, g: Graph, spectrum: str) -> str:
        """The way back, as irfft2 does it: the imaginary parts of the columns 0 and W/2 are not used."""
        x = g.add("MatMul", self.height_out, g.add("Reshape", spectrum, self.rows))
        return str(g.add("MatMul", g.add("Reshape", x, self.pairs), self.width_out))


def plane_transform(g: Graph, x: str, channels: int) -> PlaneTransform:
    """Matrices for planes of the height and width of `x` (B x any x H x W), built inside the graph."""
    height, width = g.sides(x)
    half = g.add("Add", g.add("Div", width, g.ints(2)), g.ints(1))
    rows, columns, some = _range(g, height), _range(g, width), _range(g, half)
    cos_w, sin_w = _cos_and_sin(g, columns, some, width)
    minus_w = g.add("Neg", sin_w)
    width_in = g.add("Concat", cos_w, minus_w, axis=1)
    twice = _conjugate_weight(g, some, width)
    parts = [g.add("Mul", g.add("Transpose", part, perm=[1, 0]), twice) for part in (cos_w, minus_w)]
    width_out = g.add("Concat", *parts, axis=0)
    cos_h, sin_h = _cos_and_sin(g, rows, rows, height)
    minus_h = g.add("Neg", sin_h)
    forward = _complex_matrix(g, ((cos_h, sin_h), (minus_h, cos_h)), height, stack=0, pair=1)
    inverse = _complex_matrix(g, ((cos_h, minus_h), (sin_h, cos_h)), height, stack=1, pair=0)
    two_h, two_m = (g.add("Mul", side, g.ints(2)) for side in (height, half))
    shapes = [(g.ints(channels), two_h, half), (g.ints(2 * channels), height, half), (g.ints(channels), height, two_m)]
    named = [g.add("Concat", g.ints(0), *shape, axis=0) for shape in shapes]
    return PlaneTransform(width_in, forward, inverse, width_out, *named)


def _range(g: Graph, side: str) -> str:
    """0, 1, ..., side - 1 as int64."""
    scalar = g.add("Squeeze", side, g.ints(0))
    return str(g.add("Range", g.constant(0, np.int64), scalar, g.constant(1, np.int64)))


def _cos_and_sin(g: Graph, a: str, b: str, side: str) -> tuple[str, str]:
    """cos and sin of 2 pi a b / side over sqrt(side), len(a) x len(b).

    The product is reduced to -side/2 .. side/2 while it is still an integer: float32 then holds the angle to 1e-7
    for any size.
    """
    product = g.add("Mul", g.add("Unsqueeze", a, g.ints(1)), b)
    middle = g.add("Div", side, g.ints(2))
    reduced = g.add("Sub", g.add("Mod", g.add("Add", product, middle), side), middle)
    length = g.add("Cast", side, to=1)
    angle = g.add("Mul", g.add("Div", g.add("Cast", reduced, to=1), length), g.constant([2 * math.pi]))
    scale = g.add("Sqrt", length)
    return g.add("Div", g.add("Cos", angle), scale), g.add("Div", g.add("Sin", angle), scale)


def _conjugate_weight(g: Graph, columns: str, width: str) -> str:
    """m x 1: 2 for columns that stand for themselves and their conjugate, 1 for column 0 and column W/2."""
    doubled = g.add("Mul", columns, g.ints(2))
    alone = g.add("Equal", g.add("Mod", doubled, width), g.ints(0))
    return str(g.add("Unsqueeze", g.add("Where", alone, g.constant([1.0]), g.constant([2.0])), g.ints(1)))


def _complex_matrix(g: Graph, rows: tuple[tuple[str, str], tuple[str, str]], height: str, stack: int, pair: int) -> str:
    """2H x 2H of four H x H parts; 1 interleaves (rows on `stack`, columns on `pair`), 0 keeps the parts contiguous."""
    across = [_join_flat(g, parts, 1 + pair, height, (1, 2)) for parts in rows]
    return _join_flat(g, (across[0], across[1]), stack, height, (2, 2))


def _join_flat(g: Graph, parts: tuple[str, str], axis: int, height: str, times: tuple[int, int]) -> str:
    """Two matrices joined along a new axis, which is then flattened away."""
    both = g.add("Concat", *(g.add("Unsqueeze", part, g.ints(axis)) for part in parts), axis=axis)
    return str(g.add("Reshape", both, g.add("Mul", g.add("Concat", height, height, axis=0), g.ints(*times))))


def _onnx() -> Any:
    return import_extra("onnx", "writing an ONNX file", "onnx", "onnx")
