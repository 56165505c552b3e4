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
from dlama.models.perceptron import Perceptron, read_arrays
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
    found = Perceptron.of(read_arrays(path), path, layers=2, outputs=2, prefix="one.")
    np.testing.assert_allclose(found.outputs(features, 3.0), one.outputs(features, 3.0), rtol=1e-4, atol=1e-5)


SUMS = """
import hashlib, numpy as np
from dlama.inpainters.confidence import FEATURES, confidence_network
rows = np.random.default_rng(0).normal(size=(5000, FEATURES)).astype(np.float32)
print(hashlib.sha256(confidence_network().outputs(rows, 3.0)).hexdigest())
"""


def test_outputs_are_the_same_bits_for_any_number_of_threads() -> None:
    """Law: processes whose BLAS has one thread, or two, agree. A worker of a batch has one, a single command all cores."""
    commands = [os.environ | {"OPENBLAS_NUM_THREADS": count, "MKL_NUM_THREADS": count} for count in "12"]
    found = [subprocess.run([sys.executable, "-c", SUMS], env=env, capture_output=True, check=True) for env in commands]
    assert found[0].stdout == found[1].stdout


@pytest.mark.parametrize(("shipped", "read", "field"), SHIPPED, ids=["confidence", "shadow"])
def test_damaged_files_are_named(shipped: Path, read: Callable[[Path], Any], field: str, tmp_path: Path) -> None:
    """Cut at every tenth, empty, an npy file, missing; without one field; with one of another shape, type, or nan."""
    whole, path = shipped.read_bytes(), tmp_path / "weights.npz"
    npy = io.BytesIO()
    np.save(npy, np.zeros(3))
    for content in (*(whole[: len(whole) * part // 10] for part in range(10)), npy.getvalue(), b"<html>"):
        path.write_bytes(content)
        with pytest.raises(FileError, match=r"weights\.npz: cannot be read as a file of weights"):
            read.__wrapped__(path)  # type: ignore[attr-defined]
    with pytest.raises(FileError, match=r"none\.npz: cannot be read"):
        read(tmp_path / "none.npz")
    arrays = read_arrays(shipped)
    without = {name: values for name, values in arrays.items() if name != field}
    with pytest.raises(FileError, match=rf"weights\.npz: has no field {field}"):
        read.__wrapped__(saved(path, without))  # type: ignore[attr-defined]
    for wrong in (arrays[field][:-1], arrays[field].astype(np.int32), np.full_like(arrays[field], np.nan)):
        with pytest.raises(FileError, match=rf"weights\.npz: field {field} is .* finite floats are expected"):
            read.__wrapped__(saved(path, {**arrays, field: wrong}))  # type: ignore[attr-defined]
