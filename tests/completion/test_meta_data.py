"""Meta data of a completion (oracles: the names that its type has, Python's own dict, pickle and json)."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
from collections.abc import Callable
from typing import Any

import pytest

import dlama
from dlama.completion.meta_data import FrozenDict, FrozenList, MetaData, frozen

GIVEN = {"a": 1, "b": [1, {"c": 2}], "d": {"e": (3, 4)}}
CHANGES: list[Callable[[Any], object]] = [
    lambda meta: meta.update(a=2),
    lambda meta: meta.pop("a"),
    lambda meta: meta.__setitem__("a", 2),
    lambda meta: meta.__ior__({"a": 2}),
    lambda meta: meta["d"].clear(),
    lambda meta: meta["b"].append(3),
    lambda meta: meta["b"].__setitem__(0, 3),
    lambda meta: meta["b"][1].setdefault("x", 3),
    lambda meta: meta["d"]["e"].sort(),
]


@pytest.mark.parametrize("change", CHANGES)
def test_nothing_in_it_can_be_changed(change: Callable[[Any], object]) -> None:
    """At any depth; the message says what to do."""
    meta = frozen(GIVEN)
    with pytest.raises(TypeError, match=r"read-only; `dataclasses.replace\(done, meta="):
        change(meta)
    assert meta == {**GIVEN, "d": {"e": [3, 4]}}


def test_every_method_that_changes_is_refused() -> None:
    """Oracle: the methods of a tuple and of a read-only mapping, which change nothing."""
    for kind, plain, safe in ((FrozenDict, dict, type(vars(int))), (FrozenList, list, tuple)):
        changing = set(vars(plain)) - set(dir(safe)) - {"fromkeys", "copy", "__reversed__", "__class_getitem__"}
        assert len(changing) > 5 and changing <= set(vars(kind))


def test_it_is_a_dict_to_all_who_read_it() -> None:
    """Round trips; `|` gives a dict that can be changed."""
    meta = frozen(GIVEN)
    assert json.loads(json.dumps(meta)) == meta
    for again in (pickle.loads(pickle.dumps(meta)), copy.deepcopy(meta)):
        assert again == meta and isinstance(again["d"]["e"], FrozenList)
    more = meta | {"a": 2}
    more["f"] = 3
    assert more["a"] == 2 and "f" not in meta


@pytest.mark.slow
def test_its_type_names_all_that_a_completion_holds() -> None:
    """Of a view with least confidence, a scene of two frames, a 3-D photo and a pair."""
    folder = dlama.example()
    rgbd = dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90)
    small = dlama.RGBD(rgbd.color[::4, ::4].copy(), rgbd.depth[::4, ::4].copy(), rgbd.camera.resized(128, 128))
    scene = dlama.scene([small, dataclasses.replace(small, camera=dlama.orbit(small.camera, 3))])
    rig = dlama.read_stereo_calib(folder / "calib.txt", hw=(512, 512))
    pair = [dlama.read_color(folder / name) for name in ("street.jpg", "right.jpg")]
    results = [
        dlama.view(small, yaw=5, filler="telea", min_confidence=0.5),
        dlama.complete(scene, [small.camera], filler="telea"),
        dlama.photo3d(small, filler="telea"),
        dlama.stereo(*pair, rig, filler="telea"),
    ]
    for done in results:
        assert isinstance(done.meta, FrozenDict) and set(done.meta) <= set(MetaData.__annotations__)
        with pytest.raises(TypeError, match="read-only"):
            done.meta["filler"] = "another"
