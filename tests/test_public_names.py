"""The shop window: what `import dlama` offers (oracles: the list below, and the syntax tree of `__init__`)."""

from __future__ import annotations

import ast
import types
from pathlib import Path

import dlama

NAMES = {
    "Camera", "Completion", "DlamaError", "PointCloud", "RGBD", "Scene", "View",
    "complete", "lift", "orbit", "read_camera", "read_color", "read_mask", "read_rgbd", "read_stereo_calib",
    "remove", "render", "stereo", "view", "write",
}  # fmt: skip


def offered() -> set[str]:
    """Public names that are no submodules."""
    return {
        name
        for name, value in vars(dlama).items()
        if not name.startswith("_") and not isinstance(value, types.ModuleType)
    }


def test_public_names() -> None:
    """Exactly these, and no more than 20."""
    assert offered() == NAMES
    assert len(NAMES) <= 20


def test_each_is_written_as_itself() -> None:
    """`X as X`, so that type checkers see it as public."""
    tree = ast.parse(Path(dlama.__file__).read_text("utf-8"))
    aliases = [alias for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert {alias.asname for alias in aliases} == NAMES
    assert all(alias.name == alias.asname for alias in aliases)


def test_each_explains_itself() -> None:
    """No public name without a docstring."""
    assert [name for name in NAMES if not (getattr(dlama, name).__doc__ or "").strip()] == []


def test_verbs_have_the_names_of_the_command_line() -> None:
    """view, remove and stereo are the same words in both (oracle: the command line's table)."""
    from dlama.apps.cli import VERBS

    assert {"view", "remove", "stereo"} <= set(VERBS) & NAMES
