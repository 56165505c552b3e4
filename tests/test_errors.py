"""Errors as they are shown (oracle: the text that was given)."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageFile

import dlama
from dlama.datasets.frames import Dataset
from dlama.datasets.posed.view_pairs import NoPairsError
from dlama.errors import LONGEST, DlamaError, FileError, InputError, MissingExtraError, OutputError
from dlama.files.rasters.depth import read_depth


def test_a_message_with_a_very_long_value_is_shortened() -> None:
    """Its beginning (file and field) and its end (what is expected) stay; a usual one stays whole."""
    for kind in (FileError, OutputError):
        assert str(kind("a.json: fx is 7; more is expected")) == "a.json: fx is 7; more is expected"
        shown = str(kind(f"a.json: fx is {'9' * 5000}; more is expected"))
        assert (
            shown.startswith("a.json: fx is 999") and shown.endswith("999; more is expected") and len(shown) <= LONGEST
        )


def test_an_error_carries_the_parameters_that_it_is_about() -> None:
    """By hand: in the message's order; Python reads plain names, what passes the error on has them in backticks."""
    error = InputError("`fov` is 0; give `depth_scale=5` or `loop.steps`, not `dlama view` or x")
    assert error.parameters == ("fov", "depth_scale", "loop.steps")
    assert str(error) == "fov is 0; give depth_scale=5 or loop.steps, not `dlama view` or x"
    assert str(InputError(f"again: {error.marked}")) == f"again: {error}"


@pytest.mark.parametrize(
    "error",
    [
        InputError("fov is 0"),
        OutputError("out: no space left on device"),
        MissingExtraError("dlama video", "av", "video"),
        NoPairsError("room: no two frames overlap", Dataset("room", "tum", None, (), ())),
    ],
)
def test_errors_travel_between_processes(error: DlamaError) -> None:
    """Round trip: a pool that sends results by pickle breaks where it cannot send an error."""
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == str(error) and vars(again) == vars(error)


def test_no_file_is_damaged_where_memory_runs_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the MemoryError that a decoder raises, by which the verbs and a batch know what happened."""
    color, depth, scene = (tmp_path / name for name in ("a.png", "a.npy", "scene.npz"))
    Image.new("RGB", (4, 4)).save(color)
    np.save(depth, np.ones((4, 4)))
    np.savez(scene, a=1)

    def run_out(*_: Any, **__: Any) -> None:
        raise MemoryError

    monkeypatch.setattr(ImageFile.ImageFile, "load", run_out)
    monkeypatch.setattr(np.lib.format, "read_magic", run_out)
    monkeypatch.setattr(zipfile.ZipFile, "infolist", run_out)
    for read, path in ((dlama.read_color, color), (read_depth, depth), (dlama.read_scene, scene)):
        with pytest.raises(MemoryError):
            read(path)  # type: ignore[operator]
