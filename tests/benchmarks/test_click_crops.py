"""Crops that the network of clicks learns from: closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import click_crops
from click_photos import innermost_pixel, largest_region
from clicks import Click
from dlama import RGBD, Camera
from dlama.models.network_file import NetworkFile
from dlama.perception.masks.click_network import PLANES, SIDE, network

pytest.importorskip("torch")
pytest.importorskip("onnx")

import click_network
from shadow_export import export_shadow, read_shadow

DISC = (np.arange(40)[:, None] - 19.5) ** 2 + (np.arange(40) - 19.5) ** 2 < 15**2
RED = np.zeros((40, 40, 3), np.uint8) + np.uint8([200, 0, 0]), DISC
"""A red disc of 30 px."""


@pytest.mark.parametrize("on_click", [True, False])
def test_a_cut_out_on_a_crop(monkeypatch: pytest.MonkeyPatch, on_click: bool) -> None:
    """Where the click is it is the object, to the pixel of what turned red, and is not cut off; elsewhere it hides the object."""
    monkeypatch.setattr(click_network, "ON_CLICK", float(on_click))
    monkeypatch.setattr(click_network, "ELSEWHERE", float(not on_click))
    changed = 0
    for seed in range(8):
        planes = np.zeros((len(PLANES), SIDE, SIDE), np.float32)
        planes[PLANES.index("inside")] = 1
        truth = np.stack([np.ones((SIDE, SIDE), np.float32), np.zeros((SIDE, SIDE), np.float32)])
        click_network.put_cut_out(planes, truth, [RED], np.random.default_rng(seed))
        red = planes[1] < -0.5
        if not red.any():
            continue
        changed += 1
        if on_click:
            np.testing.assert_array_equal(truth[0] > 0, red)
            assert red[SIDE // 2, SIDE // 2] and truth[1].all()
            assert abs(red.sum() / np.ptp(np.flatnonzero(red.any(0))) ** 2 - np.pi / 4) < 0.25
        else:
            np.testing.assert_array_equal(truth[0] == 0, red)
            assert not red[SIDE // 2, SIDE // 2] and not truth[1].any()
    assert changed > 3


def test_a_background_seen_nearer() -> None:
    """Closed form: twice as near, slopes per pixel are half as steep and an edge is twice as far from the click."""
    planes = np.zeros((len(PLANES), SIDE, SIDE), np.float32)
    planes[PLANES.index("right")] = 1
    planes[0, :, SIDE // 2 + 20 :] = 1
    near = click_network.seen_nearer(planes, 2.0)
    assert (near[PLANES.index("right")] == 0.5).all()
    edge = int(np.argmax(near[0, SIDE // 2] > 0.5))
    assert abs(edge - (SIDE // 2 + 40)) <= 1


@pytest.mark.parametrize("estimated", [False, True])
def test_an_object_is_at_the_click(estimated: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Positive for crops with a red square before a wall, negative for those of the wall alone; the first output stays.
    Crops of the other kind of depth are left alone."""
    monkeypatch.setattr(click_network, "OBJECT_STEPS", 300)
    rng = np.random.default_rng(0)
    planes, truth = np.zeros((40, len(PLANES), SIDE, SIDE), np.float16), np.zeros((40, 2, SIDE, SIDE), np.uint8)
    for crop, target in zip(planes[::2], truth[::2]):
        square = slice(SIDE // 2 - rng.integers(8, 30), SIDE // 2 + rng.integers(8, 30))
        crop[0, square, square], crop[PLANES.index("distance")], target[0, square, square] = 1, -1, 255
        crop[PLANES.index("distance"), square, square] = 0
    planes[:, PLANES.index("known")] = planes[:, PLANES.index("inside")] = truth[:, 1] = 1
    salient = np.zeros_like(truth)
    for number, kind in enumerate((estimated, not estimated)):
        planes[:, PLANES.index("estimated")] = kind
        for what, values in (("planes", planes), ("truth", truth), ("salient", salient)):
            np.save(tmp_path / f"world-0000{number}.{what}.npy", values)
    planes[:, PLANES.index("estimated")] = estimated
    start = network(estimated)
    maps, at_object = click_network.maps_at_clicks(start.path, tmp_path)
    assert len(maps) == 40 and at_object.sum() == 20
    learned = click_network.fit_object(maps, at_object)
    file = NetworkFile(export_shadow(read_shadow(start.path) | learned, tmp_path / "click.onnx", {}))
    seen = np.concatenate([planes, salient], 1) if estimated else planes
    feed = {"planes": seen.astype(np.float32)}
    logits, object_ = file.run_all(feed)
    np.testing.assert_array_equal(logits, start.run_all(feed)[0])
    there = truth[:, 0].any((1, 2))
    assert (object_[there] > 0).all() and (object_[~there] < 0).all()


def test_crops_of_the_background() -> None:
    """Two clicks of two squares each, none on or near the object; nothing belongs to an object."""
    hw = 90, 120
    depth, object_ = np.full(hw, 2.0, np.float32), np.zeros(hw, np.bool_)
    object_[10:50, 30:70] = True
    depth[object_] = 1
    color = np.full((*hw, 3), 255, np.uint8)
    color[click_crops.dilate_mask(object_, click_crops.BESIDE_PX - 1)] = 0
    frame = RGBD(color, depth, Camera.from_fov(120, 90, 60))
    crops = list(click_crops.crops_of_background(frame, ~object_, np.random.default_rng(0)))
    assert len(crops) == 4
    for planes, salient, truth, counts in crops:
        assert not truth.any() and counts.all() and not salient.any()
        assert planes[0, SIDE // 2, SIDE // 2] > 0.9


def test_the_score_of_a_click_on_nothing() -> None:
    """1 where nothing is found, else 0; on an object the intersection over union of what counts."""
    nothing, some = np.zeros((4, 4), np.bool_), np.eye(4, dtype=np.bool_)
    assert [Click((0, 0), nothing, nothing).score(found) for found in (nothing, some)] == [1, 0]
    assert Click((0, 0), some, ~some).score(np.ones_like(some)) == 1
    assert Click((0, 0), some, nothing).score(np.ones_like(some)) == 0.25


def square(top: int, left: int, side: int) -> np.ndarray:
    out = np.zeros((60, 60), bool)
    out[top : top + side, left : left + side] = True
    return out


def test_where_to_click() -> None:
    """The innermost pixel of a square is its middle, of two the larger one's; at the picture's rim it is off the rim."""
    assert all(abs(one - 20) <= 1 for one in innermost_pixel(square(11, 11, 19)))
    both = square(5, 5, 9) | square(30, 30, 21)
    np.testing.assert_array_equal(largest_region(both), square(30, 30, 21))
    x, y = innermost_pixel(square(0, 0, 21))
    assert 9 <= x <= 11 and 9 <= y <= 11
