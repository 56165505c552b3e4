"""EasySynth's layout written: there and back through the reader, and the bytes that EasySynth's own writer would give."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np
import pytest

from dlama.datasets.easysynth.dataset import easysynth
from dlama.datasets.easysynth.writer import LEFT, RIGHT, SequenceFrame, write_scene
from dlama.datasets.frames import RemovalTruth, StereoTruth, ViewTruth
from dlama.errors import OutputError
from dlama.files.rasters.exr_files import read_exr
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rgbd import RGBD
from worlds import Box, Plane, World, moved

CLASSES = {"background": (0, 0, 0), "object": (255, 0, 0), "sky": (70, 130, 180)}
ROOM = (Plane((0, 1.2, 0), (0, -1, 0)), Plane((0, 0, 7), (0, 0, -1)))
OBJECT = Box((-0.4, 0.4, 2.2), (0.4, 1.2, 2.8))
CAMERA = moved(Camera.from_fov(40, 30, 70), turn=(3, 20, -2), shift=(0.3, -0.2, 0.1))


def shot(camera: Camera, item: bool = True) -> SequenceFrame:
    """A frame of the room; the box is shape 2, what no shape covers is sky."""
    world = World((*ROOM, OBJECT) if item else ROOM)
    _, number = world.trace(camera)
    return SequenceFrame(world.rgbd(camera), np.select([number == 2, number < 0], [1, 2], 0).astype(np.uint8))


@functools.cache
def orbiting(item: bool = True) -> tuple[SequenceFrame, ...]:
    return tuple(shot(orbit(CAMERA, yaw), item) for yaw in (0, 10, -10, 25))


@functools.cache
def pair(item: bool = True) -> dict[str, list[SequenceFrame]]:
    right = moved(CAMERA, shift=(0.1, 0, 0))
    return {LEFT: [shot(CAMERA, item)], RIGHT: [shot(right, item)]}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of all four sequences."""
    root = tmp_path_factory.mktemp("worlds")
    sequences = {
        "with": orbiting(),
        "without": iter(orbiting(item=False)),  # may be gone through once only
        "stereo_with": pair(),
        "stereo_without": pair(item=False),
    }
    write_scene(root, "w01", sequences, depth_range=10.0, classes=CLASSES)
    return root / "w01"


def assert_same(read: RGBD, wrote: RGBD, tolerance_m: float = 0.0005) -> None:
    """Colour exactly, depth to half a millimetre, far and missing as they were, camera to rounding."""
    np.testing.assert_array_equal(read.color, wrote.color)
    np.testing.assert_array_equal(read.far, wrote.far)
    np.testing.assert_array_equal(read.missing, wrote.missing)
    np.testing.assert_allclose(read.depth[read.valid], wrote.depth[read.valid], atol=tolerance_m + 1e-6, rtol=0)
    assert read.camera.same_lens_as(wrote.camera)
    np.testing.assert_allclose(read.camera.world_from_cam, wrote.camera.world_from_cam, atol=1e-8)


def test_a_scene_there_and_back(scene: Path) -> None:
    """Round trip: all frames, cameras, yaws, masks and truths that were written are read."""
    data = easysynth(scene)
    wrote = orbiting()
    for number, frame in enumerate(each for each in data.frames if each.name.startswith("with-")):
        assert_same(frame.load(), wrote[number].rgbd)
        assert frame.yaw == pytest.approx((0, 10, -10, 25)[number], abs=2e-3)
    assert [case.yaw for case in data.of("vpi")] == pytest.approx([10, -10, 25], abs=2e-3)
    view, removal, stereo = (data.of(protocol)[0].load() for protocol in ("vpi", "ori", "sii"))
    assert isinstance(view, ViewTruth) and view.target_without is not None and view.object_mask is not None
    assert_same(view.target, wrote[1].rgbd)
    assert_same(view.target_without, orbiting(item=False)[1].rgbd)
    assert isinstance(removal, RemovalTruth)
    np.testing.assert_array_equal(removal.mask, wrote[0].semantic == 1)
    assert_same(removal.without, orbiting(item=False)[0].rgbd)
    assert isinstance(stereo, StereoTruth) and stereo.mask_right is not None and stereo.without_right is not None
    np.testing.assert_array_equal(stereo.mask_right, pair()[RIGHT][0].semantic == 1)
    assert_same(stereo.without_right, pair(item=False)[RIGHT][0].rgbd)
    assert stereo.rig.baseline_m == pytest.approx(0.1, abs=1e-8)


def test_disparity_is_that_of_the_depth(scene: Path) -> None:
    """Closed form: f b / Z of the traced depth, 0 for the sky."""
    stereo = easysynth(scene).of("sii")[0].load()
    assert isinstance(stereo, StereoTruth) and stereo.disparity_right is not None
    depth, _ = World((*ROOM, OBJECT)).trace(pair()[RIGHT][0].rgbd.camera)
    expected = CAMERA.fx * 0.1 / depth
    np.testing.assert_allclose(stereo.disparity_right, expected, atol=1e-2, rtol=1e-3)
    assert (stereo.disparity_right[~np.isfinite(depth)] == 0).all()


def test_the_exr_holds_normalised_half_floats(scene: Path) -> None:
    """Closed form: depth / range in half precision, 1 beyond the range, the same in R, G and B, A = 1."""
    path = scene / "with" / "CameraComponent" / "DepthImage" / "w01_with.0000.exr"
    depth = orbiting()[0].rgbd.depth
    for channel in "RGB":
        np.testing.assert_array_equal(read_exr(path, channel), np.minimum(depth / 10, 1).astype(np.float16))
    assert (read_exr(path, "A") == 1).all()


def test_text_files_are_as_easysynth_writes_them(scene: Path) -> None:
    """Frozen: header, t from one frame time on, the rig in cm to the right along Y, last intrinsic 0, classes without header."""
    lines = (scene / "with" / "CameraPoses.csv").read_text().splitlines()
    assert lines[0] == "id,tx,ty,tz,qx,qy,qz,qw,t" and len(lines) == 5
    times = [float(line.split(",")[-1]) for line in lines[1:]]
    assert times == pytest.approx([1 / 30, 2 / 30, 3 / 30, 4 / 30], abs=1e-6)
    assert (scene / "with" / "CameraComponent" / "CameraPoses.csv").read_text().splitlines() == lines
    rig = json.loads((scene / "stereo_with" / "CameraRig.json").read_text())["cameras"]
    assert list(rig) == ["c0", "c1"] and rig["c0"]["translation"] == [0, 0, 0]
    assert rig["c1"]["translation"] == pytest.approx([0, 10, 0], abs=1e-6)
    assert rig["c1"]["intrinsics"][-1] == 0 and rig["c1"]["sensor_size"] == [40, 30]
    classes = (scene / "with" / "SemanticClasses.csv").read_text()
    assert classes == "background,0,0,0\nobject,255,0,0\nsky,70,130,180\n"


def test_depth_states_and_limits_survive(tmp_path: Path) -> None:
    """Round trip: missing stays missing, far stays far, and what millimetres in 16 bits cannot say is far."""
    depth = np.array([[0, np.inf, 65.534, 65.6], [0.0012, 1, 10, 20]], np.float32)
    camera = Camera.from_fov(4, 2, 90)
    frame = SequenceFrame(RGBD(np.zeros((2, 4, 3), np.uint8), depth, camera), np.zeros((2, 4), np.uint8))
    write_scene(tmp_path, "s", {"with": [frame]}, depth_range=10, classes=CLASSES)
    read = easysynth(tmp_path / "s" / "with").frames[0].load().depth
    np.testing.assert_allclose(read, [[0, np.inf, 65.534, np.inf], [0.001, 1, 10, 20]], atol=1e-6)


def test_nothing_is_left_of_a_writing_that_fails(tmp_path: Path) -> None:
    """Atomic: a generator that breaks after two frames leaves neither the scene nor a draft."""

    def breaking() -> object:
        yield from orbiting()[:2]
        raise RuntimeError("no third frame")

    with pytest.raises(RuntimeError, match="no third frame"):
        write_scene(tmp_path / "out", "w", {"with": breaking()}, depth_range=10, classes=CLASSES)  # type: ignore[dict-item]
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_writing_is_not_mixed_with(scene: Path) -> None:
    """Guard: a scene that is there already is refused, and stays as it was."""
    before = sorted(scene.rglob("*"))
    with pytest.raises(OutputError, match="not empty"):
        write_scene(scene.parent, "w01", {"with": orbiting()}, depth_range=10, classes=CLASSES)
    assert sorted(scene.rglob("*")) == before
