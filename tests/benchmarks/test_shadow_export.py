"""The shadow's U-Net as an ONNX file, against the torch module that it was made from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from dlama.errors import ShapeError
from dlama.models.network_file import NetworkFile
from dlama.perception.masks.click_network import SIDE, network
from shadow_export import OBJECT, export_shadow, read_shadow
from shadow_net import SHADOW_MULTIPLE, ShadowNet


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


def test_the_second_output(tmp_path: Path) -> None:
    """Oracle: means of torch's maps in the middle, 2 x 2 and 4 x 4, through two layers; the first output stays bit for bit."""
    network, rng = small_network(), np.random.default_rng(0)
    state = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    maps = list[torch.Tensor]()
    for up in (network.up4, network.up3, network.up2, network.up1):
        up.register_forward_hook(lambda module, given, out: maps.append(out))
    planes = torch.randn(2, 5, SIDE, SIDE)
    with torch.no_grad():
        network(planes)
    around = (
        (slice(each.shape[2] // 2 - px, each.shape[2] // 2 + px) for _ in range(2))
        for each, px in zip(maps, (1, 1, 2, 2))
    )
    seen = np.concatenate(
        [each[..., rows, columns].mean((2, 3)).numpy() for each, (rows, columns) in zip(maps, around)], 1
    )
    weights = [rng.normal(0, 1, shape).astype(np.float32) for shape in ((seen.shape[1], 16), (16,), (16, 1), (1,))]
    files = [
        NetworkFile(export_shadow(state | more, tmp_path / f"{len(more)}.onnx", {}))
        for more in ({}, dict(zip(OBJECT, weights)))
    ]
    (logits,), (same, found) = (file.run_all({"planes": planes.numpy()}) for file in files)
    np.testing.assert_array_equal(same, logits)
    expected = np.maximum(seen @ weights[0] + weights[1], 0) @ weights[2] + weights[3]
    np.testing.assert_allclose(found, expected, atol=1e-2 * np.abs(expected).max())


def test_a_file_that_is_read_and_written_again_is_the_same(tmp_path: Path) -> None:
    """Oracle: the graph and the weights of the click network that ships, from which its training continues."""
    for estimated in (True, False):
        path = network(estimated).path
        again = export_shadow(read_shadow(path), tmp_path / "again.onnx", {})
        assert onnx.load(str(again)).graph == onnx.load(str(path)).graph


def test_other_sides_are_refused() -> None:
    with pytest.raises(ShapeError, match="multiples of 32"):
        small_network()(torch.zeros(1, 5, 48, 64))
