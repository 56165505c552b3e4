"""Networks for stereo pairs: probes whose answer is known in closed form, alone and through the whole stereo removal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.errors import InputError
from dlama.geometry.view import Origin
from dlama.inpainters import inpainter
from dlama.inpainters.pair import PairFiller
from networks import constant, echo_mask

DEMO = Path(dlama.__file__).parent / "assets" / "demo"
PLANES = ["red", "green", "blue", "other red", "other green", "other blue"]
SIX = {"in_planes": [*PLANES, "mask"], "out_planes": PLANES}


def filler(path: Path) -> PairFiller:
    """By its name, as the command line finds it."""
    found = inpainter("pair", path)
    assert isinstance(found, PairFiller)
    return found


@pytest.mark.parametrize("left", [True, False])
def test_each_picture_is_painted_in_sight_of_the_other(tmp_path: Path, left: bool) -> None:
    """Probe: a network that gives a quarter of what it sees and half the mask. In the own hole both are hidden: 0.5; where only
    the other picture has its hole, the mask hides this one too, but what it showed there comes back as it was."""
    rng = np.random.default_rng(0)
    mine, other = rng.integers(0, 256, (2, 40, 48, 3), np.uint8)
    hole, other_hole = np.zeros((2, 40, 48), bool)
    hole[5:15, 5:20], other_hole[20:30, 10:30] = True, True
    paint = filler(echo_mask(tmp_path / "p.onnx", 6, **SIX)).painter(other, other_hole, left=left).paint
    painted = paint(mine, hole)
    np.testing.assert_array_equal(painted[~hole], mine[~hole])
    np.testing.assert_array_equal(painted[hole], 128)


def test_left_and_right_come_from_their_own_planes(tmp_path: Path) -> None:
    """Closed form: the first three planes are the left picture, the last three the right one."""
    model = constant(tmp_path / "p.onnx", 6, 0.2, 0.4, 0.6, 1, 0, 0.8, **SIX)
    picture, hole = np.zeros((24, 24, 3), np.uint8), np.ones((24, 24), bool)
    hole[:4] = False
    for left, wanted in ((True, (51, 102, 153)), (False, (255, 0, 204))):
        painted = filler(model).painter(picture, np.zeros_like(hole), left=left).paint(picture, hole)
        np.testing.assert_array_equal(painted[hole], np.broadcast_to(wanted, (20 * 24, 3)))


def test_a_pair_without_its_object(tmp_path: Path) -> None:
    """Closed form through the whole job: the left hole is the left colour, what is still open in the right the right one, and
    what the left one shows there is the left one's. Measured pixels stay."""
    model = constant(tmp_path / "p.onnx", 6, 0.2, 0.4, 0.6, 1, 0, 0.8, **SIX)
    left, right = dlama.read_color(DEMO / "street.jpg"), dlama.read_color(DEMO / "right.jpg")
    mask = dlama.read_mask(DEMO / "mask.png")
    rig = dlama.read_stereo_calib(DEMO / "calib.txt")
    done = dlama.stereo(left, right, rig, mask=mask, filler="pair", model=model)
    seen = done.views[0]
    filled = seen.origin == Origin.FILLED
    assert (filled & mask).sum() == mask.sum()
    np.testing.assert_array_equal(seen.color[filled], np.broadcast_to((51, 102, 153), (filled.sum(), 3)))
    np.testing.assert_array_equal(seen.color[~filled], left[~filled])
    other = done.views[1]
    colors = np.unique(other.color[other.origin == Origin.FILLED], axis=0)
    assert [255, 0, 204] in colors.tolist()
    assert done.meta["notes"] and "p.onnx" in str(done.meta["notes"])


def test_it_is_no_filler_of_one_view(tmp_path: Path) -> None:
    """Law: a pair's network is refused where there is no pair, by its name and what would run it."""
    model = constant(tmp_path / "p.onnx", 6, 0, 0, 0, 0, 0, 0, **SIX)
    rgbd = dlama.read_rgbd(DEMO / "street.jpg", DEMO / "depth.png", camera=DEMO / "camera.json")
    for recipe in ("dlama", "paper"):
        with pytest.raises(InputError, match=r"stereo pair.*dlama stereo"):
            dlama.view(rgbd, yaw=5, filler="pair", model=model, recipe=recipe)
    left, right = dlama.read_color(DEMO / "street.jpg"), dlama.read_color(DEMO / "right.jpg")
    with pytest.raises(InputError, match="depth_by is 'filler'"):
        rig = dlama.read_stereo_calib(DEMO / "calib.txt")
        dlama.stereo(left, right, rig, filler="pair", model=model, recipe="paper")
    with pytest.raises(InputError, match="the filler 'pair' runs it"):
        dlama.view(rgbd, yaw=5, filler="joint", model=model)
