"""Imports run one way, between the rooms of dlama and between its files (oracle: the syntax tree of every file).

An import inside a function counts like one at the top: a circle that hides there is a circle.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterable, Mapping
from pathlib import Path

SOURCE = Path(__file__).parent.parent / "src" / "dlama"
ORDER = [
    "errors",
    "arguments",
    "progress",
    "writing",
    "geometry",
    "models",
    "perception",
    "inpainters",
    "completion",
    "files",
    "workers",
    "datasets",
    "worlds",
    "evaluation",
    "nets",
    "training",
    "jobs",
    "web",
    "apps",
]
TOP = {"__init__", "__main__"}  # the shop window and the door may know every room
MEASURING = ["metrics", "protocols", "runner", "report"]
"""Folders of the room evaluation in their order: a metric is pure, and a change of the report leaves every result as it is."""


def room_of(path: Path) -> str:
    """geometry for src/dlama/geometry/camera.py, errors for src/dlama/errors.py."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


@functools.cache
def imported(code: str) -> list[str]:
    """Dotted names under dlama that a piece of code imports, at any depth of nesting; `from a import b` is a.b."""
    names: list[str] = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{'.' * node.level}{node.module or ''}.{alias.name}" for alias in node.names]
    return [name for name in names if name.split(".")[0] in ("dlama", "")]


def offences(room: str, code: str) -> list[str]:
    """The imports that run the wrong way; relative ones and the shop window itself count as wrong."""
    if room in TOP:
        return []
    allowed = ["errors", "writing", "nets"] if room == "nets" else ORDER[: ORDER.index(room) + 1]
    shop_window = ["__version__", "dlama"] if room in ("web", "apps") else ["__version__"]
    return [name for name in imported(code) if [*name.split("."), "dlama"][1] not in [*allowed, *shop_window]]


def later_folders(folder: str, code: str) -> list[str]:
    """What a file of a folder of MEASURING imports from those after it."""
    later = tuple(f"dlama.evaluation.{one}." for one in MEASURING[MEASURING.index(folder) + 1 :])
    return [name for name in imported(code) if name.startswith(later)]


def arrows(files: Mapping[str, str]) -> dict[str, set[str]]:
    """Which files (dotted names) each file imports; a package stands for its `__init__`."""
    found: dict[str, set[str]] = {}
    for name, code in files.items():
        found[name] = set()
        for target in imported(code):
            while target and target not in files:
                target = target.rpartition(".")[0]
            found[name] |= {target} - {"", name, "dlama"}
    return found


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of files each of which reaches all the others."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        todo = [start]
        while todo:
            new = graph.get(todo.pop(), set()) - seen
            seen |= new
            todo += new
        return seen

    reach = {name: reached(name) for name in graph}
    groups: Iterable[frozenset[str]] = {
        frozenset(other for other in reach[name] if name in reach.get(other, ())) for name in graph
    }
    return sorted(sorted(group) for group in groups if group)


def test_imports_between_rooms_run_one_way() -> None:
    """Every file of the package, also inside functions."""
    files = sorted(SOURCE.rglob("*.py"))
    assert len(files) > 10
    wrong = {str(f.relative_to(SOURCE)): offences(room_of(f), f.read_text("utf-8")) for f in files}
    assert {name: found for name, found in wrong.items() if found} == {}


def test_what_measures_knows_nothing_of_the_report() -> None:
    """Every file of evaluation's folders."""
    files = {path: path.parent.name for path in (SOURCE / "evaluation").glob("*/*.py")}
    assert set(files.values()) == set(MEASURING)
    assert [path for path, folder in files.items() if later_folders(folder, path.read_text("utf-8"))] == []


def test_no_circle_of_files() -> None:
    """Inside rooms too."""
    files = {}
    for path in SOURCE.rglob("*.py"):
        name = ".".join(["dlama", *path.relative_to(SOURCE).with_suffix("").parts]).removesuffix(".__init__")
        if name not in ("dlama", "dlama.__main__"):
            files[name] = path.read_text("utf-8")
    assert circles(arrows(files)) == []


def test_these_guards_can_fail() -> None:
    """Each way of importing against the order is seen, and the right way is not; so is a circle, also a hidden one."""
    assert offences("geometry", "def f():\n    from dlama.apps.cli import main") == ["dlama.apps.cli.main"]
    assert offences("geometry", "import dlama.files") == ["dlama.files"]
    assert offences("files", "from dlama import evaluation") == ["dlama.evaluation"]
    assert offences("files", "from dlama import complete") == ["dlama.complete"]
    assert offences("files", "import dlama") == ["dlama"]
    assert offences("files", "from ..apps import cli") == ["..apps.cli"]
    assert offences("nets", "from dlama.geometry.view import View") == ["dlama.geometry.view.View"]
    assert offences("files", "import numpy\nfrom dlama.geometry.view import View\nfrom dlama import geometry") == []
    measuring = "def f():\n    from dlama.evaluation.report import panels\nfrom dlama.evaluation.metrics import depth"
    assert later_folders("runner", measuring) == ["dlama.evaluation.report.panels"] and not later_folders(
        "report", measuring
    )
    files = {"dlama.a": "import dlama.b", "dlama.b": "def f():\n    from dlama.c import x", "dlama.c": "import dlama.b"}
    assert circles(arrows(files)) == [["dlama.b", "dlama.c"]]
    assert circles(arrows(files | {"dlama.c": "import numpy"})) == []
