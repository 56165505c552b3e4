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
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system has no /proc")
def test_damaged_files_get_the_packages_own_errors() -> None:
    """Every reader, in one process under limits of memory and processor time; failures tell the edits."""
    paths = [str(FILES.parent), str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")]
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
    inside = "rgbd color_of_camera stored stored_numbers pfm pcd array exr calib_txt yaml_pair json_pair"
    fields = ("camera_fields", "json_fields", "yaml_fields")
    assert {name for name in public if name not in code} <= {f"read_{name}" for name in (*inside.split(), *fields)}
