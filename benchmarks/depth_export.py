"""The published small network of TCMonoDepth (ONNX, 192 x 320 alone) in -> the same network for any multiples of 16 out.

The file that ships (src/dlama/assets/tcmonodepth/tcmonodepth-small.onnx) was made by

    python benchmarks/depth_export.py tcmonodepth-small-192x320.onnx tcmonodepth-small.onnx

which needs the package onnx. Weights and arithmetic stay as they are: at 192 x 320 the output is the same to the bit. The size
stands in two places of the published graph: in the reshapes of ShuffleNet's channel shuffle, which become a choice of the even
and of the odd channels, and in the sizes that the decoder enlarges to, which become factors of two.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import FileError
from dlama.writing.atomic_write import write_file

PUBLISHED = "902b886beaebd3f68deb40bab2fd636a0c112c1ef1cbdd15fa26e5c55b389b4d"
"""SHA-256 of the published file."""


def export_depth(published: Path, target: Path) -> Path:
    """Write the ONNX file, first under a temporary name. Equal input gives equal bytes. FileError for any other network."""
    import onnx

    data = published.read_bytes()
    found = hashlib.sha256(data).hexdigest()
    if found != PUBLISHED:
        raise FileError(f"{published}: sha256 is {found}; {PUBLISHED} is expected")
    model = free_size(onnx.load_from_string(data))
    onnx.checker.check_model(model)
    write_file(target, model.SerializeToString(deterministic=True))
    return target


def free_size(model: Any) -> Any:
    """The network (onnx.ModelProto, changed in place): ShuffleNet's blocks and a decoder that doubles, for any size."""
    from onnx import TensorProto, helper, numpy_helper

    graph = model.graph
    made_by = {out: node for node in graph.node for out in node.output}
    channels = {
        value.name: value.type.tensor_type.shape.dim[1].dim_value
        for value in graph.value_info
        if len(value.type.tensor_type.shape.dim) == 4
    }
    constants: dict[str, np.ndarray] = {"factors": np.float32([1, 1, 2, 2])}
    nodes = []
    for node in graph.node:
        if node.op_type == "Split":  # of a reshape of a transposition of a reshape: even channels, odd channels
            shuffled = made_by[made_by[made_by[node.input[0]].input[0]].input[0]].input[0]
            for half, out in enumerate(node.output):
                name = f"channels_{half}_{channels[shuffled]}"
                constants[name] = np.arange(half, channels[shuffled], 2, dtype=np.int64)
                nodes.append(helper.make_node("Gather", [shuffled, name], [out], name=f"{node.name}_{half}", axis=1))
        elif node.op_type == "Resize":
            node.input[:] = [*node.input[:2], "factors"]
            nodes.append(node)
        elif node.op_type not in ("Reshape", "Transpose"):
            nodes.append(node)
    used = {name for node in nodes for name in node.input}
    weights = [weight for weight in graph.initializer if weight.name in used]
    source, target = (
        helper.make_tensor_value_info(end.name, TensorProto.FLOAT, [1, planes, "h", "w"])
        for end, planes in ((graph.input[0], 3), (graph.output[0], 1))
    )
    del graph.node[:], graph.initializer[:], graph.value_info[:], graph.input[:], graph.output[:]
    graph.node.extend(nodes)
    graph.initializer.extend([*weights, *(numpy_helper.from_array(array, name) for name, array in constants.items())])
    graph.input.append(source)
    graph.output.append(target)
    return model


if __name__ == "__main__":
    export_depth(*(Path(argument) for argument in sys.argv[1:3]))
