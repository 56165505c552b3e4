"""A small perceptron: its weights in an npz file, and rows of features, in; its outputs out."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from dlama.errors import FileError, any_error
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
    def of(cls: type[P], path: Path, prefix: str = "") -> P:
        """From the fields `mean`, `spread`, `weight0`, `bias0`, `weight1`, ... of an npz file. FileError where it is damaged."""
        with any_error(FileError, f"{path}: cannot be read as a file of weights; reinstall dlama"):
            with np.load(io.BytesIO(path.read_bytes())) as file:
                field = {name.removeprefix(prefix): file[name] for name in file if name.startswith(prefix)}
            count = sum(name.startswith("weight") for name in field)
            layers = tuple((field[f"weight{number}"], field[f"bias{number}"]) for number in range(count))
            return cls(field["mean"], field["spread"], layers)

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
