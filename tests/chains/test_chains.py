"""Random chains of removals, completions, frames added, and writing and reading back (oracles: laws; the closed-form world).

However a scene came about, it is what its frames give when all objects are removed at once and the cameras since the last removal
are completed: bit for bit. What was measured keeps its bits, what was filled hides nothing that was measured, and of what was
removed nothing is measured any more. A chain that breaks a law is shrunk and printed as a list of steps.
"""

from __future__ import annotations

import functools
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import dlama
from dlama.errors import ShapeError
from dlama.files.scenes.scene_npz import read_npz, write_npz
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.projection import disparity_from_depth
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, violations
from whole_picture import assert_same_view
from worlds import Box, Plane, Sphere, World, moved, pixels_of

CAMERA = Camera.from_fov(64, 48, 65)
OBJECTS = {
    "lamp": Sphere((-1.3, 0.5, 3.4), 0.3),
    "ball": Sphere((1.3, 0.6, 3.0), 0.35),
    "globe": Sphere((-0.2, 0.7, 4.4), 0.25),
}
GROUND = (Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.6, 6), (9, 1, 7)))
WORLD = World((*GROUND, *OBJECTS.values()))
YAWS = (-9.0, 0.0, 7.0)
FILLED = (Origin.FILLED, Origin.DEPTH_FILLED)


@dataclass(frozen=True)
class Remove:
    """An object, masked in one frame; with a camera, removed by `complete`."""

    name: str
    frame: int = 0


@dataclass(frozen=True)
class Complete:
    """From so many degrees aside."""

    yaw: float


@dataclass(frozen=True)
class AddFrame:
    """Taken from so many degrees aside."""

    yaw: float


@dataclass(frozen=True)
class ReadBack:
    """Write scene.npz and continue with what it holds."""


Step = Remove | Complete | AddFrame | ReadBack


def frame_of(camera: Camera) -> RGBD:
    """What the camera takes, with two sensor holes: on the ground, and across the ball."""
    plain = WORLD.rgbd(camera)
    depth = plain.depth.copy()
    depth[40:43, 20:26] = depth[34:37, 44:52] = 0
    return RGBD(plain.color, depth, camera)


@functools.cache
def start(kind: str) -> Scene:
    """The scene that a chain begins with."""
    if kind == "pair":
        rig = StereoRig(CAMERA, moved(CAMERA, shift=(0.12, 0, 0)))
        left, right = frame_of(rig.left), frame_of(rig.right)
        disparity = disparity_from_depth(left.depth, rig)
        return dlama.stereo(left.color, right.color, rig, disparity=disparity, filler="telea").scene.unfilled
    cameras = [CAMERA] if kind == "photo" else [orbit(CAMERA, yaw, 0, 3.5) for yaw in YAWS]
    return dlama.scene([frame_of(camera) for camera in cameras])


def mask_of(name: str, camera: Camera) -> np.ndarray:
    """H x W, True where the camera shows that object."""
    return WORLD.trace(camera)[1] == len(GROUND) + list(OBJECTS).index(name)


def masks_of(scene: Scene, removals: list[Remove]) -> dict[int, np.ndarray]:
    """Number of a frame -> what of the objects is masked in it."""
    masks: dict[int, np.ndarray] = {}
    for one in removals:
        mask = mask_of(one.name, scene.frames[one.frame].camera)
        masks[one.frame] = masks.get(one.frame, False) | mask
    return masks


def completed(scene: Scene, yaw: float) -> tuple[View, Scene]:
    done = dlama.complete(scene, [orbit(CAMERA, yaw, 0, 3.5)], filler="telea")
    return done.view, done.scene


def run(begin: Scene, chain: list[Step]) -> tuple[Scene, Scene, list[View]]:
    """The scene after a chain, the same as it was measured, and the views on the way; each is held to the laws of its time."""
    scene, measured, views = begin, begin, list[View]()
    removed = set[str]()
    for step in chain:
        if isinstance(step, Remove):
            scene = scene.without(masks_of(begin, [step]))
            removed.add(step.name)
        elif isinstance(step, Complete):
            view, scene = completed(scene, step.yaw)
            views.append(view)
            assert_laws(measured, removed, view)
        elif isinstance(step, AddFrame):
            frame = frame_of(orbit(CAMERA, step.yaw, 0, 3.5))
            scene, measured = scene.with_frame(frame), measured.with_frame(frame)
        else:
            scene = read_back(scene)
        for layer in (one.load() for one in scene.layers):
            assert_laws(measured, removed, layer)
    return scene, measured, views


def read_back(scene: Scene) -> Scene:
    with tempfile.TemporaryDirectory() as folder:
        write_npz(Path(folder) / "scene.npz", scene.frames[0], scene)
        return read_npz(Path(folder) / "scene.npz")[1]


def run_at_once(begin: Scene, chain: list[Step]) -> tuple[Scene, list[View]]:
    """The same with all frames given and then all objects removed at once; and the views since then."""
    added = [frame_of(orbit(CAMERA, step.yaw, 0, 3.5)) for step in chain if isinstance(step, AddFrame)]
    for frame in added:
        begin = begin.with_frame(frame)
    removals = [step for step in chain if isinstance(step, Remove)]
    last = max((place for place, step in enumerate(chain) if isinstance(step, Remove)), default=-1)
    scene, views = begin.without(masks_of(begin, removals)) if removals else begin, list[View]()
    for step in chain[last + 1 :]:
        if isinstance(step, Complete):
            view, scene = completed(scene, step.yaw)
            views.append(view)
    return scene, views


def order_matters(chain: list[Step]) -> bool:
    """Whether a frame is added after something was removed or completed, or an object is carried from two frames in turn."""
    removed = [step.name for step in chain if isinstance(step, Remove)]
    done = False
    for step in chain:
        if isinstance(step, AddFrame) and done:
            return True
        done |= isinstance(step, (Remove, Complete))
    return len(removed) != len(set(removed))


def assert_measured_bits_stay(begin: Scene, view: View) -> None:
    """Law: where a view of a frame's camera says measured, of depth or of colour alone, it is that frame's."""
    for frame in begin.frames:
        if view.camera.same_view_as(frame.camera):
            measured = view.origin == Origin.MEASURED
            colored = measured | ((view.origin == Origin.DEPTH_FILLED) & (view.hole_type == HoleType.SENSOR))
            np.testing.assert_array_equal(view.depth[measured], frame.depth[measured])
            np.testing.assert_array_equal(view.color[colored], frame.color[colored])


def assert_visible(begin: Scene, view: View) -> None:
    """Law: what was filled hides nothing that the start measured, removed objects included."""
    assert not violations(view, Law.of(begin)).any(), "what was filled hides what was measured"


def assert_gone(names: set[str], view: View) -> None:
    """Law: no pixel that was measured shows a removed object."""
    measured = view.valid & ~np.isin(view.origin, (*FILLED, Origin.UNKNOWN))
    points = dlama.lift(view.without(~measured, HoleType.NONE)).points
    for name in names:
        assert not (OBJECTS[name].distance(points) < 1e-3).any(), f"{name} is shown as measured"


def assert_laws(measured: Scene, removed: set[str], view: View) -> None:
    assert_visible(measured, view)
    assert_measured_bits_stay(measured, view)
    assert_gone(removed, view)


def chains(kind: str) -> st.SearchStrategy[list[Step]]:
    frames = st.integers(0, len(start(kind).frames) - 1)
    removal = st.builds(Remove, st.sampled_from(list(OBJECTS)), frames)
    view = st.builds(Complete, st.sampled_from([0.0, 12.0, -10.0]))
    frame = st.builds(AddFrame, st.sampled_from([3.5, -4.5]))
    return st.lists(removal | view | frame | st.just(ReadBack()), min_size=1, max_size=6, unique=True)


@pytest.mark.parametrize("kind", ["photo", "pair", pytest.param("sequence", marks=pytest.mark.slow)])
def test_chains_keep_the_laws(kind: str) -> None:
    begin = start(kind)

    @settings(
        report_multiple_bugs=False,
        max_examples=20,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate, Phase.shrink],
    )
    @given(chain=chains(kind))
    def check(chain: list[Step]) -> None:
        scene, _, views = run(begin, chain)
        if order_matters(chain):
            return
        expected, expected_views = run_at_once(begin, chain)
        assert len(scene.fills) == len(expected.fills)
        for one, other in zip(scene.layers, expected.layers):
            assert_same_view(one.load(), other.load())
        for one, other in zip(views[::-1], expected_views[::-1]):
            assert_same_view(one.load(), other.load())

    check()


def test_a_frame_added_is_a_frame_given() -> None:
    """Law: the scene of three frames is that of two with the third added: frames, numbers, names, gains and noise."""
    frames = [frame_of(orbit(CAMERA, yaw, 0, 3.5)) for yaw in YAWS]
    whole, grown = dlama.scene(frames), dlama.scene(frames[:2]).with_frame(frames[2])
    assert (whole.numbers, whole.gains, whole.noise, whole.names) == (
        grown.numbers,
        grown.gains,
        grown.noise,
        grown.names,
    )
    for one, other in zip(whole.frames, grown.frames):
        assert_same_view(one, other)


def test_what_a_new_frame_measured_takes_the_place_of_fills() -> None:
    """Law: what was filled and the new frame sees is shown as measured; what it does not see stays filled as it was."""
    camera, aside = orbit(CAMERA, 12, 0, 3.5), orbit(CAMERA, 10, 0, 3.5)
    filled = dlama.complete(start("photo"), [camera], filler="telea").scene
    grown = filled.with_frame(frame_of(aside))
    assert len(grown.frames) == 2 and grown.fills
    before, after = filled.fills[-1], grown.fills[-1]
    stays = ~after.hole
    assert (before.hole | stays).sum() < before.hole.size
    np.testing.assert_array_equal(after.depth[stays], before.depth[stays])
    points = dlama.lift(after.without(~after.filled, HoleType.NONE)).points
    x, y, z = pixels_of(aside, points)
    inside = (z > 0) & (x >= 0) & (x < 64) & (y >= 0) & (y < 48)
    shown = grown.frames[1].depth[y[inside].astype(int), x[inside].astype(int)]
    assert (z[inside] > shown).all()


def test_what_was_removed_is_removed_from_a_new_frame() -> None:
    """Law: the frame added shows nothing of it; its other pixels are its own, bit for bit."""
    frame = frame_of(orbit(CAMERA, 7, 0, 3.5))
    begin = start("photo")
    grown = begin.without(mask_of("ball", CAMERA)).without(mask_of("lamp", CAMERA)).with_frame(frame)
    added = grown.frames[1]
    gone = added.hole & (added.hole_type == HoleType.OBJECT)
    for name in ("ball", "lamp"):
        assert gone[mask_of(name, frame.camera)].all()
    assert not gone[mask_of("globe", frame.camera)].any() and gone.mean() < 0.25
    np.testing.assert_array_equal(added.color[~gone], frame.color[~gone])


def test_a_frame_that_fits_nothing_is_left_out() -> None:
    """Message and law: a picture given twice is warned of, and the scene stays; one of another size is refused."""
    begin = start("photo")
    with pytest.warns(UserWarning, match="frame 1 is frame 0 once more"):
        assert begin.with_frame(frame_of(CAMERA)) is begin
    with pytest.raises(ShapeError, match="frame 1 is 32x24 and frame 0 64x48"):
        begin.with_frame(WORLD.rgbd(Camera.from_fov(32, 24, 65)))
