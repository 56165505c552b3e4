"""A small perceptron: its weights in an npz file, and rows of features, in; its outputs out."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from dlama.errors import FileError
from dlama.geometry.rgbd import Float32Array

PIECE = 1 << 8
"""Rows of one matrix product: so few that BLAS keeps it on one thread, since one split between threads has other last bits."""
P = TypeVar("P", bound="Perceptron")


@dataclass(frozen=True, eq=False)
class Perceptron:
    """Layers with ReLU between them, over features in standard deviations of the training data."""

    mean: Float32Array
    """F, of the training data."""
    spread: Float32Array
    """F, standard deviations."""
    layers: tuple[tuple[Float32Array, Float32Array], ...]
    """(in x out weights, out biases) of each layer."""

    @classmethod
    def of(
        cls: type[P],
        arrays: Mapping[str, np.ndarray],
        path: Path,
        *,
        layers: int,
        outputs: int,
        inputs: int | None = None,
        prefix: str = "",
    ) -> P:
        """From the fields `mean`, `spread`, `weight0`, `bias0`, ... of a file (`path`, for messages; `read_arrays`).

        FileError naming the first field that is missing, has a shape that does not fit, or holds what is no finite number.
        """

        def field(name: str, *shape: int | None) -> Float32Array:
            return check_field(arrays, path, prefix + name, shape)

        mean = field("mean", inputs)
        spread, width, found = field("spread", len(mean)), len(mean), []
        for number in range(layers):
            weight = field(f"weight{number}", width, outputs if number == layers - 1 else None)
            width = weight.shape[1]
            found.append((weight, field(f"bias{number}", width)))
        return cls(mean, spread, tuple(found))

    def outputs(self, features: Float32Array, reach: float) -> np.ndarray:
        """N x out from N x F features, clipped at `reach` standard deviations; the same bits for any number of threads."""
        out = np.empty((len(features), len(self.layers[-1][1])), np.float32)
        for start in range(0, len(features), PIECE):
            h = np.clip((features[start : start + PIECE] - self.mean) / self.spread, -reach, reach)
            for number, (weight, bias) in enumerate(self.layers):
                h = (np.maximum(h, 0) if number else h) @ weight + bias
            out[start : start + PIECE] = h
        return out

    def arrays(self, prefix: str = "") -> dict[str, Float32Array]:
        """The fields of an npz file that `of` reads."""
        out = {f"{prefix}mean": self.mean, f"{prefix}spread": self.spread}
        for number, (weight, bias) in enumerate(self.layers):
            out |= {f"{prefix}weight{number}": weight, f"{prefix}bias{number}": bias}
        return {name: array.astype(np.float32) for name, array in out.items()}


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All fields of an npz file. FileError where it is missing, truncated or none."""
    try:
        with np.load(io.BytesIO(path.read_bytes())) as file:
            return dict(file)
    except Exception as error:  # NumPy's on damaged files share no class
        raise FileError(f"{path}: cannot be read as a file of weights ({error}); reinstall dlama") from error


def check_field(arrays: Mapping[str, np.ndarray], path: Path, name: str, shape: Sequence[int | None]) -> Float32Array:
    """One field of a file, if it is finite floats of that shape (None: any size); else FileError."""
    if name not in arrays:
        raise FileError(f"{path}: has no field `{name}`; reinstall dlama")
    found = arrays[name]
    fits = found.ndim == len(shape) and all(want in (None, has) for want, has in zip(shape, found.shape))
    if not fits or found.dtype.kind != "f" or not np.isfinite(found).all():
        expected = " x ".join("any" if want is None else str(want) for want in shape)
        raise FileError(
            f"{path}: field `{name}` is {found.dtype} of shape {found.shape}; {expected} finite floats are expected; "
            "reinstall dlama"
        )
    return found.astype(np.float32)
