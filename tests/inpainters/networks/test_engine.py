"""The engine and the fillers on it: tiny networks whose answer is known in closed form, and MI-GAN where it lies."""

from __future__ import annotations

from pathlib import Path
from unittest import mock

import cv2
import numpy as np
import pytest

from dlama.errors import FileError, InputError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import inpaint
from dlama.inpainters.networks import migan
from dlama.inpainters.networks.engine import Engine
from dlama.inpainters.opencv import telea
from dlama.models.network_file import PROVIDERS
from dlama.perception.resampling import smooth_quantised
from tiny_networks import constant, contract, echo_mask, written

pytest.importorskip("onnxruntime")
NOTHING = FillContext(Law(()))


def holed(hw: tuple[int, int] = (50, 61), far: bool = False) -> View:
    """Random colours and depths between 1 and 5 m, with a hole of taken-out pixels and one sensor hole."""
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 5, hw).astype(np.float32)
    depth[0, 0], depth[30:34, 40:50] = 1, 0
    if far:
        depth[:4, 1:] = np.inf
    frame = RGBD(rng.integers(0, 256, (*hw, 3), np.uint8), depth, Camera.from_fov(hw[1], hw[0], 60))
    taken = np.zeros(hw, bool)
    taken[10:25, 12:33] = True
    return View.from_rgbd(frame).without(taken, HoleType.OBJECT)


def unchanged(before: View, after: View) -> None:
    """Known pixels bit for bit, and measured colour in sensor holes too."""
    known = ~before.hole
    for name in ("color", "depth", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(after, name)[known], getattr(before, name)[known], err_msg=name)
    sensor = before.depth_hole
    np.testing.assert_array_equal(after.color[sensor], before.color[sensor])
    assert not after.hole.any() and (after.depth > 0).all()


def test_lama_fills_with_what_the_network_gives(tmp_path: Path) -> None:
    """Closed form: constant 0.2, 0.4, 0.6 is colour 51, 102, 153, and as grey 0.4 of the nearest inverse depth: 2.5 m."""
    view = holed()
    after, report = inpaint(view, find_filler("lama", constant(tmp_path / "c.onnx", 3, 0.2, 0.4, 0.6)), NOTHING)
    unchanged(view, after)
    np.testing.assert_array_equal(after.color[after.filled], np.broadcast_to([51, 102, 153], (15 * 21, 3)))
    np.testing.assert_allclose(after.depth[view.hole], 2.5, rtol=1e-5)
    assert report.notes["model"] == "c.onnx" and len(report.notes["model_sha256"]) == 64
    assert report.notes["provider"] in PROVIDERS and report.notes["threads"] >= 1


def test_joint_fills_colour_and_depth_in_one_pass(tmp_path: Path) -> None:
    """Closed form: four constants; depth 0.123, where 0.75 is the inverse depth that 99 % of the known pixels do not exceed,
    comes back without 8-bit steps."""
    view = holed()
    one = np.quantile(1 / view.depth[view.valid].astype(float), 0.99) / 0.75
    after, _ = inpaint(view, find_filler("joint", constant(tmp_path / "j.onnx", 4, 0, 1, 0.2, 0.123)), NOTHING)
    unchanged(view, after)
    np.testing.assert_array_equal(after.color[after.filled], np.broadcast_to([0, 255, 51], (15 * 21, 3)))
    np.testing.assert_allclose(after.depth[view.hole], 1 / (0.123 * one), rtol=1e-5)


def test_far_is_level_zero(tmp_path: Path) -> None:
    """Closed form: nearly 0 in a view with sky is sky, in a view without it is as far as it says."""
    model = constant(tmp_path / "z.onnx", 3, 0.01, 0.01, 0.01)
    sky, no_sky = (inpaint(holed(far=far), find_filler("lama", model), NOTHING)[0] for far in (True, False))
    assert np.isposinf(sky.depth[15, 15]) and abs(no_sky.depth[15, 15] - 100) < 1e-2


@pytest.mark.parametrize(("mask", "shown"), [("1 = fill", 1.0), ("0 = fill", 0.0)])
def test_the_network_sees_the_hole_zeroed_and_its_mask(tmp_path: Path, mask: str, shown: float) -> None:
    """Probe: in the hole only the mask's own half comes back, in its polarity, though colour lay there."""
    network = Engine(echo_mask(tmp_path / "m.onnx", 3, mask=mask))
    hole = np.zeros((40, 40), bool)
    hole[5:9, 5:9] = True
    planes = np.ones((1, 3, 40, 40), np.float32)
    np.testing.assert_allclose(network.run_planes(planes, hole)[0, 0][hole], 0.5 * shown)
    np.testing.assert_allclose(network.run_planes(planes, hole)[0, 0][~hole], 0.25 + 0.5 * (1 - shown))
    np.testing.assert_array_equal(network.fill(planes, hole)[..., ~hole], 1)


def test_bad_files_are_refused(tmp_path: Path) -> None:
    """Law: no file, no ONNX, no contract, other channels, a contract that lies, values that are not finite; each names the
    file."""
    (tmp_path / "text.onnx").write_text("no network")
    three = constant(tmp_path / "three.onnx", 3, 0.1, 0.1, 0.1)
    lying = written(tmp_path / "lying.onnx", 3, np.zeros((3, 4)), about=contract(4))
    nan = constant(tmp_path / "nan.onnx", 3, np.nan, 0, 0)
    with pytest.raises(FileError, match=r"none\.onnx: no such model file"):
        find_filler("lama", tmp_path / "none.onnx")
    for name, path, reported in (
        ("lama", tmp_path / "text.onnx", "text.onnx: cannot be opened .*dlama models convert"),
        (
            "lama",
            written(tmp_path / "bare.onnx", 3, np.zeros((3, 4)), about={}),
            r"bare\.onnx: carries no contract .*convert",
        ),
        ("joint", three, "three.onnx: takes 4 planes .*'lama' runs it"),
        ("migan", three, "three.onnx: is a network 'lama' by its contract; MI-GAN is expected"),
        ("joint", lying, "lying.onnx: the graph has 4 planes"),
        ("lama", nan, "nan.onnx: the network gave values that are not finite"),
    ):
        with pytest.raises(InputError, match=reported):
            inpaint(holed(), find_filler(name, path), NOTHING)


def test_steps_become_slopes_within_half_a_step() -> None:
    """Closed form: a staircase of levels comes back closer to its ramp; a high edge stays where it was; 0 stays 0."""
    ramp = np.tile(np.linspace(10, 20, 100, dtype=np.float32), (20, 1))
    levels = np.round(ramp)
    smooth = smooth_quantised(levels)
    assert abs(smooth - ramp)[:, 10:-10].mean() < 0.5 * abs(levels - ramp).mean()
    edge = np.where(np.arange(100) < 50, np.float32(0), np.float32(200)) * np.ones((20, 1), np.float32)
    assert abs(smooth_quantised(edge) - edge).max() <= 0.5 and (smooth_quantised(edge)[:, :50] == 0).all()


def test_migan_is_fed_what_it_can_bear(monkeypatch: pytest.MonkeyPatch) -> None:
    """Probe: no crack in the hole that it is given, for cracks are filled by diffusion; known pixels unchanged."""
    known = np.full((60, 60, 3), 200, np.uint8)
    hole = np.zeros((60, 60), bool)
    hole[20:30, 20:30] = hole[50, 40:58] = True
    known[hole] = 0
    network = mock.Mock(**{"contract.network": "migan"})
    monkeypatch.setattr(migan, "open_engine", lambda *_, **__: network)
    network.fill.side_effect = lambda planes, hole: np.where(hole, np.float32(77 / 255), planes)
    out = migan.migan_filler("any.onnx").paint(known, hole, 0)
    assert (out[20:30, 20:30] == 77).all() and (out[~hole] == 200).all() and out[50, 40:58].min() > 190
    planes, wide = network.fill.call_args.args
    assert wide.sum() == 100 and wide[20:30, 20:30].all()
    assert planes[..., ~wide].min() * 255 > 190, "no black was shown"


def test_cracks_are_diffused_as_in_the_whole_hole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twin: Telea of all of a hole with a ragged border, though far from its cracks nothing is diffused."""
    rng = np.random.default_rng(3)
    noise = cv2.GaussianBlur(rng.normal(size=(150, 200)).astype(np.float32), (0, 0), 9)
    hole = noise > np.quantile(noise, 0.6)
    hole[cv2.GaussianBlur(rng.normal(size=hole.shape), (0, 0), 1) > 0.35] = False  # notches
    hole[60:140, 80:180] = True
    color = cv2.GaussianBlur(rng.integers(0, 256, (*hole.shape, 3), np.uint8), (0, 0), 2)
    color[hole] = 0
    network = mock.Mock(**{"contract.network": "migan"})
    monkeypatch.setattr(migan, "open_engine", lambda *_, **__: network)
    network.fill.side_effect = lambda planes, hole: planes
    out = migan.migan_filler("any.onnx").paint(color, hole, 0)
    cracks = hole & ~network.fill.call_args.args[1]
    assert cracks.sum() > 200 and np.array_equal(out[cracks], telea.paint(color, hole, 0)[cracks])
    assert not out[80:120, 100:160].any(), "the middle of the hole is the network's"


@pytest.mark.slow
@pytest.mark.parametrize(("height", "width"), [(96, 128), (300, 700)])
def test_the_shipped_migan_continues_a_wall(height: int, width: int) -> None:
    """Closed form, loosely: grey continues grey, in pictures smaller and larger than the network's 512 px; no file is asked
    for."""
    color = np.random.default_rng(0).integers(118, 138, (height, width, 3), np.uint8)
    frame = RGBD(color, np.full((height, width), 2, np.float32), Camera.from_fov(width, height, 60))
    taken = np.zeros((height, width), bool)
    taken[height // 4 : height // 2, width // 8 : width - width // 8] = True
    view = View.from_rgbd(frame).without(taken, HoleType.OBJECT)
    after, report = inpaint(view, find_filler("migan"), NOTHING)
    unchanged(view, after)
    assert abs(after.color[taken].astype(float) - 128).mean() < 15
    assert report.notes["model"] == "migan-512-tuned.onnx" and report.law_violations == 0
