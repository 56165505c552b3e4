"""Fixtures of all tests, and how many processes run them.

This folder is on the import path, so `worlds` and `reference.*` import from any test.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")
"""torch is not loaded yet. Toy networks are too small to share: on a busy machine threads that wait for others take minutes."""

TESTS = Path(__file__).parent


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Two processes for the whole suite; none for a part of it, which would take longer: each of them loads everything."""
    whole = all(Path(named).resolve() in (TESTS, TESTS.parent) for named in config.args)
    option = config.option
    return min(2, os.cpu_count() or 1) if whole and not option.keyword and option.capture != "no" else 0


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Modules and tests that are loaded stay to the end, and each garbage collection would look at all of them."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The page in a browser comes first: at the end one process would wait for it while the other had nothing left to do."""
    items.sort(key=lambda item: not item.path.stem.endswith("in_a_browser"))


@pytest.fixture(scope="session", autouse=True)
def nothing_is_flushed() -> Iterator[None]:
    """What tests write need not survive a power cut; `test_placement` sees that it would."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        yield


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real data, from DLAMA_DATA; a test skips where that is unset, and fails where it is wrong."""
    reported = os.environ.get("DLAMA_DATA")
    if not reported:
        pytest.skip("DLAMA_DATA is not set; it names the folder that holds data/ and street/")
    folder = Path(reported)
    assert folder.is_dir(), f"DLAMA_DATA is {reported}, which is no folder"
    return folder


@pytest.fixture(scope="session")
def weights_dir(data_dir: Path) -> Path:
    """The folder of LPIPS' full-precision weights among the real data."""
    if not (data_dir / "weights" / "lpips_alex_lin.safetensors").is_file():
        pytest.skip(f"{data_dir} has no weights/lpips_alex_lin.safetensors")
    return data_dir / "weights"
