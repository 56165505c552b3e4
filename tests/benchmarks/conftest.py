"""What only the benchmarks use (worlds for clicks, crops for shadows, the network that learns them) lies next to them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))


@pytest.fixture(scope="session")
def migan_pipeline(data_dir: Path) -> Path:
    """MI-GAN's published file; a test skips where it is not there."""
    path = data_dir / "weights" / "migan_pipeline_v2.onnx"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    return path
