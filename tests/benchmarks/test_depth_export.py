"""The depth network that ships, against the published file of one size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from depth_export import export_depth
from dlama.errors import FileError
from dlama.models.network_file import NetworkFile
from dlama.perception.depth_networks import DepthContract, predict
from dlama.perception.monocular import SHIPPED


def test_the_file_that_ships_is_the_published_one_at_any_multiple_of_16(data_dir: Path, tmp_path: Path) -> None:
    """Oracle: the published file, of 192 x 320, to the bit; and the shipped file's own bytes."""
    published = data_dir / "weights" / "tcmonodepth_tcsmallnet_192x320.onnx"
    if not published.is_file():
        pytest.skip(f"{published} is not there")
    color = np.random.default_rng(2).integers(0, 256, (192, 320, 3), np.uint8)
    contract = DepthContract("inverse depth", scale=1.0, side=192, multiple=16)
    ours, theirs = (predict(NetworkFile(path), contract, color).values for path in (SHIPPED, published))
    np.testing.assert_array_equal(ours, theirs)
    assert predict(NetworkFile(SHIPPED), contract, color[:, :224]).values.shape == (192, 224)
    assert export_depth(published, tmp_path / "made.onnx").read_bytes() == SHIPPED.read_bytes()
    with pytest.raises(FileError, match=r"made\.onnx: sha256 is"):
        export_depth(tmp_path / "made.onnx", tmp_path / "again.onnx")
