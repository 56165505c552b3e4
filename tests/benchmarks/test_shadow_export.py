"""The shadow's U-Net as an ONNX file, against the torch module that it was made from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dlama.errors import ShapeError
from dlama.models.network_file import NetworkFile

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from dlama.perception.masks.click_network import network  # noqa: E402
from shadow_export import export_shadow, read_shadow  # noqa: E402
from shadow_net import SHADOW_MULTIPLE, ShadowNet  # noqa: E402


def small_network() -> ShadowNet:
    """Random weights and batch norms that are no identity."""
    torch.manual_seed(0)
    network = ShadowNet(5)
    for layer in network.modules():
        if isinstance(layer, torch.nn.BatchNorm2d):
            layer.running_mean.normal_(0, 0.1)
            layer.running_var.uniform_(0.5, 2)
            layer.weight.data.uniform_(0.5, 1.5)
            layer.bias.data.normal_(0, 0.1)
    return network.eval()


def test_the_file_says_what_the_module_says(tmp_path: Path) -> None:
    """Oracle: torch, up to the half precision of the weights; equal weights give equal bytes."""
    network = small_network()
    state = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    file = export_shadow(state, tmp_path / "shadow.onnx", {"dlama.what": "a test"})
    planes = torch.randn(2, 5, SHADOW_MULTIPLE, 2 * SHADOW_MULTIPLE)
    with torch.no_grad():
        expected = network(planes).numpy()
    opened = NetworkFile(file)
    np.testing.assert_allclose(opened.run({"planes": planes.numpy()}), expected, atol=2e-3)
    assert opened.metadata["dlama.what"] == "a test"
    again = export_shadow(state, tmp_path / "again.onnx", {"dlama.what": "a test"})
    assert file.read_bytes() == again.read_bytes()


def test_a_file_that_is_read_and_written_again_is_the_same(tmp_path: Path) -> None:
    """Oracle: the graph and the weights of the click network that ships, from which its training goes on."""
    for estimated in (True, False):
        path = network(estimated).path
        again = export_shadow(read_shadow(path), tmp_path / "again.onnx", {})
        assert onnx.load(str(again)).graph == onnx.load(str(path)).graph


def test_other_sides_are_refused() -> None:
    with pytest.raises(ShapeError, match="multiples of 32"):
        small_network()(torch.zeros(1, 5, 48, 64))
