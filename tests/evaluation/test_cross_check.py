"""The harness against an independent implementation's published numbers, on real pictures."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "cross_check.py"


@pytest.mark.slow
def test_the_papers_recipe_to_the_letter(data_dir: Path) -> None:
    """Oracle: somebody else's code. Mask ratio, SSIM, LPIPS and MSE of colour and depth at ±10 degrees, four scenes."""
    asked = [str(data_dir / "street"), "--yaws", "10", "--ways", "to the letter"]
    done = subprocess.run([sys.executable, str(SCRIPT), *asked], capture_output=True, text=True, check=True)
    found = re.search(r"farthest from the reference: ([\d.]+) %", done.stdout)
    assert found is not None, done.stdout
    assert float(found[1]) < 0.5, done.stdout
    assert len(re.findall(r" x[\d.]+", done.stdout)) == 7
