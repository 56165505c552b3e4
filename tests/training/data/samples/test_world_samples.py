"""Samples of procedural worlds: what goes in is what the method meets at run time, what should come out is true."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from toy_runs import samples_of

from dlama.geometry.projection import inverse_depth
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.networks.view_tensors import DepthPlane, robust_scale
from dlama.training.data.batches import check_sample
from dlama.training.data.samples import views as view_samples
from dlama.training.data.samples import world_views
from dlama.training.data.samples import worlds as world_samples
from dlama.training.data.samples.views import ViewExample, pair_sample, view_sample
from dlama.training.data.samples.world_views import WorldSet
from dlama.training.data.samples.worlds import world_pair, world_removal, world_view
from dlama.training.data.sources import source_for
from dlama.training.settings import NetworkSettings
from tiny_networks import contract_of_planes
from worlds import pixels_of, points_of

RGBD_NET = NetworkSettings("rgbd")
SIZE = 64
CLEAN = (0, 1, 8, 9)
"""Indices of two worlds."""
KINDS = {"world": "rgbd", "removal": "rgbd", "stereo": "stereo-two-masks"}


@pytest.fixture(scope="module")
def clean() -> list[ViewExample]:
    """Questions of two pairs of cameras in each of two worlds, a room and a street, without faults of a sensor."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(world_samples, "add_depth_faults", lambda rgbd, rng, sensor_holes=False: rgbd)
        patch.setattr(world_samples, "SENSOR_SHARE", 0.0)
        return [world_view(WorldSet("train", 128), index, np.random.default_rng(index)) for index in CLEAN]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("split", ["train", "held_out"])
def test_every_kind_makes_samples(kind: str, split: Any) -> None:
    """check_sample agrees; the same index and state of the generator give the same bytes, another state others."""
    chosen = samples_of(KINDS[kind], **{kind: 1.0})
    source = source_for(chosen, [], split)
    for index in (0, 1):
        made, same, other = (source.sample(index, np.random.default_rng([seed, index])) for seed in (1, 1, 2))
        check_sample(made, chosen.network, SIZE)
        assert all(np.array_equal(made[key], same[key]) for key in made)
        assert not np.array_equal(made["input"], other["input"])


def test_input_is_what_joint_would_feed(monkeypatch: pytest.MonkeyPatch, clean: list[ViewExample]) -> None:
    """Oracle: the filler `joint` itself, with an engine that keeps the planes it is given; sensor holes as well."""
    from dlama.inpainters.networks import lama

    fed: list[np.ndarray] = []

    class Engine:
        contract, path, notes = contract_of_planes(4), "none", {}

        def fill(self, planes: np.ndarray, hole: np.ndarray) -> np.ndarray:
            fed.append(np.concatenate([planes[0] * ~hole, hole[None]]).astype(np.float32))
            return planes

    monkeypatch.setattr(lama, "open_engine", lambda *args, **options: Engine())
    fill = lama.joint_filler("none.onnx")
    worlds = WorldSet("train", SIZE)
    frame = worlds.views(0).frame(0)
    for example in (
        *clean,
        world_samples.sensor_hole_example(frame, np.random.default_rng(0)),
        world_removal(worlds, 1, np.random.default_rng(1)),
    ):
        fill(example.view, FillContext(example.law), 0)
        assert np.array_equal(view_sample(example, RGBD_NET)["input"], fed[-1])


def test_what_is_to_be_filled_was_hidden(clean: list[ViewExample]) -> None:
    """Oracle: the camera model. True points of the hole lie outside the source's picture or behind what it measured there,
    true points of known pixels do not."""
    hidden, shown = [], []
    for example in clean:
        (camera, measured), *_ = example.law.measured
        points = points_of(example.view.camera, np.minimum(example.truth.depth, np.float32(1e4)))
        x, y, z = pixels_of(camera, points)
        inside = (z > 0) & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
        at = (np.where(inside, value, 0).astype(int) for value in (y, x))
        unseen = ~inside | (z > 1.02 * measured[tuple(at)])
        hidden.append(unseen[example.view.hole].mean())
        shown.append(unseen[~example.view.hole].mean())
    assert min(hidden) > 0.7 and np.mean(hidden) > 0.85 and max(shown) < 0.1


def test_target_is_the_true_frame_where_both_agree(clean: list[ViewExample]) -> None:
    """The world's own frame, and its inverse depth over the scale that the view's known pixels set, cut at 1."""
    for example in clean:
        made = view_sample(example, RGBD_NET)
        assert view_samples.truth_agrees(example)
        assert np.array_equal(np.rint(made["target"][:3] * 255).transpose(1, 2, 0), example.truth.color)
        w = inverse_depth(np.where(example.view.hole, 0, example.view.depth))
        scale = np.quantile(w[w > 0], 0.99) / 0.75
        true = np.minimum(inverse_depth(example.truth.depth) / scale, 1)
        assert np.allclose(made["target"][3], true, atol=1e-5) and (made["known_depth"] == 1).all()


def test_other_light_keeps_the_views_own_pixels(clean: list[ViewExample]) -> None:
    """Where the truth does not show what the view shows, known pixels of the target are the input's."""
    example = clean[0]
    dark = type(example.truth)(example.truth.color // 3, example.truth.depth, example.truth.camera)
    made = view_sample(ViewExample(example.view, dark, example.law), RGBD_NET)
    known = np.broadcast_to(~example.view.hole, (4, *example.view.hole.shape))
    assert np.array_equal(made["target"][known], made["input"][:4][known])
    in_hole = np.rint(made["target"][:3] * 255).transpose(1, 2, 0)[example.view.hole]
    assert np.array_equal(in_hole, dark.color[example.view.hole])


def test_the_limit_is_the_laws(clean: list[ViewExample]) -> None:
    """What `joint` makes of a plane at the limit keeps the law, and a little nearer breaks it (oracle: Law.violations), also
    where only the far is lawful; the truth never exceeds the limit."""
    far = 0
    for example in clean:
        made = view_sample(example, RGBD_NET)
        limit, hole = made["limit"][0], example.view.hole
        assert (made["target"][3] <= limit * (1 + 1e-6))[hole].all() and np.isinf(limit[~hole]).all()
        plane = DepthPlane.of(example.view, robust_scale)
        true = inverse_depth(example.truth.depth) / plane.scale
        inner = hole & np.isfinite(limit) & (limit > true * 1.001)
        far += int((inner & (limit == np.float32(plane.far_below))).sum())
        assert inner.sum() > 50
        for share, breaks in ((1 - 1e-4, False), (1 + 1e-4, True)):
            depth = plane.metres(np.where(inner, limit * np.float32(share), np.float32(1)))
            found = example.law.violations(example.view.camera, depth, inner)[inner]
            assert found.mean() > 0.98 if breaks else found.mean() < 0.02
    assert far > 50


def test_removed_objects_leave_true_background() -> None:
    """Outside the mask the truth is the frame; inside it is nowhere nearer than what was there (up to the law), and over the
    middle of the object of interest it is the frame of the world without that object, but for its shadow's colour."""
    worlds, checked = WorldSet("train", SIZE), 0
    for index in range(6):
        views = worlds.views(index)
        number = index % len(views.cameras)
        group = views.raycast(number).group
        item = views.world.object_index
        where = group == item
        if not where.any():
            continue
        truth, frame = world_samples.frame_without(views, number, item, where), views.frame(number)
        without = views.world.frame(frame.camera, object=False)
        assert np.array_equal(truth.color[~where], frame.color[~where])
        assert np.array_equal(truth.depth[where], without.depth[where])
        assert (truth.depth[where] > frame.depth[where]).all()
        made = view_sample(world_removal(worlds, index, np.random.default_rng(index)), RGBD_NET)
        assert (made["target"][3] <= made["limit"][0] * (1 + 1e-6)).all()
        checked += 1
    assert checked >= 3


def test_pairs_agree_by_disparity() -> None:
    """Oracle: the camera model. A right picture's true pixels have the colours of the left one, moved by fx b / z."""
    worlds = WorldSet("train", 128)
    example, views = world_pair(worlds, 0, np.random.default_rng(0)), worlds.stereo_views(0)
    made = pair_sample(example, NetworkSettings("stereo-two-masks"))
    left, right = views.pairs[0]
    camera, other = views.cameras[left], views.cameras[right]
    depth = views.raycast(left).depth
    x, y, _ = pixels_of(other, points_of(camera, np.minimum(depth, np.float32(1e5))))
    shift = x - (np.arange(128) + 0.5)
    assert np.abs(y - (np.arange(128) + 0.5)[:, None]).max() < 1e-6 and shift.max() <= 1e-3
    known = (made["mask"][0] == 0) & (x > 1) & (x < 127)
    moved = made["target"][3:][:, np.nonzero(known)[0], x[known].astype(int)]
    difference = np.abs(moved - made["target"][:3][:, known]).max(0)
    assert np.median(difference) < 0.04
    still = np.abs(made["target"][3:] - made["target"][:3])[:, known].max(0)
    assert difference.mean() < 0.8 * still.mean()


def test_held_out_worlds_are_others() -> None:
    """No seed is shared; held-out indices each have a world of their own, trained ones come in runs."""
    train, held = WorldSet("train", SIZE), WorldSet("held_out", SIZE)
    names = [
        {each.views(index).world.shapes.tobytes() for index in range(0, 3 * each.group_size, each.group_size)}
        for each in (train, held)
    ]
    assert not names[0] & names[1] and all(len(found) == 3 for found in names)
    first, last = world_views.FIRST_SEED["train"], world_views.FIRST_SEED["train"] + len(train) // train.group_size
    assert not first <= world_views.FIRST_SEED["held_out"] < last
    assert train.views(0).world is train.views(train.group_size - 1).world is not train.views(train.group_size).world


def digest() -> str:
    """Of one sample of each kind."""
    bytes_ = hashlib.sha256()
    for kind, planes in KINDS.items():
        made = source_for(samples_of(planes, **{kind: 1.0}), [], "train").sample(5, np.random.default_rng(9))
        for key in sorted(made):
            bytes_.update(made[key].tobytes())
    return bytes_.hexdigest()


@pytest.mark.slow
def test_same_bytes_in_another_process() -> None:
    """With another hash seed and another number of threads."""
    code = "import sys; sys.path[:0] = sys.argv[1:]; import test_world_samples as t; print(t.digest())"
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONHASHSEED": "7", "NUMBA_NUM_THREADS": "2"}
    command = [sys.executable, "-c", code, str(here), *map(str, here.parents[1:3])]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    assert done.stdout.split()[-1] == digest()


def test_law_of_a_masked_frame_keeps_the_object() -> None:
    """A removed object's own depth still limits what is filled; a random mask's does not."""
    frame = WorldSet("train", SIZE).views(0).frame(0)
    taken = np.zeros(frame.camera.hw, bool)
    taken[20:30, 20:30] = True
    item, none = world_samples.mask_example(frame, taken, frame), world_samples.mask_example(frame, taken)
    assert (item.law.measured[0][1][taken] > 0).all() and not none.law.measured[0][1][taken].any()
    assert np.array_equal(item.law.measured[0][1][taken], Law.of(Scene((View.from_rgbd(frame),))).measured[0][1][taken])
