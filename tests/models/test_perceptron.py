"""A perceptron's file: a round trip, and damage of every kind with a message that names file and field."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.errors import FileError
from dlama.inpainters.confidence import WEIGHTS, confidence_network
from dlama.models.perceptron import Perceptron
from dlama.perception.shadows.classifier import MODEL, classifiers

SHIPPED: list[tuple[Path, Callable[[Path], Any], str]] = [
    (WEIGHTS, confidence_network, "bias1"),
    (MODEL, classifiers, "pixel.bias2"),
]


def made(seed: int = 0) -> Perceptron:
    rng = np.random.default_rng(seed)
    layers = tuple((rng.normal(size=(a, b)), rng.normal(size=b)) for a, b in ((5, 4), (4, 2)))
    return Perceptron(rng.normal(size=5), rng.uniform(1, 2, 5), layers)


def saved(path: Path, arrays: dict[str, np.ndarray]) -> Path:
    np.savez(path, **arrays)
    return path


def test_what_is_written_is_read(tmp_path: Path) -> None:
    """Round trip, next to fields of another one."""
    one, features = made(), np.random.default_rng(1).normal(size=(7, 5))
    path = saved(tmp_path / "two.npz", {**one.arrays("one."), **made(2).arrays("two.")})
    found = Perceptron.of(path, "one.")
    np.testing.assert_allclose(found.outputs(features, 3.0), one.outputs(features, 3.0), rtol=1e-4, atol=1e-5)


SUMS = """
import hashlib, numpy as np
from dlama.inpainters.confidence import FEATURES, confidence_network
rows = np.random.default_rng(0).normal(size=(5000, FEATURES)).astype(np.float32)
print(hashlib.sha256(confidence_network().outputs(rows, 3.0)).hexdigest())
"""


@pytest.mark.slow
def test_outputs_are_the_same_bits_for_any_number_of_threads() -> None:
    """Law: processes whose BLAS has one thread, or two, agree. A worker of a batch has one, a single command all cores."""
    commands = [os.environ | {"OPENBLAS_NUM_THREADS": count, "MKL_NUM_THREADS": count} for count in "12"]
    found = [subprocess.run([sys.executable, "-c", SUMS], env=env, capture_output=True, check=True) for env in commands]
    assert found[0].stdout == found[1].stdout


@pytest.mark.parametrize(("shipped", "read", "field"), SHIPPED, ids=["confidence", "shadow"])
def test_damaged_files_are_named(shipped: Path, read: Callable[[Path], Any], field: str, tmp_path: Path) -> None:
    """Cut at every tenth, an npy file, no weights at all, missing, without one field."""
    whole, path = shipped.read_bytes(), tmp_path / "weights.npz"
    npy = io.BytesIO()
    np.save(npy, np.zeros(3))
    cut = saved(tmp_path / "cut.npz", {name: values for name, values in np.load(shipped).items() if name != field})
    contents = [whole[: len(whole) * part // 10] for part in range(10)]
    for content in (*contents, npy.getvalue(), b"<html>", cut.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(FileError, match=r"weights\.npz: cannot be read as a file of weights; reinstall dlama"):
            read.__wrapped__(path)  # type: ignore[attr-defined]
    with pytest.raises(FileError, match=r"none\.npz: cannot be read"):
        read(tmp_path / "none.npz")
