"""The export of LPIPS, against the file that ships."""

from __future__ import annotations

from pathlib import Path

import onnx
import pytest

from dlama.errors import FileError
from dlama.evaluation.metrics.lpips import NETWORK
from lpips_export import export_lpips


def test_the_shipped_file_is_what_the_export_makes(weights_dir: Path, tmp_path: Path) -> None:
    """Round trip: the same nodes and constants from the weights as they lie in DLAMA_DATA."""
    files = [weights_dir / name for name in ("alexnet_features.safetensors", "lpips_alex_lin.safetensors")]
    made = onnx.load(export_lpips(files[0], files[1], tmp_path / "alex.onnx"))
    shipped = onnx.load(NETWORK)
    assert made.graph.SerializeToString(deterministic=True) == shipped.graph.SerializeToString(deterministic=True)


def test_other_weights_are_refused(weights_dir: Path, tmp_path: Path) -> None:
    """Trunk and heads exchanged: the file and the first missing tensor are named."""
    files = [weights_dir / name for name in ("alexnet_features.safetensors", "lpips_alex_lin.safetensors")]
    with pytest.raises(FileError, match=r"lpips_alex_lin.*features\.0\.weight is nothing"):
        export_lpips(files[1], files[0], tmp_path / "alex.onnx")
    assert not (tmp_path / "alex.onnx").exists()
