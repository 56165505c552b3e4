"""The ONNX file is the same network, at any size it takes, and says what it is."""

from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from dlama.errors import OutputError
from dlama.nets.architecture import GeneratorSettings
from dlama.nets.checkpoints import read_generator
from dlama.nets.export.generator import export_onnx, onnx_bytes
from dlama.nets.export.onnx_graph import Graph, plane_transform
from dlama.nets.generator import generator_from_state

SIZES = [(16, 16), (16, 136), (40, 72), (104, 24)]


def _session(model: bytes):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def test_the_exported_network_agrees_with_the_published_code(tmp_path, vector_file, generator_vector):
    """Oracle: frozen vector, no torch in between."""
    path = export_onnx(read_generator(vector_file), tmp_path / "small.onnx", {})
    onnx.checker.check_model(str(path), full_check=True)
    output = _session(path.read_bytes()).run(None, {"planes": generator_vector[1]["input"]})[0]
    np.testing.assert_allclose(output, generator_vector[1]["output"], rtol=0, atol=1e-6)
    assert [file.name for file in tmp_path.iterdir()] == ["small.onnx"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        GeneratorSettings(4, 3, 8, 3, 3),
        GeneratorSettings(5, 4, 8, 3, 2, 0.5),
        GeneratorSettings(7, 6, 8, 2, 2, 0.75, "tanh"),
    ],
)
def test_parity_with_torch_at_every_size(random_state, settings):
    """Oracle: the torch modules in float32; sizes not square, no powers of two, and below the receptive field."""
    state = random_state(settings)
    net = generator_from_state(state, settings.activation)
    session = _session(onnx_bytes(settings, state, {}))
    rng = np.random.default_rng(0)
    for height, width in SIZES:
        planes = rng.random((2, settings.in_channels, height, width), dtype=np.float32)
        with torch.inference_mode():
            expected = net(torch.from_numpy(planes)).numpy()
        output = session.run(None, {"planes": planes})[0]
        assert expected.std() > 0.1
        np.testing.assert_allclose(output, expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize(("height", "width"), [(2, 2), (3, 5), (5, 8), (16, 9), (63, 64), (130, 96), (257, 300)])
def test_the_transform_is_the_fourier_transform(height, width):
    """Oracle: numpy's rfft2 and irfft2, the inverse on a spectrum that no real picture has."""
    g = Graph()
    transform = plane_transform(g, "x", 3)
    spectrum = g.add_named("spectrum", "Identity", transform.forward(g, "x"))
    g.add_named("back", "Identity", transform.inverse(g, g.add("Relu", spectrum)))
    ends = {"spectrum": ("b", 6, "h", "m"), "back": ("b", 3, "h", "w")}
    model = g.model("transform", {"x": ("b", 3, "h", "w")}, ends, {})
    x = np.random.default_rng(1).normal(size=(2, 3, height, width)).astype(np.float32)
    came, back = _session(model.SerializeToString()).run(None, {"x": x})
    expected = np.fft.rfft2(x.astype(np.float64), norm="ortho")
    np.testing.assert_allclose(came[:, 0::2], expected.real, rtol=0, atol=5e-6)
    np.testing.assert_allclose(came[:, 1::2], expected.imag, rtol=0, atol=5e-6)
    positive = np.maximum(expected.real, 0) + 1j * np.maximum(expected.imag, 0)
    again = np.fft.irfft2(positive, s=(height, width), norm="ortho")
    np.testing.assert_allclose(back, again, rtol=0, atol=1e-6 * max(np.abs(again).max(), 1))


def test_the_file_carries_its_metadata(tmp_path, vector_file):
    """Oracle: what was handed in; one input, one output, sizes free."""
    words = {"dlama.contract": '{"version": 1}', "licence": "Apache-2.0"}
    session = _session(export_onnx(read_generator(vector_file), tmp_path / "small.onnx", words).read_bytes())
    assert session.get_modelmeta().custom_metadata_map == words
    assert [(end.name, end.shape) for end in (*session.get_inputs(), *session.get_outputs())] == [
        ("planes", ["batch", 4, "height", "width"]),
        ("filled", ["batch", 3, "height", "width"]),
    ]


def test_a_folder_that_is_not_there_is_named(tmp_path, vector_file):
    """Oracle: the documentation."""
    with pytest.raises(OutputError, match="cannot be written"):
        export_onnx(read_generator(vector_file), tmp_path / "missing" / "small.onnx", {})
