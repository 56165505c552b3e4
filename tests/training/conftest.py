"""Fixtures of the training's tests; this folder is on the import path, so `toy_runs` imports from any of them."""

from __future__ import annotations

import importlib.util

import pytest


@pytest.fixture(scope="session", autouse=True)
def one_torch_thread():
    """Toy networks are too small to share: on a busy machine threads that wait for each other take minutes."""
    if importlib.util.find_spec("torch") is not None:
        import torch

        torch.set_num_threads(1)
    yield
