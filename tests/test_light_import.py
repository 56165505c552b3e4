"""`import dlama` stays light (oracle: sys.modules of a fresh interpreter)."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

import pytest

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


def loaded_by(code: str, names: Sequence[str] = HEAVY) -> list[str]:
    """Which of these modules a fresh interpreter has loaded after running `code`."""
    probe = f"{code}\nimport sys\nprint(*(name for name in {names!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True, timeout=600)
    return done.stdout.split()


FIRST_PAGE = """
import http.client, threading
from dlama.web.answers import Limits
from dlama.web.server import open_server
with open_server("127.0.0.1", 0, None, Limits()) as server:
    threading.Thread(target=server.serve_forever, daemon=True).start()
    line = http.client.HTTPConnection("127.0.0.1", server.port)
    for method, path in (("GET", "/"), ("POST", "/api/settings"), ("POST", "/api/visit")):
        line.request(method, path, headers={"X-Dlama-Visit": ""})
        assert line.getresponse().read()
    server.shutdown()
"""
METRICS = ", ".join(f"dlama.evaluation.metrics.{name}" for name in ("pictures", "clouds", "depth", "lpips"))
LIGHT = {
    "the package": ("import dlama", HEAVY),
    "cameras, frames, views and scenes, which are numpy alone": (
        "import dlama.errors, dlama.geometry.rgbd, dlama.geometry.cloud, dlama.geometry.scene",
        HEAVY,
    ),
    "the help of verbs": ("import dlama.apps.cli", ("numpy",)),
    "options without clicks": (
        "from dlama.jobs.early import check_options\ncheck_options({})",
        ("dlama.perception.object_masks",),
    ),
    "names of fillers": ("import dlama.inpainters", ("numpy", "cv2", "numba", "onnxruntime")),
    "metrics": (f"import {METRICS}", ("skimage", "scipy", "onnxruntime", "torch", "PIL")),
    "settings of a training": ("import dlama.training.presets, dlama.apps.verbs.networks.train", ("torch",)),
    "checkpoints read and exported": (
        "import dlama.nets.checkpoints, dlama.nets.export.generator, dlama.nets.surgery",
        ("torch",),
    ),
    "the first page, answered": (FIRST_PAGE, ("onnxruntime", "onnx", "openvino", "torch")),
}


@pytest.mark.parametrize(("code", "names"), LIGHT.values(), ids=LIGHT)
def test_nothing_heavy_is_loaded(code: str, names: Sequence[str]) -> None:
    """None of them, though most are installed; they load when they are needed."""
    assert loaded_by(code, names) == []


def test_this_guard_can_fail() -> None:
    """A module that is loaded is seen: by an import, and where something is pointed at."""
    assert loaded_by("import dlama, cv2") == ["cv2"]
    code, names = LIGHT["options without clicks"]
    assert loaded_by(code.replace("{}", "{'click': [(3, 4)]}"), names) == list(names)
