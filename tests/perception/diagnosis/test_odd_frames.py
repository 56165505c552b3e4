"""One frame of many with another depth scale, or at a wrong place (oracle: the fault that was put in; good frames have none)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import dlama
from corruptions import FRAMES, scaled
from corruptions import moved as at_poses
from dlama.datasets.layouts import open_dataset
from dlama.files.rasters.depth import write_depth_png
from dlama.perception.diagnosis.finding import Finding
from dlama.perception.diagnosis.odd_frames import compare_frames, find_odd_frames
from dlama.perception.diagnosis.poses import shrink
from dlama.worlds.layouts.random_scene import build
from marks import first_quick
from posed_folders import write_nerfstudio
from worlds import moved

needs_data = pytest.mark.skipif("DLAMA_DATA" not in os.environ, reason="needs DLAMA_DATA")


@cache
def orbit(seed: int) -> tuple[dlama.RGBD, ...]:
    """Six frames of a world, 8 degrees apart."""
    made = build(seed, None, ())
    return tuple(made.frame(dlama.orbit(made.camera(0, 128), 8.0 * n, 3.0 * n)) for n in range(6))


def spoilt(frames: Sequence[dlama.RGBD], number: int, name: str) -> list[dlama.RGBD]:
    return [FRAMES[name][0](frame) if place == number else frame for place, frame in enumerate(frames)]


shrunk = cache(shrink)
"""Most frames are those of an orbit, as they are."""


def odd(frames: Sequence[dlama.RGBD]) -> list[Finding]:
    return find_odd_frames([shrunk(frame) for frame in frames], [str(number) for number in range(len(frames))])


@pytest.mark.parametrize("seed", first_quick((3, 6, 8)))
def test_good_frames_are_silent(seed: int) -> None:
    assert odd(orbit(seed)) == []


@pytest.mark.parametrize(("seed", "number"), first_quick([(3, 0), (12, 3)]))
@pytest.mark.parametrize("name", FRAMES)
def test_the_odd_frame_is_named_with_what_mends_it(name: str, seed: int, number: int) -> None:
    (finding,) = odd(spoilt(orbit(seed), number, name))
    assert (finding.check, finding.severity) == ("depth-scale", "fault")
    assert finding.what.startswith(f"{number}:") and FRAMES[name][1] in finding.mend


def test_a_frame_at_a_wrong_place_is_named() -> None:
    """Oracle: the pose that was moved by a metre; its neighbours are no fault."""
    frames = list(orbit(3))
    frames[2] = replace(frames[2], camera=moved(frames[2].camera, shift=(1.0, 0.5, 0.5)))
    small = {str(number): shrink(frame) for number, frame in enumerate(frames)}
    (finding,) = compare_frames(small, list(small), "scene")
    assert (finding.check, finding.severity, finding.what[:2]) == ("pose", "fault", "2:")


def test_two_odd_frames_are_both_named() -> None:
    frames = spoilt(spoilt(orbit(3), 0, "depth times 5"), 5, "depth over 5")
    assert [(each.check, each.what[0]) for each in odd(frames)] == [("depth-scale", "0"), ("depth-scale", "5")]


def test_of_three_frames_the_odd_one_is_named_and_of_two_none() -> None:
    (finding,) = odd(spoilt(orbit(3)[:3], 1, "depth over 5"))
    assert finding.what.startswith("1: depth is 5 times too small")
    assert odd(spoilt(orbit(3)[:2], 1, "depth over 5")) == []


def test_exposure_and_white_balance_are_no_fault() -> None:
    """Oracle: gains in linear light, on one frame of six."""
    gains = np.array((0.45, 0.6, 0.8)) ** (1 / 2.2)
    for seed in (3, 5, 12):
        frames = list(orbit(seed))
        frames[2] = replace(frames[2], color=(frames[2].color * gains).astype(np.uint8))
        assert odd(frames) == []


def test_a_zoomed_picture_with_its_own_lens_is_not_odd() -> None:
    """Oracle: a world seen by a camera of another focal length is seen rightly."""
    made, frames = build(3, None, ()), list(orbit(3))
    camera = frames[2].camera
    frames[2] = made.frame(replace(camera, fx=1.3 * camera.fx, fy=1.3 * camera.fy))
    assert odd(frames) == []


@pytest.mark.parametrize("hw", [(1, 1), (1, 600), (700, 2)])
def test_strips_and_empty_depth_say_nothing(hw: tuple[int, int]) -> None:
    camera = dlama.Camera.from_fov(hw[1], hw[0], 60)
    for depth in (0.0, 2.0, np.inf):
        frame = dlama.RGBD(np.zeros((*hw, 3), np.uint8), np.full(hw, depth, np.float32), camera)
        assert odd([frame] * 4) == []


def write_frames(folder: Path, frames: Sequence[dlama.RGBD]) -> None:
    """As nerfstudio lays them out, each with its own lens; whole millimetres."""
    named = {str(number): frame for number, frame in enumerate(frames)}
    write_nerfstudio(folder, named, {name: frame.camera for name, frame in named.items()})


def test_one_line_names_the_frame_of_a_data_set(tmp_path: Path) -> None:
    """Oracle: the fault; the first frame in a row is also looked at on its own, which adds no second line."""
    write_frames(tmp_path, spoilt(orbit(12), 0, "depth over 5"))
    found = dlama.diagnose(tmp_path)
    assert [each.check for each in found] == ["depth-scale", "understood"]
    assert found[0].what.startswith(f"{tmp_path.name}/0:")


def test_each_frame_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """Oracle: the picture that is deleted and the depth that is empty; the other frames are examined."""
    write_frames(tmp_path, spoilt(orbit(12), 5, "depth times 5"))
    (tmp_path / "images/1.png").unlink()
    write_depth_png(tmp_path / "depth/3.png", np.zeros((128, 128), np.float32))
    found = dlama.diagnose(tmp_path)
    assert [each.check for each in found] == ["reading", "reading", "depth-scale", "understood"]
    assert "images/1.png: no such file" in found[0].what and "depth/3.png: no pixel has a depth" in found[1].what
    assert found[2].what.startswith(f"{tmp_path.name}/5:")


def drive(seed: int, metres: float) -> list[dlama.RGBD]:
    """Six frames of a world, from cameras that stand in a line of that length and look the same way."""
    made = build(seed, None, ())
    return [made.frame(moved(made.camera(0, 128), shift=(metres * number / 5, 0, 0))) for number in range(6)]


@pytest.mark.parametrize("seed", first_quick([3, 1, 11]))
def test_frames_far_apart_show_no_scale(seed: int, tmp_path: Path) -> None:
    """Oracle: the poses are right. Frames between which others cannot be read are no neighbours; two that fit as well from one
    place show no scale; poses of neighbours in millimetres are named."""
    frames = drive(seed, 20.0)
    write_frames(tmp_path, frames)
    for number in range(1, 5):
        (tmp_path / f"images/{number}.png").unlink()
    assert {each.check for each in dlama.diagnose(tmp_path)} <= {"reading", "no-overlap", "understood"}
    ends = {"0": shrink(frames[0]), "5": shrink(frames[5])}
    assert "pose-scale" not in {each.check for each in compare_frames(ends, "05", "scene")}
    near = dict(zip("01", map(shrink, at_poses(drive(seed, 2.0)[:2], scaled(1000)))))
    assert [each.check for each in compare_frames(near, "01", "scene")] == ["pose-scale"]


def test_frames_of_several_sizes_are_named(tmp_path: Path) -> None:
    """Oracle: `dlama sequence` refuses them, and calls them so."""
    made = build(12, None, ())
    cameras = [dlama.orbit(made.camera(0, 96 if number == 2 else 128), 8.0 * number) for number in range(6)]
    write_frames(tmp_path, [made.frame(camera) for camera in cameras])
    sizes, understood = dlama.diagnose(tmp_path)
    assert (sizes.check, sizes.severity, understood.check) == ("frame-sizes", "fault", "understood")
    assert f"5 of 6 frames are 128x128, not {tmp_path.name}/2 (96x96); `dlama sequence` takes one size" in sizes.what
    with pytest.raises(dlama.ShapeError, match="frame 2 is 96x96 and frame 0 128x128; both must have the same size"):
        dlama.sequence(tmp_path)


def test_cameras_that_shift_sideways_are_fine(tmp_path: Path) -> None:
    """Oracle: exact frames. That none turns, as cases of `dlama evaluate` do, was the fault "no-overlap"."""
    write_frames(tmp_path, drive(12, 0.25)[:5])
    assert [each.check for each in dlama.diagnose(tmp_path)] == ["understood"]
    with pytest.raises(dlama.FileError, match="no two of its 5 frames turn by 10 to 60 degrees, as those of a case do"):
        open_dataset(tmp_path)


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize("name", ["dining_vpi", "kitchen_sequence", "table_vpi"])
def test_real_frames(name: str) -> None:
    """Oracle: the sets are good; each fault put into the second frame is named."""
    frames = [each.load() for each in open_dataset(Path(os.environ["DLAMA_DATA"]) / "data" / name).frames[:6]]
    assert odd(frames) == []
    for fault in FRAMES:
        assert [(each.check, each.what[0]) for each in odd(spoilt(frames, 1, fault))] == [("depth-scale", "1")]
