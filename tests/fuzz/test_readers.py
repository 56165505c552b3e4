"""Damaged files of every kind get the package's own errors, no crash, no gigabyte (oracle: undamaged they are read)."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FILES = HERE.parents[1] / "src" / "dlama"


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_damaged_files_get_the_packages_own_errors() -> None:
    """Every reader, in a process under limits of memory and processor time; failures tell the edits."""
    paths = [str(FILES.parent), str(HERE), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, str(HERE / "fuzz_readers.py")],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )  # fmt: skip
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]


def test_every_reader_of_files_is_fuzzed() -> None:
    """A new `read_...` of dlama.files that stands in no list of readers fails here (oracle: the syntax trees)."""
    code = (HERE / "readers.py").read_text("utf-8")
    public = {
        node.name
        for path in (FILES / "files").rglob("*.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("read_") and "path" in ast.unparse(node.args)
    }
    inside = {
        "read_rgbd",
        "read_color_of_camera",
        "read_stored",
        "read_stored_numbers",
        "read_pfm",
        "read_pcd",
        "read_array",
        "read_exr",
        "read_json_fields",
        "read_calib_txt",
        "read_yaml_fields",
        "read_yaml_pair",
    }
    assert {name for name in public if f"{name}" not in code} <= inside
