"""What the network of clicks sees and what becomes of its answers: closed forms, and networks that answer by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dlama import RGBD, Camera, MaskError
from dlama.geometry.rgbd import Float32Array
from dlama.perception.masks import choice as room
from dlama.perception.masks import salient
from dlama.perception.masks.click_network import (
    PLANES,
    SALIENT,
    SIDE,
    click_planes,
    object_probability,
    salient_about,
)
from dlama.perception.masks.prompt import Prompt

HW = (90, 120)
CAMERA = Camera.from_fov(120, 90, 60)


def step_scene() -> RGBD:
    """A square at 1 m before a wall at 2 m; sky above, a stripe without depth."""
    depth = np.full(HW, 2.0, np.float32)
    depth[40:70, 50:80] = 1.0
    depth[:20], depth[80:85] = np.inf, 0.0
    color = np.full((*HW, 3), 255, np.uint8)
    color[depth == 1] = (255, 0, 0)
    return RGBD(color, depth, CAMERA)


class Answer:
    """A network that finds all that is as near as the click; its second output is `objects`, square by square."""

    def __init__(self, *objects: float) -> None:
        self.objects = list(objects)

    def run_all(self, feed: dict[str, Float32Array]) -> list[Float32Array]:
        planes = feed["planes"]
        near = (np.abs(planes[:, PLANES.index("distance")]) < 0.3) & (planes[:, PLANES.index("known")] > 0.5)
        return [np.where(near, np.float32(9), np.float32(-9)), np.full((2, 1), self.objects.pop(0), np.float32)]


def test_planes_of_a_square() -> None:
    """Closed form: the logarithm of inverse depth over the click's, the lower end on sky, 0 where depth is missing or outside."""
    radius, pixel = 64, (55, 65)
    planes = dict(zip(PLANES, click_planes(step_scene(), pixel, radius, [])))
    place = {
        name: tuple((at - centre + radius) * SIDE // (2 * radius + 1) for at, centre in zip(where, pixel))
        for name, where in (("object", (60, 70)), ("wall", (30, 20)), ("sky", (10, 60)), ("missing", (82, 60)))
    }
    expected = {"object": 0.0, "wall": -np.log(2), "sky": -2.0, "missing": 0.0}
    for name, value in expected.items():
        assert planes["distance"][place[name]] == pytest.approx(value, abs=1e-5)
        assert planes["known"][place[name]] == (name in ("object", "wall"))
    assert planes["inside"][0, 0] == 0 and planes["red"][0, 0] == 0 and planes["red"][place["wall"]] == 1
    assert planes["click"].max() == planes["click"][SIDE // 2, SIDE // 2]


def test_planes_of_saliency(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a network that finds what is red: the red square at its place, in both planes; no such planes without saliency."""
    red = lambda color: ((color[..., 0] > 200) & (color[..., 1] < 50)).astype(np.float32)  # noqa: E731
    monkeypatch.setattr(salient, "small_saliency", red)
    scene, pixel, radius = step_scene(), (55, 65), 40
    level = salient_about(salient.WindowSaliency(scene.color), pixel, 2 * radius + 1)
    np.testing.assert_array_equal(level == 1, scene.depth == 1)
    planes = dict(zip((*PLANES, *SALIENT), click_planes(scene, pixel, radius, [level, level])))
    shown = (planes["red"] > 0.9) & (planes["green"] < -0.9)
    for name in SALIENT:
        np.testing.assert_array_equal(planes[name] > 0.95, shown)
    assert len(click_planes(scene, pixel, radius, [])) == len(PLANES)


def test_slopes_of_a_plane() -> None:
    """Inverse depth that doubles over 50 rows rises down, not to the right; in a mirrored picture the slope turns its sign."""
    w = np.repeat(np.linspace(0.5, 1.4, HW[0], dtype=np.float32)[:, None], HW[1], 1)
    ground = RGBD(np.zeros((*HW, 3), np.uint8), 1 / w, CAMERA)
    planes = dict(zip(PLANES, click_planes(ground, (45, 60), 40, [])))
    inner = slice(SIDE // 4, 3 * SIDE // 4)
    assert (planes["down"][inner, inner] > 0.1).all() and np.abs(planes["right"][inner, inner]).max() < 1e-3


def test_the_square_closes_in_on_the_object() -> None:
    """What the network marks comes back at its place, to a pixel of the last square; of what it says of an object the largest
    answer of the squares, as a probability."""
    found, px, there = object_probability(step_scene(), (55, 65), file=Answer(-3, 1, 0))  # type: ignore[arg-type]
    true = step_scene().depth == 1.0
    assert ((found > 0.5) ^ true).sum() <= 4 * 30 and px == 1
    assert there == pytest.approx(1 / (1 + np.exp(-1)), abs=1e-6)


@pytest.mark.parametrize("agreed", [True, False])
def test_the_mask_that_the_network_agrees_with(monkeypatch: pytest.MonkeyPatch, agreed: bool) -> None:
    """Of several masks the one that is most like the network's; its own where none is."""
    scene = step_scene()
    object_, wrong = scene.depth == 1.0, scene.depth == 2.0
    monkeypatch.setattr(room, "object_probability", lambda *_: (object_.astype(np.float32), 1, 1.0))
    masks = [wrong, object_] if agreed else [wrong]
    found = room.Masker(scene, lambda prompt: masks, 0.4).masks(Prompt(HW, ((65, 55),)))
    np.testing.assert_array_equal(found["object"], object_)
    np.testing.assert_array_equal(found["group"], wrong)


def refuse(prompt: Prompt) -> list[np.ndarray]:
    """A masker that finds nothing."""
    raise MaskError("nothing there")


def estimated(scene: RGBD) -> RGBD:
    """The same picture, its depth said to be estimated."""
    return RGBD(scene.color, scene.depth, scene.camera, {"estimator": "none"})


def test_a_click_where_the_masker_finds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The network's mask where depth is missing, or where the masker has no mask; elsewhere its error stays."""
    scene, click = step_scene(), Prompt(HW, ((65, 55),))
    answer = lambda rgbd, pixel, seen: ((scene.depth == scene.depth[pixel]) * np.float32(0.95), 1, 1.0)  # noqa: E731
    monkeypatch.setattr(room, "object_probability", answer)
    assert room.Masker(scene, refuse, 0.4).masks(Prompt(HW, ((60, 82),)))["object"][82, 60]
    seen = salient.WindowSaliency(scene.color)
    found = room.Masker(estimated(scene), lambda _: [], 0.4, seen).masks(click)
    np.testing.assert_array_equal(found["object"], scene.depth == 1)
    for masker in (room.Masker(scene, refuse, 0.4), room.Masker(estimated(scene), refuse, 0.4, seen)):
        with pytest.raises(MaskError, match="nothing there"):
            masker.masks(click)


@pytest.mark.parametrize("is_estimated", [True, False])
def test_a_click_on_nothing(monkeypatch: pytest.MonkeyPatch, is_estimated: bool) -> None:
    """An error where the network says that no object is there, whatever the masker says; not with a box or another click."""
    scene = estimated(step_scene()) if is_estimated else step_scene()
    wall, object_ = scene.depth == 2, scene.depth == 1
    answer = lambda rgbd, pixel, seen: (object_.astype(np.float32), 1, float(object_[pixel]))  # noqa: E731
    monkeypatch.setattr(room, "object_probability", answer)
    seen = salient.WindowSaliency(scene.color) if is_estimated else None
    masker = room.Masker(scene, lambda prompt: [wall], 0.4, seen)
    click, box = (20, 30), (5, 25, 30, 30)
    with pytest.raises(MaskError, match="clicks holds 20,30, where nothing stands apart"):
        masker.masks(Prompt(HW, (click,)))
    for prompt in (Prompt(HW, (click,), box=box), Prompt(HW, (click, (65, 55)))):
        assert masker.masks(prompt)["object"].any()
