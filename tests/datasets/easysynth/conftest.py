"""A sequence in EasySynth's layout for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlama.datasets.easysynth.writer import write_scene
from dlama.geometry.motion.trajectories import orbit
from rendered_walls import CAMERA, CLASSES, frame


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """Three frames of one camera, at 0, 10 and -10 degrees."""
    frames = [frame(orbit(CAMERA, yaw)) for yaw in (0, 10, -10)]
    write_scene(tmp_path, "seq", {"with": frames}, depth_range=10, classes=CLASSES)
    return tmp_path / "seq" / "with"
