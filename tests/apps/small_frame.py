"""A small made-up frame on disk, and `dlama` run on it in this process."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.apps.cli import main
from dlama.geometry.camera import Camera
from worlds import Box, Plane, World

CAMERA = Camera.from_fov(64, 48, 60)
WORLD = World((Plane((0, 0, 4), (0, 0, 1)), Box((-0.5, -0.4, 2.0), (0.4, 0.5, 2.4))))
FAST = ["--filler", "telea"]


def small_frame(folder: Path) -> Path:
    """The folder with image.png, depth.png (mm), mask.png (the box) of a box before a wall."""
    rgbd = WORLD.rgbd(CAMERA)
    _, shown = WORLD.trace(CAMERA)
    Image.fromarray(rgbd.color).save(folder / "image.png")
    Image.fromarray((rgbd.depth * 1000).round().astype(np.uint16)).save(folder / "depth.png")
    Image.fromarray(((shown == 1) * 255).astype(np.uint8)).save(folder / "mask.png")
    return folder


def pixels(path: Path) -> np.ndarray:
    """A picture's numbers; codes for a palette picture."""
    with Image.open(path) as picture:
        return np.array(picture)


def run(folder: Path, *words: object) -> Path:
    """`dlama WORDS -o folder/out` with files named relative to the folder; returns the output directory."""
    known = [str(folder / str(word)) if (folder / str(word)).is_file() else str(word) for word in words]
    main([*known, "-o", str(folder / "out")])
    return folder / "out"


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *words: object) -> str:
    """The one line that the command prints on bad input; it exits with 2 and leaves nothing behind."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(SystemExit) as stop:
        run(folder, *words)
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    assert re.fullmatch(r"error: [^\n]+\n", captured.err), captured.err
    assert sorted(folder.rglob("*")) == before
    return captured.err
