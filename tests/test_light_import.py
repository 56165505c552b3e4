"""`import dlama` stays light (oracle: sys.modules of a fresh interpreter)."""

from __future__ import annotations

import subprocess
import sys

HEAVY = (
    "numba",
    "cv2",
    "PIL",
    "torch",
    "OpenEXR",
    "plyfile",
    "rich",
    "tyro",
    "onnxruntime",
    "onnx",
    "scipy",
    "skimage",
    "jinja2",
    "pytorch_lightning",
)


def loaded_by(code: str) -> list[str]:
    """Which heavy packages a fresh interpreter has loaded after running `code`."""
    probe = f"{code}\nimport sys\nprint(' '.join(name for name in {HEAVY!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True, timeout=600)
    return done.stdout.split()


def test_import_dlama_loads_nothing_heavy() -> None:
    """None of them, though most are installed; they load when they are needed."""
    assert loaded_by("import dlama") == []


def test_nouns_load_nothing_heavy() -> None:
    """Cameras, frames, views and scenes are numpy alone."""
    assert loaded_by("import dlama.errors, dlama.geometry.rgbd, dlama.geometry.cloud, dlama.geometry.scene") == []


def test_help_loads_no_numpy() -> None:
    """Verbs say what they take before anything is computed."""
    probe = "import sys, dlama.apps.cli; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


def test_options_without_clicks_load_no_masks() -> None:
    """What points at an object is loaded where something is pointed at."""
    probe = """import sys
from dlama.jobs.early import check_options
for given in ({}, {"click": [(3, 4)]}):
    check_options(given)
    print("dlama.perception.object_masks" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_this_guard_can_fail() -> None:
    """A module that is loaded is seen."""
    assert loaded_by("import dlama, cv2") == ["cv2"]
