"""`import dlama` stays light (oracle: sys.modules of a fresh interpreter)."""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Mapping, Sequence

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
HELP = """
import contextlib, io
from dlama.apps.cli import VERBS, main
for words in ([], *([verb] for verb in VERBS), *(["models", task] for task in ("list", "info", "pull", "convert", "verify"))):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        main([*words, "--help"])
"""
METRICS = ", ".join(f"dlama.evaluation.metrics.{name}" for name in ("pictures", "depth", "lpips"))
LIGHT = (
    {
        "the package": ("import dlama", HEAVY),
        "names of fillers": ("import dlama.inpainters", ("numpy", "cv2", "numba", "onnxruntime")),
        "the command line": ("import dlama.apps.cli", ("numpy",)),
        "the help of verbs": (HELP, [name for name in HEAVY if name not in ("rich", "tyro")]),
    },
    {
        "cameras, frames, views and scenes, which are numpy alone": (
            "import dlama.errors, dlama.geometry.rgbd, dlama.geometry.cloud, dlama.geometry.scene",
            HEAVY,
        ),
        "metrics": (f"import {METRICS}", ("skimage", "scipy", "onnxruntime", "torch", "PIL")),
        "settings of a training": ("import dlama.training.presets, dlama.apps.verbs.networks.train", ("torch",)),
        "checkpoints read and exported": (
            "import dlama.nets.checkpoints, dlama.nets.export.generator",
            ("torch",),
        ),
        "options without clicks": (
            "from dlama.jobs.early import check_options\ncheck_options({})",
            ("dlama.perception.object_masks",),
        ),
        "the first page, answered": (FIRST_PAGE, ("onnxruntime", "onnx", "openvino", "torch")),
    },
)
"""What to run, and which modules must not be there then, one after the other in two interpreters: what one of them loads
can make a later one fail, and never pass."""


def loaded_by(steps: Mapping[str, tuple[str, Sequence[str]]]) -> dict[str, list[str]]:
    """Name -> which of its modules a fresh interpreter has loaded after running its code."""
    probe = "import sys\n"
    for name, (code, modules) in steps.items():
        probe += f"{code}\nprint({name!r}, *(one for one in {modules!r} if one in sys.modules), sep=';')\n"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True, timeout=600)
    return {name: found for name, *found in (line.split(";") for line in done.stdout.splitlines())}


@functools.cache
def loaded(interpreter: int) -> dict[str, list[str]]:
    """Of one of LIGHT."""
    return loaded_by(LIGHT[interpreter])


@pytest.mark.parametrize(("interpreter", "name"), [(place, name) for place, one in enumerate(LIGHT) for name in one])
def test_nothing_heavy_is_loaded(interpreter: int, name: str) -> None:
    """None of them, though most are installed; they load when they are needed."""
    assert loaded(interpreter)[name] == []


def test_this_guard_can_fail() -> None:
    """A module that is loaded is seen: by an import, and where something is pointed at."""
    code, names = LIGHT[1]["options without clicks"]
    clicked = code.replace("{}", "{'click': [(3, 4)]}")
    found = loaded_by({"import": ("import dlama, cv2", HEAVY), "clicks": (clicked, names)})
    assert found == {"import": ["cv2"], "clicks": list(names)}
