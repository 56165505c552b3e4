"""Fixtures of the network tests: the frozen vectors, and small generators with random weights of full contrast."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dlama.nets.architecture import GeneratorSettings, generator_shapes
from dlama.nets.safetensors_file import read_safetensors

VECTORS = Path(__file__).parents[1] / "data" / "lama_vectors"


def _state_of(file: str) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    arrays, _, _ = read_safetensors(VECTORS / file)
    state = {name.removeprefix("state."): array for name, array in arrays.items() if name.startswith("state.")}
    return state, {name: array for name, array in arrays.items() if not name.startswith("state.")}


@pytest.fixture(scope="session")
def vector_file() -> Path:
    """The generator vector's file."""
    return VECTORS / "lama_ngf8_b2.safetensors"


@pytest.fixture(scope="session")
def generator_vector() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Weights of the published generator, and its input and output."""
    return _state_of("lama_ngf8_b2.safetensors")


@pytest.fixture(scope="session")
def discriminator_vector() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Weights of the published discriminator, and what it makes of two pictures."""
    return _state_of("discriminator_ndf8_n3.safetensors")


@pytest.fixture(scope="session")
def big_lama_shapes() -> dict[str, tuple[int, ...]]:
    """Every name and shape of the published big-lama."""
    listed = json.loads((VECTORS / "big_lama_keys.json").read_text())
    return {name: tuple(shape) for name, shape in listed.items()}


@pytest.fixture(scope="session")
def random_state() -> Callable[[GeneratorSettings], dict[str, np.ndarray]]:
    """Settings -> weights whose output spreads over the whole range 0..1, so that a tolerance means something."""

    def make(settings: GeneratorSettings) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(5)
        state: dict[str, np.ndarray] = {}
        for name, shape in generator_shapes(settings).items():
            if len(shape) == 4:
                state[name] = rng.normal(0, np.prod(shape[1:]) ** -0.5, shape).astype(np.float32)
            elif name.endswith(("running_var", "weight")):
                state[name] = rng.uniform(0.5, 1.5, shape).astype(np.float32)
            else:
                state[name] = rng.normal(0, 0.1, shape).astype(np.float32) if shape else np.zeros((), np.int64)
        state[f"model.{settings.head_index}.weight"] *= 6
        return state

    return make
