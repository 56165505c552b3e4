"""The list of kernels compiled ahead, against what jobs really call (oracle: numba's own record of the types)."""

from __future__ import annotations

import inspect
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.geometry.kernels import ahead
from dlama.geometry.kernels.drawing.rasterize import ZBuffer


def test_types_round_trip() -> None:
    """Round trip: the words that numba's types are written as give those types again."""
    from numba import typeof

    frozen = np.zeros((2, 3, 4), np.uint8)
    frozen.flags.writeable = False
    arrays = {"uint8.3Cr": frozen, "bool.1C": np.zeros(3, bool), "float32.2C": np.zeros((2, 2), np.float32)}
    for word, value in arrays.items():
        assert ahead.numba_type(word) == typeof(value)
    drawn = ZBuffer(np.zeros((2, 2), np.float32), np.zeros((2, 2, 2), np.float32))
    assert ahead.numba_type(f"{ZBuffer.__module__}:ZBuffer(float32.2C,float32.3C)") == typeof(drawn)
    assert ahead.numba_type(f"{ZBuffer.__module__}:ZBuffer(float32.2C,float32.2C)") == typeof(ZBuffer(drawn.w, drawn.w))
    nested = f"{ZBuffer.__module__}:ZBuffer({ZBuffer.__module__}:ZBuffer(float32.2C,float32.3C),float32.2C)"
    assert ahead.numba_type(nested) == typeof(ZBuffer(drawn, drawn.w))  # type: ignore[arg-type]
    assert ahead.numba_type("(float32.2C,int64)") == typeof((drawn.w, 3))
    assert ahead.numba_type("int64") == typeof(3) and ahead.numba_type("float64") == typeof(0.5)


def test_a_job_has_its_own_list() -> None:
    """A view needs a part of all; an unknown job may need any. Every name is a kernel, and comes once: numba compiles it anew for
    each other layout of its arrays."""
    every = ahead.listed_kernels()
    assert 0 < len(ahead.listed_kernels("view")) < len(every) == len(ahead.listed_kernels("evaluate"))
    for _, name, *types in every:
        kernel = pkgutil.resolve_name(name)
        assert hasattr(kernel, "compile")
        # raises where a type cannot be read; one type a parameter, or compiling fails on the first run
        assert len(list(map(ahead.numba_type, types))) == len(inspect.signature(kernel.py_func).parameters), name
    assert len({words[1] for words in every}) == len(every)


def test_a_view_calls_listed_kernels_only() -> None:
    """Frozen vector: with what a view of the bundled street calls. Where it differs: python benchmarks/kernels.py."""
    folder = dlama.example()
    dlama.view(dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90), yaw=20, pivot=12.0)
    listed = {(words[1], tuple(map(ahead.numba_type, words[2:]))) for words in ahead.listed_kernels("view")}
    names = {name for name, _ in listed}
    for name in (
        "dlama.geometry.kernels.drawing.rasterize:draw_surface",
        "dlama.inpainters.layered.kernels.surfaces:sweep",
    ):
        called = {(name, types) for types in pkgutil.resolve_name(name).signatures}
        assert name in names and called & listed


@pytest.mark.slow
def test_a_process_leaves_its_share_on_disk(tmp_path: Path) -> None:
    """Law: the first, the seventeenth ... kernel from the list's end on is kept, and no other."""
    line = [sys.executable, "-m", ahead.__name__, "view", "0", "16"]
    subprocess.run(line, check=True, env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, timeout=600)
    kept = {file.name.rpartition("-")[0] for file in tmp_path.rglob("*.nbi")}
    share = ahead.listed_kernels("view")[::-1][::16]
    assert kept == {words[1].rpartition(".")[2].replace(":", ".") for words in share}


def test_what_is_compiled_ahead_and_cannot_be_kept_is_no_success(tmp_path: Path) -> None:
    """Oracle: the exit code, with files of no byte as on a full disk; `dlama warm-up` counted such kernels as found on disk."""
    resource = pytest.importorskip("resource")  # not on Windows

    def fill_disk() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))

    command = [sys.executable, "-m", ahead.__name__, "view", "0", "1000"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    ended = subprocess.run(command, env=environment, preexec_fn=fill_disk, stderr=subprocess.PIPE, text=True)
    assert ended.returncode and "cannot be kept" in ended.stderr
