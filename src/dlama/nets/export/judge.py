"""The judge's weights and metadata in -> an ONNX file out; needs numpy and onnx, no torch.

Inputs: context 1 x C x H x W and guesses K x 4 x H x W. Outputs: logits K x 3 x h x w and errors 1 x 2 x h x w, h = H / 4. K, H
and W are free, H and W multiples of 16. Large tensors are stored in half precision and computed with in single precision.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dlama.nets.architecture import (
    JUDGE_APART,
    JUDGE_ERRORS,
    JUDGE_HEADS,
    JUDGE_LOG_BOUNDS,
    JUDGE_STRIDE,
    JudgeSettings,
    judge_shapes,
    refuse_differences,
)
from dlama.nets.export.onnx_graph import Ends, Graph
from dlama.nets.whole_file import write_whole


def export_judge(
    settings: JudgeSettings, state: Mapping[str, np.ndarray], path: Path, metadata: Mapping[str, str]
) -> Path:
    """Write the ONNX file; equal input gives equal bytes.

    Raises ShapeError unless `state` (name -> float32 array) is that judge's; OutputError; MissingExtraError without onnx.
    """
    refuse_differences({name: a.shape for name, a in state.items()}, judge_shapes(settings), "judge")
    writer = _Writer(settings, state)
    logits, errors = writer.judge("context", "guesses")
    return write_whole(path, writer.model(logits, errors, metadata))


class _Writer:
    """Layers by their names in `state`, one after another into a graph."""

    def __init__(self, settings: JudgeSettings, state: Mapping[str, np.ndarray]) -> None:
        self.settings, self.state, self.g = settings, state, Graph()

    def judge(self, context: str, guesses: str) -> tuple[str, str]:
        """Names of the logits and of the errors."""
        g = self.g
        apart = g.add("Sub", guesses, g.add("ReduceMean", guesses, axes=[0], keepdims=1))
        both = g.add("Concat", guesses, g.add("Mul", apart, g.constant(JUDGE_APART)), axis=1)
        seen = self.conv("of_context", context, stride=JUDGE_STRIDE)
        h = self.residual("block1", g.add("Add", self.conv("of_guess", both, stride=JUDGE_STRIDE), seen))
        h = self.join("join1", g.add("Relu", h), self.pool_guesses(h))
        trunk = self.trunk(g.add("Relu", g.add("Concat", seen, self.pool_guesses(h), axis=1)))
        h = self.residual("block2", self.join("join2", g.add("Relu", h), g.add("Relu", trunk)))
        shared = self.pool_guesses(h)
        h = self.join("join3", g.add("Relu", h), shared)
        raw = self.conv("head", g.add("Relu", h))
        base, detail, depth = g.add("Split", raw, g.ints(*[1] * JUDGE_HEADS), outputs=3, axis=1)
        logits = g.add_named("logits", "Concat", base, detail, g.add("Add", detail, depth), axis=1)
        errors = self.conv("errors", g.add("Relu", g.add("Concat", trunk, shared, axis=1)))
        bounds = [g.constant(bound) for bound in JUDGE_LOG_BOUNDS]
        return logits, g.add_named("errors", "Clip", errors, *bounds)

    def trunk(self, x: str) -> str:
        """The U-Net of `nets.judge.Trunk`: 1 x C x h x w -> 1 x width x h x w."""
        g = self.g
        fine = self.conv("trunk.enter", x)
        middle = self.residual("trunk.block1", self.conv("trunk.down1", g.add("Relu", fine), stride=2))
        coarse = self.conv("trunk.down2", g.add("Relu", middle), stride=2)
        coarse = self.residual("trunk.block3", self.residual("trunk.block2", coarse, 2), 4)
        up = self.double_size(self.conv("trunk.up1", g.add("Relu", coarse)))
        middle = self.residual("trunk.blend1", g.add("Add", middle, up))
        up = self.double_size(self.conv("trunk.up2", g.add("Relu", middle)))
        return self.residual("trunk.blend2", g.add("Add", fine, up))

    def residual(self, name: str, x: str, dilation: int = 1) -> str:
        """`nets.judge.Residual`: x + conv(relu(conv(relu(x))))."""
        inner = self.conv(f"{name}.first", self.g.add("Relu", x), dilation=dilation)
        return str(self.g.add("Add", x, self.conv(f"{name}.second", self.g.add("Relu", inner))))

    def join(self, name: str, own: str, shared: str) -> str:
        """`nets.judge.Join`: K x own x h x w and 1 x shared x h x w -> K x out x h x w."""
        return str(self.g.add("Add", self.conv(f"{name}.own", own), self.conv(f"{name}.shared", shared)))

    def pool_guesses(self, h: str) -> str:
        """K x C x h x w -> 1 x 2C x h x w."""
        pools = [self.g.add(kind, h, axes=[0], keepdims=1) for kind in ("ReduceMean", "ReduceMax")]
        return str(self.g.add("Concat", *pools, axis=1))

    def double_size(self, x: str) -> str:
        """Twice the height and width, bilinear."""
        scales = self.g.constant([1, 1, 2, 2])
        how: dict[str, Any] = {"mode": "linear", "coordinate_transformation_mode": "half_pixel"}
        return str(self.g.add("Resize", x, "", scales, **how))

    def conv(self, name: str, x: str, stride: int = 1, dilation: int = 1) -> str:
        """A convolution with the state's weights of that name, stored as float16."""
        weight, bias = self.state[f"{name}.weight"], self.state.get(f"{name}.bias")
        kernel = weight.shape[2]
        reach = 0 if kernel == stride else dilation * (kernel // 2)
        layout: dict[str, Any] = {"kernel_shape": [kernel] * 2, "strides": [stride] * 2, "dilations": [dilation] * 2}
        stored = self.g.add("Cast", self.g.constant(weight, np.float16), to=1)
        biases = [] if bias is None else [self.g.constant(bias)]
        return str(self.g.add("Conv", x, stored, *biases, pads=[reach] * 4, **layout))

    def model(self, logits: str, errors: str, metadata: Mapping[str, str]) -> bytes:
        """The bytes of the ONNX file with these outputs and metadata."""
        import onnx

        s = self.settings
        inputs: Ends = {
            "context": (1, s.context_planes, "height", "width"),
            "guesses": ("count", s.guess_planes, "height", "width"),
        }
        outputs: Ends = {
            logits: ("count", JUDGE_HEADS, "rows", "columns"),
            errors: (1, JUDGE_ERRORS, "rows", "columns"),
        }
        model = self.g.model("judge", inputs, outputs, metadata)
        onnx.checker.check_model(model)
        return bytes(model.SerializeToString(deterministic=True))
