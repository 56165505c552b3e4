"""Imports between the rooms of dlama run one way (oracle: the order in the list below, read from the syntax tree)."""

from __future__ import annotations

import ast
from pathlib import Path

SOURCE = Path(__file__).parent.parent / "src" / "dlama"
ORDER = [
    "errors",
    "geometry",
    "models",
    "perception",
    "inpainters",
    "completion",
    "files",
    "datasets",
    "evaluation",
    "nets",
    "training",
    "apps",
]
TOP = {"__init__", "__main__"}  # the shop window and the door may know every room


def room_of(path: Path) -> str:
    """geometry for src/dlama/geometry/camera.py, errors for src/dlama/errors.py."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def imported(code: str) -> list[str]:
    """Dotted names under dlama that a piece of code imports, at any depth of nesting."""
    names: list[str] = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names += (
                [f"{module}.{alias.name}" for alias in node.names] if module == "dlama" else ["." * node.level + module]
            )
    return [name for name in names if name.split(".")[0] in ("dlama", "")]


def offences(room: str, code: str) -> list[str]:
    """The imports that run the wrong way; relative ones and the shop window itself count as wrong."""
    if room in TOP:
        return []
    allowed = ["errors", "nets"] if room == "nets" else ORDER[: ORDER.index(room) + 1]
    allowed = [*allowed, "__version__"]
    return [name for name in imported(code) if [*name.split("."), ""][1] not in allowed]


def test_imports_run_one_way() -> None:
    """Every file of the package, also inside functions."""
    files = sorted(SOURCE.rglob("*.py"))
    assert len(files) > 10
    wrong = {str(f.relative_to(SOURCE)): offences(room_of(f), f.read_text("utf-8")) for f in files}
    assert {name: found for name, found in wrong.items() if found} == {}


def test_this_guard_can_fail() -> None:
    """Each way of importing against the order is seen, and the right way is not."""
    assert offences("geometry", "def f():\n    from dlama.apps.cli import main") == ["dlama.apps.cli"]
    assert offences("geometry", "import dlama.files") == ["dlama.files"]
    assert offences("files", "from dlama import evaluation") == ["dlama.evaluation"]
    assert offences("files", "from dlama import complete") == ["dlama.complete"]
    assert offences("files", "from ..apps import cli") == ["..apps"]
    assert offences("nets", "from dlama.geometry.view import View") == ["dlama.geometry.view"]
    assert offences("files", "import numpy\nfrom dlama.geometry.view import View\nfrom dlama import geometry") == []
