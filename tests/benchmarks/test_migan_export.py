"""MI-GAN's generator removed of the published pipeline (oracle: the nodes of that file themselves, run by ONNX Runtime)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest

import migan_export
from dlama.inpainters import model_file
from dlama.inpainters.networks.engine import open_engine

FED, GIVES = "/Concat_23_output_0", "/model/synthesis/b512/Add_1_output_0"
"""Of the published graph: what its generator takes (0.5 = keep, -0.5 = fill; known colour in -1..1) and gives (-1..1)."""


def published_generator(migan_pipeline: Path) -> Any:
    """The nodes between FED and GIVES, untouched."""
    model = onnx.load(str(migan_pipeline))
    made_by = {name: number for number, node in enumerate(model.graph.node) for name in node.output}
    needed: set[int] = set()
    todo = [GIVES]
    while todo:
        number = made_by.get(todo.pop())
        if number is not None and number not in needed:
            needed.add(number)
            todo += [name for name in model.graph.node[number].input if name != FED]
    ends = [
        [onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, planes, 512, 512])]
        for name, planes in ((FED, 4), (GIVES, 3))
    ]
    nodes = [model.graph.node[number] for number in sorted(needed)]
    graph = onnx.helper.make_graph(nodes, "published", *ends, model.graph.initializer)
    return onnx.helper.make_model(graph, opset_imports=model.opset_import, ir_version=8).SerializeToString()


def run(model: bytes, planes: np.ndarray) -> np.ndarray:
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {session.get_inputs()[0].name: planes})[0])


@pytest.fixture(scope="module")
def example() -> tuple[np.ndarray, np.ndarray]:
    """3 x 512 x 512 colours in 0..1 that vary smoothly, and a hole."""
    rng = np.random.default_rng(0)
    small = rng.random((3, 9, 9), np.float32)
    rows = np.linspace(0, 7.99, 512)
    low, share = rows.astype(int), (rows % 1).astype(np.float32)
    tall = small[:, low] * (1 - share[:, None]) + small[:, low + 1] * share[:, None]
    picture = tall[:, :, low] * (1 - share) + tall[:, :, low + 1] * share
    hole = np.zeros((512, 512), bool)
    hole[150:300, 200:360] = hole[400:420, 20:480] = True
    return picture.astype(np.float32), hole


@pytest.fixture(scope="module")
def truth(migan_pipeline: Path, example: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """3 x 512 x 512 colours in 0..1 of the published generator."""
    picture, hole = example
    fed = np.concatenate([(~hole - np.float32(0.5))[None], (2 * picture - 1) * ~hole])[None].astype(np.float32)
    return np.clip(run(published_generator(migan_pipeline), fed)[0] / 2 + 0.5, 0, 1)


@pytest.mark.slow
def test_the_file_that_training_begins_at(
    migan_pipeline: Path, example: tuple[np.ndarray, np.ndarray], truth: np.ndarray, tmp_path: Path
) -> None:
    """Half precision costs a tenth of a grey level; the tuned file that ships has its graph, at most 15 MB of it."""
    shipped = model_file("migan")
    assert shipped is not None and shipped.stat().st_size < 15e6
    made = migan_export.export_migan(
        migan_pipeline, tmp_path / "migan-512.onnx", migan_export.migan_metadata(migan_pipeline, "MIT")
    )
    graphs = [onnx.load(path).graph for path in (made, shipped)]
    assert graphs[0].node == graphs[1].node
    picture, hole = example
    filled = open_engine(made).fill(picture[None], hole)[0]
    assert np.array_equal(filled[:, ~hole], picture[:, ~hole])
    error = abs(np.clip(filled, 0, 1) - truth)[:, hole] * 255
    assert error.mean() < 0.1 and np.percentile(error, 99) < 1
