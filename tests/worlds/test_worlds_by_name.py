"""Worlds by name, and folders of the same name (oracle: the data sets that `worlds` and `open_dataset` give)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.worlds.dataset import open_dataset_or_worlds
from dlama.worlds.writer import write_worlds

LENS = Camera.from_fov(64, 48, 70)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"path": "worlds", "camera": LENS}, r"camera does not apply to a data set of layout worlds"),
        ({"path": "worlds:3", "layout": "tum"}, r"'worlds:3' is generated and has no layout"),
        ({"path": "worlds:x"}, r"'worlds:x' is no name of generated worlds; worlds, worlds:COUNT"),
        ({"path": "worlds:0"}, r"'worlds:0' is no name of generated worlds"),
        ({"path": "worlds:1000000000"}, r"count is 1000000000; a whole number from 1 to 10000 is expected"),
        ({"path": "worlds:1:2:3"}, r"'worlds:1:2:3' is no name of generated worlds"),
        ({"path": "worlds", "limit": 0}, r"limit is 0; 1 or more is expected, a whole number"),
    ],
)
def test_bad_names_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        open_dataset_or_worlds(**arguments)


def test_a_name_generates() -> None:
    """Count and seed stand in the names of the scenes."""
    assert {frame.scene for frame in open_dataset_or_worlds("worlds:2:5").frames} == {"w005", "w006"}
    assert len({frame.scene for frame in open_dataset_or_worlds("worlds").frames}) == 4


def test_a_folder_goes_before_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`dlama worlds -o worlds` and then `dlama evaluate worlds`: the folder that was just made is meant."""
    monkeypatch.chdir(tmp_path)
    write_worlds(Path("worlds"), count=1, size=32)
    assert open_dataset_or_worlds("worlds").layout == "easysynth"
    assert open_dataset_or_worlds("worlds:1").layout == "worlds"
