"""MI-GAN's generator as the torch module that is tuned (oracle: ONNX Runtime)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from dlama.inpainters import model_file

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from painter_network import Generator  # noqa: E402

SHIPPED = model_file("migan")


def painted_by(path: Path, planes: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(None, {"planes": planes})[0]


def test_the_module_paints_as_the_file_and_a_written_file_as_the_module(tmp_path: Path) -> None:
    """Within a hundredth of a level; unchanged, the same bits as the file it began with; changed, what the module paints."""
    planes = np.random.default_rng(0).random((1, 4, 128, 256), np.float32)
    planes[:, 3] = 0
    planes[:, 3, 30:100, 60:200] = 1
    planes[:, :3] *= 1 - planes[:, 3:]
    module, path, shipped = Generator(SHIPPED), tmp_path / "tuned.onnx", painted_by(SHIPPED, planes)
    with torch.no_grad():
        np.testing.assert_allclose(module(torch.from_numpy(planes)).numpy() * 255, shipped * 255, atol=0.01)
    module.write(SHIPPED, path)
    np.testing.assert_array_equal(painted_by(path, planes), shipped)
    with torch.no_grad():
        for one in module.parameters():
            one.mul_(0.9)
        found = module(torch.from_numpy(planes)).numpy()
    module.write(SHIPPED, path)
    assert abs(found - shipped).max() > 0.1
    np.testing.assert_allclose(found, painted_by(path, planes), atol=0.01)  # weights in half precision
