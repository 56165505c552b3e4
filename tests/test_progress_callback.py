"""The callback `progress` of the verbs (oracle: the stages that a completion has, and what the callback itself raises)."""

from __future__ import annotations

from pathlib import Path

import pytest

import dlama
from box_frame import CAMERA, WORLD
from dlama.progress import begin_stage, show_progress

FRAME = WORLD.rgbd(CAMERA)


def test_stages_come_in_order_and_go_to_the_innermost(tmp_path: Path) -> None:
    """Rendering comes before filling and that before fusing; written files are named; outside nobody is called."""
    outer: list[str] = []
    inner: list[str] = []
    with show_progress(outer.append):
        done = dlama.view(FRAME, yaw=3, filler="telea", progress=inner.append)
        dlama.write(done, tmp_path / "out", only=("image", "depth"))
    begin_stage("afterwards")
    assert [inner.index(name) for name in ("render", "fill", "fuse")] == sorted(
        inner.index(name) for name in ("render", "fill", "fuse")
    )
    assert sorted(outer) == ["write depth.exr", "write depth.png", "write image.png"]


def test_the_callback_may_call_dlama() -> None:
    """Law: its own work is reported to nobody; it called itself without end."""
    stages: list[str] = []

    def look(stage: str) -> None:
        stages.append(stage)
        dlama.view(FRAME, yaw=3, filler="telea")

    dlama.view(FRAME, yaw=3, filler="telea", progress=look)
    assert stages.count("render") == 1


def test_many_frames_are_counted_as_they_are_read() -> None:
    """`scene` and `align_frames` say which frame they are at."""
    frames, read, compared = [FRAME, WORLD.rgbd(dlama.orbit(CAMERA, 3))], list[str](), list[str]()
    dlama.scene(frames, progress=read.append)
    assert read == ["read frame 1 of 2", "read frame 2 of 2", "compare frames"]
    dlama.align_frames(frames, progress=compared.append)
    assert set(compared) == {"find features of frame 1 of 2", "find features of frame 2 of 2"}


def test_what_the_callback_raises_ends_the_work(tmp_path: Path) -> None:
    """Nothing half-written is left."""

    class Enough(Exception):
        pass

    def stop(stage: str) -> None:
        raise Enough(stage)

    done = dlama.view(FRAME, yaw=3, filler="telea")
    with pytest.raises(Enough, match="write"):
        dlama.write(done, tmp_path / "out", progress=stop)
    assert not list(tmp_path.iterdir())
    with pytest.raises(Enough):
        dlama.view(FRAME, yaw=3, filler="telea", progress=stop)
    with pytest.raises(TypeError, match="progress is of type int; a function is expected"):
        dlama.view(FRAME, yaw=3, progress=3)
