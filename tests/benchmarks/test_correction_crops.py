"""Crops that the network of corrections learns from: laws, and closed forms."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

import correction_crops
from dlama import RGBD, Camera
from dlama.models.network_file import NetworkFile
from dlama.perception.masks.click_network import PLANES, SIDE
from dlama.perception.masks.corrections import NETWORK

pytest.importorskip("torch")
pytest.importorskip("onnx")

import correction_network
from click_crops import write_crops
from click_training import train
from shadow_export import export_shadow

TRUE = np.zeros((96, 128), np.bool_)
TRUE[30:70, 40:80] = True


def scene() -> RGBD:
    """A square before a wall, both with noise."""
    color = np.where(TRUE[..., None], [200, 60, 40], [90, 110, 130]) + np.random.default_rng(0).integers(
        -9, 10, (96, 128, 3)
    )
    return RGBD(color.astype(np.uint8), np.where(TRUE, 2, 4).astype(np.float32), Camera.from_fov(128, 96, 60))


@functools.cache
def crops() -> list[correction_crops.Crop]:
    """Crops of that square; a second object stands beside it."""
    other = np.zeros_like(TRUE)
    other[40:60, 90:110] = True
    rng, found = np.random.default_rng(1), list[correction_crops.Crop]()
    while len(found) < 24:
        found += correction_crops.corrections_of(scene(), TRUE, np.zeros_like(TRUE), [other], rng)
    return found


def test_a_click_lies_in_an_error_of_its_mask() -> None:
    """Law: the middle of the crop is the object and not the mask where the click is positive, else the other way round."""
    middle, kinds = SIDE // 2, set[bool]()
    for planes, maps, truth, counts in crops():
        mask, on, away = maps[:, middle, middle] > 127
        assert planes.shape == (len(PLANES), SIDE, SIDE) and counts.all()
        assert on != away and (truth[middle, middle] > 127) == on != mask
        kinds.add(bool(on))
    assert kinds == {True, False}


def test_a_box_is_the_mask_and_nothing_is_clicked_on() -> None:
    """Law: the mask is a rectangle that holds most of the object, amid the crop; the plane of the click is empty."""
    for number in range(10):
        planes, maps, truth, _ = correction_crops.box_crop(
            scene(), TRUE, np.zeros_like(TRUE), np.random.default_rng(number)
        )
        box, object_ = maps[0] > 0, truth > 127
        rows, columns = np.flatnonzero(box.any(1)), np.flatnonzero(box.any(0))
        assert box.sum() >= len(rows) * len(columns) - 4 and abs(int(rows[0]) - (SIDE - 1 - int(rows[-1]))) <= 3
        assert (box & object_).sum() > 0.85 * object_.sum()
        assert not planes[PLANES.index("click")].any()


def test_a_carried_mask_is_clicked_on_amid_the_object() -> None:
    """Law: the middle of the crop is on the mask and on the object, and is the only click."""
    middle = SIDE // 2
    for number in range(10):
        crop = correction_crops.carried_crop(scene(), TRUE, np.zeros_like(TRUE), np.random.default_rng(number))
        assert crop is not None
        _, maps, truth, _ = crop
        assert (maps[:2, middle, middle] > 127).all() and truth[middle, middle] > 127 and not maps[2].any()


def test_a_few_steps_of_training_write_a_network(tmp_path: Path) -> None:
    """The file takes the planes of a crop, as the one that ships does; what is learned on from keeps its answer at rate 0."""
    write_crops(tmp_path, "photo", range(1), lambda _: iter(crops()[:6]))
    batches = correction_network.CorrectionCrops(tmp_path, np.random.default_rng(0))
    for kind in ("estimated", "measured"):
        batches.numbers[kind] = batches.numbers["photo"]
    planes = len(PLANES) + correction_network.MAPS
    start = Path(correction_crops.__file__).parents[1] / "src/dlama/assets/click/correction.onnx"
    state = train(batches, planes, correction_network.loss_of, 1, 0.0, start)
    file = export_shadow(state, tmp_path / "same.onnx", correction_network.ABOUT)
    crop, _ = batches.crop(0, 0)
    found = [each.run({"planes": crop[None]}) for each in (NetworkFile(NETWORK), NetworkFile(file))]
    np.testing.assert_allclose(found[0], found[1], atol=0.05 * float(np.abs(found[0]).max()))
