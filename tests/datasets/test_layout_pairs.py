"""pairs.json: the real kitchen pairs agree as their listing says; made ones there and back; bad listings by field."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.datasets.frames import ViewTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import DlamaError
from dlama.geometry.projection import lift, project
from posed_folders import LENS, TURNS, check_frames, opencv_K, truth, write_codes16, write_picture


def test_kitchen_depths_agree_as_listed(data_dir: Path) -> None:
    """Oracle: overlap and share within 5 % of each pair's depths, measured by others' code (pairs.json, DATA.md).

    Another pixel centre, pose, order or depth scale changes these shares in the third digit or more.
    """
    dataset = open_dataset(data_dir / "data/kitchen_vpi")
    listed = json.loads((data_dir / "data/kitchen_vpi/pairs.json").read_text())["pairs"]
    assert (dataset.layout, len(dataset.frames), len(dataset.cases)) == ("pairs", 16, len(listed))
    for case, pair in list(zip(dataset.cases, listed))[::4]:
        assert case.frame == f"{pair['a']}_to_{pair['b']}"
        assert case.yaw == pytest.approx(pair["rotation_deg"], abs=0.1)  # theirs: poses as rounded, off by 4e-4
        truth = case.load()
        assert isinstance(truth, ViewTruth) and truth.exposure_varies
        _, _, landed, close = landings(truth)
        within = (close & landed).sum()
        assert within / landed.sum() == pytest.approx(pair["measured"]["depth_within_5pct"], abs=3e-4)
        assert within / truth.source.depth.size == pytest.approx(pair["measured"]["overlap"], abs=3e-4)


def landings(truth: ViewTruth) -> tuple[np.ndarray, ...]:
    """Of the source's points that fall into the target: their colours, those of the target there, whether a reading is there, and
    whether it is within 5 % of them."""
    cloud = lift(truth.source)
    pixels, z = project(cloud.points, truth.target.camera)
    inside = (z > 0) & (pixels >= 0).all(1) & (pixels[:, 0] < 640) & (pixels[:, 1] < 480)
    column, row = pixels[inside].astype(int).T
    there = truth.target.depth[row, column]
    close = np.abs(there - z[inside]) <= 0.05 * there
    return cloud.color[inside], truth.target.color[row, column], there > 0, close


def test_kitchen_gain_is_as_listed(data_dir: Path) -> None:
    """Oracle: DATA.md's gain of each channel, b over a, of the pair whose exposure differs most: colours are RGB."""
    truth = open_dataset(data_dir / "data/kitchen_vpi").cases[-1].load()
    assert isinstance(truth, ViewTruth)
    mine, theirs, _, close = landings(truth)
    gain = np.median(theirs[close], 0) / np.median(mine[close], 0)
    assert gain == pytest.approx([1.69, 1.57, 1.99], rel=0.06)


def written(root: Path, **changes: Any) -> Path:
    frames = {}
    for number, frame in enumerate(truth()):
        write_picture(root / f"{number}.png", frame.color)
        write_codes16(root / f"{number}.depth.png", frame.depth, 2000)
        files = {"color": f"{number}.png", "depth": f"{number}.depth.png"}
        frames[f"f{number}"] = {**files, "world_from_cam": frame.camera.world_from_cam.tolist()}
    listing = {
        **{"width": 96, "height": 72, "K": opencv_K(LENS).tolist(), "depth_scale": 0.0005, "frames": frames},
        "pairs": [{"a": "f0", "b": f"f{number}"} for number in (1, 2, 3)],
        **changes,
    }
    (root / "pairs.json").write_text(json.dumps(listing, indent=1))
    return root


@pytest.mark.parametrize("changes", [{}, {"K": LENS.K.tolist(), "pixel_center": 0.5}])
def test_a_closed_form_world_there_and_back(tmp_path: Path, changes: dict[str, Any]) -> None:
    """Oracle: the world; angles are those it was turned by. With pixel_center 0.5 K is as the package counts."""
    dataset = open_dataset(written(tmp_path, **changes))
    check_frames(dataset, half_unit_m=0.00026)
    assert [case.yaw for case in dataset.cases] == list(TURNS[1:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth_scale": 0}, r"pairs\.json: depth_scale is 0; metres per unit > 0"),
        ({"pairs": [{"a": "f0"}]}, r"pairs\.json: pairs\[0\]: b is null; a text is expected"),
        ({"pairs": [{"a": "f0", "b": "f9"}]}, r"pairs\.json: pairs\[0\]: b is 'f9', which is not among the frames"),
    ],
)
def test_bad_listings_are_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DlamaError, match=message):
        open_dataset(written(tmp_path, **changes))
