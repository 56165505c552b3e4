"""With/without folders: the real bin as its description says, made ones, and bad files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.completion.verbs import view
from dlama.datasets.frames import RemovalTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import DlamaError, FileError, MaskError, ShapeError
from dlama.files.rasters.masks import write_mask
from posed_folders import LENS, opencv_K, truth, write_codes16, write_picture
from whole_picture import check_same


def test_the_bin_is_as_its_description_says(data_dir: Path) -> None:
    """Oracle: camera.json's measured numbers: share of mask and region, differences outside the mask."""
    dataset = open_dataset(data_dir / "data/bin_removal")
    assert (dataset.layout, len(dataset.frames), len(dataset.cases)) == ("removal", 2, 1)
    measured = json.loads((data_dir / "data/bin_removal/camera.json").read_text())["measured"]
    read = dataset.cases[0].load()
    assert isinstance(read, RemovalTruth) and not read.exposure_varies and read.compare is not None
    assert read.mask.mean() == measured["mask_fraction"] and read.compare.mean() == measured["region_fraction"]
    outside, inside = read.compare & ~read.mask, read.compare & read.mask
    colour = np.abs(read.source.color.astype(float) - read.without.color)
    assert colour[outside].mean() == pytest.approx(measured["colour_mae_in_region_outside_mask"], abs=1e-6)
    assert colour[inside].mean() == pytest.approx(measured["colour_mae_in_mask"], rel=0.02)
    both = outside & read.source.valid & read.without.valid
    depth_mm = 1000 * np.abs(read.source.depth - read.without.depth)[both]
    assert np.median(depth_mm) == pytest.approx(measured["depth_abs_diff_mm_outside_mask"]["median"], abs=0.01)
    assert read.source.missing[read.compare].mean() == pytest.approx(measured["depth_hole_with_in_region"])
    assert read.source.camera.cx == pytest.approx(314.741211)


def written(root: Path, **changes: Any) -> Path:
    """The first frame of the world with a block of it painted as an object before it."""
    root.mkdir(parents=True, exist_ok=True)
    frame = truth()[0]
    depth = frame.depth.copy()
    depth[20:40, 30:50] = 1.5
    mask = depth == 1.5
    for name, metres in (("with", depth), ("without", frame.depth)):
        write_picture(root / f"{name}.color.png", np.where(mask[..., None] & (name == "with"), 7, frame.color))
        write_codes16(root / f"{name}.depth.png", metres, 5000)
    write_mask(root / "object_mask.png", mask)
    camera = {"width": 96, "height": 72, "K": opencv_K(LENS).tolist(), "depth_scale": 0.0002, **changes}
    (root / "camera.json").write_text(json.dumps(camera))
    return root


def test_a_made_folder_there_and_back(tmp_path: Path) -> None:
    """Oracle: what was written; without compare_region and shadow_mask there is none."""
    read = open_dataset(written(tmp_path)).cases[0].load()
    assert isinstance(read, RemovalTruth)
    for frame in (read.source, read.without):
        check_same(view(frame, filler="telea"), frame)
        assert frame.camera.same_view_as(LENS)
    assert (read.source.depth[20:40, 30:50] == 1.5).all() and (read.source.color[20:40, 30:50] == 7).all()
    assert np.array_equal(read.mask, read.source.depth == 1.5)
    assert np.abs(read.without.depth - truth()[0].depth)[1:].max() <= 0.000101
    assert read.compare is None and read.shadow is None


def test_shadow_and_region_and_exposure(tmp_path: Path) -> None:
    root = written(tmp_path / "one", exposure_varies=True)
    shadow = np.zeros((72, 96), bool)
    shadow[30:50, 40:60] = True
    write_mask(root / "shadow_mask.png", shadow)
    write_mask(root / "compare_region.png", ~shadow)
    written(tmp_path / "two")
    dataset = open_dataset(tmp_path)
    assert [case.scene for case in dataset.cases] == ["one", "two"] and len(dataset.frames) == 4
    read = dataset.cases[0].load()
    assert isinstance(read, RemovalTruth) and read.exposure_varies
    assert read.shadow is not None and np.array_equal(read.shadow, shadow & ~read.mask)
    assert read.compare is not None and np.array_equal(read.compare, ~shadow)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth_scale": -1}, r"camera\.json: depth_scale is -1; metres per unit > 0 are expected"),
        ({"exposure_varies": "yes"}, r"camera\.json: exposure_varies is 'yes'; true or false is expected"),
    ],
)
def test_bad_descriptions(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DlamaError, match=message):
        open_dataset(written(tmp_path, **changes))


def test_bad_masks_and_missing_files(tmp_path: Path) -> None:
    root = written(tmp_path)
    write_mask(root / "object_mask.png", np.eye(72, dtype=bool))
    with pytest.raises(ShapeError, match=r"object_mask\.png: is 72x72 and the picture 96x72"):
        open_dataset(root).cases[0].load()
    write_mask(root / "object_mask.png", np.zeros((72, 96), bool))
    with pytest.raises(MaskError, match=r"object_mask\.png: the mask is empty"):
        open_dataset(root).cases[0].load()
    (root / "without.depth.png").unlink()
    with pytest.raises(FileError, match=r"without\.depth\.png: no such file; camera\.json, with\.color\.png"):
        open_dataset(root)
