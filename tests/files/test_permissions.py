"""Files and folders that may not be read or written end in errors of the package with file and reason (oracle: a process without
rights, which root's tests become)."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dlama.apps.verbs.demo import ASSETS
from dlama.errors import FileError, OutputError, system_errors

CALLS = {
    "read_color": "dlama.files.rasters.pictures.read_color('{}.jpg')",
    "read_mask": "dlama.read_mask('{}.png')",
    "read_depth": "dlama.files.rasters.depth.read_depth('{}.exr')",
    "read_rgbd": "dlama.read_rgbd('{}.jpg', '{}.png', fov=60)",
    "read_camera": "dlama.files.cameras.read_camera('{}.json')",
    "read_stereo_calib": "dlama.files.cameras.read_stereo_calib('{}.txt')",
    "find_filler": "dlama.inpainters.find_filler('lama', '{}.onnx')",
    "open_dataset": "dlama.datasets.layouts.open_dataset('{}')",
    **{
        f"open_dataset {name}": f"dlama.datasets.layouts.open_dataset('{{}}', '{name}')"
        for name in ("easysynth", "pairs", "removal", "stereo", "tum", "7-scenes", "scannet", "redwood", "nerfstudio")
    },
    "write_worlds": "dlama.worlds.writer.write_worlds(Path('{}.worlds'), textures=Path('{}'))",
    "settings_of": "dlama.training.presets.settings_of('{}.json')",
    "find_training_data": "dlama.training.data.sources.find_training_data(Path('{}'))",
    "source_of": "dlama.apps.model_files.source_of('{}.pt')",
    "new_file": "dlama.writing.atomic_write.new_file('{}.txt').__enter__()",
    "new_directory": "dlama.writing.atomic_write.new_directory('{}').__enter__()",
}
"""Name -> a call with a path that may not be used in it: below a closed folder, or closed itself."""
SCRIPT = """
import encodings.ascii, json, os, pydoc, sys
from pathlib import Path
import dlama
calls = json.loads(sys.argv[1])
for call in calls.values(): pydoc.locate(call.partition("(")[0])  # imports its module
if os.geteuid() == 0:
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
said = {}
for name, call in calls.items():
    try:
        eval(call)
        said[name] = ["nothing", ""]
    except BaseException as error:
        said[name] = [type(error).__name__, str(error)]
print(json.dumps(said))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="rights as POSIX has them")
def test_what_may_not_be_read_or_written_is_named(tmp_path: Path) -> None:
    """Every call is a FileError or an OutputError that names the path and says why."""
    root = tmp_path / "open"
    (root / "closed").mkdir(parents=True)
    (root / "unreadable").mkdir()
    for suffix, source in (("jpg", "street.jpg"), ("png", "mask.png"), ("json", "camera.json"), ("txt", "calib.txt")):
        shutil.copy(ASSETS / source, root / f"unreadable.{suffix}")
    for suffix in ("exr", "onnx", "pt"):
        (root / f"unreadable.{suffix}").write_bytes(b"x" * 100)
    for path in root.iterdir():
        path.chmod(0)
    of_pytest = [folder for folder in tmp_path.parents if folder.name.startswith(("pytest-", "popen-"))]
    for folder in (root, tmp_path, *of_pytest):
        folder.chmod(0o755)
    opened_later = {"new_file", "source_of", "find_filler"}  # what takes a file of an open folder
    calls = {
        f"{name}, {place}": call.replace("{}", str(root / place))
        for place, left_out in (("closed/x", set()), ("unreadable", opened_later))
        for name, call in CALLS.items()
        if name not in left_out
    }
    command = [sys.executable, "-c", SCRIPT, json.dumps(calls)]
    done = subprocess.run(command, cwd="/", capture_output=True, text=True, timeout=600)
    for path in root.iterdir():
        path.chmod(0o700)
    assert done.returncode == 0, done.stderr
    for name, (kind, message) in json.loads(done.stdout).items():
        assert kind in ("FileError", "OutputError"), (name, kind, message)
        assert "ermission denied" in message and str(root) in message, (name, message)
        assert "damaged" not in message, (name, message)


def test_errors_of_the_system_become_the_packages_own() -> None:
    """Its own errors pass, and so does everything else."""
    with pytest.raises(FileError, match=r"^a\.png: input/output error$"), system_errors(FileError):
        raise OSError(5, "Input/output error", "a.png")
    with pytest.raises(FileError, match=r"^no space left on device$"), system_errors(FileError):
        raise OSError(28, "No space left on device")
    with pytest.raises(OutputError, match=r"^mine$"), system_errors(FileError):
        raise OutputError("mine")
    with pytest.raises(KeyError), system_errors(FileError):
        raise KeyError("x")
