"""Networks for stereo pairs: probes whose answer is known in closed form, alone and through the whole stereo removal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.errors import InputError
from dlama.geometry.codes import HoleType, Origin
from dlama.inpainters import find_filler
from dlama.inpainters.networks.engine import Engine
from dlama.inpainters.networks.pair import PairFiller, fill_pair
from tiny_networks import constant, contract_of_planes, echo_mask, written

DEMO = Path(dlama.__file__).parent / "assets" / "demo"
PLANES = ["red", "green", "blue", "other red", "other green", "other blue"]
SIX = {"in_planes": [*PLANES, "mask"], "out_planes": PLANES}
EIGHT = {"in_planes": [*PLANES, "left mask", "right mask"], "out_planes": PLANES}


def filler(path: Path) -> PairFiller:
    """By its name, as the command line finds it."""
    found = find_filler("pair", path)
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
    painted = paint(mine, hole, 0)
    np.testing.assert_array_equal(painted[~hole], mine[~hole])
    np.testing.assert_array_equal(painted[hole], 128)


def two_mask_probe(path: Path, gain: float = 1.0) -> Path:
    """8 -> 6, each picture: red 0.8 of its own mask; green, of the left 0.4 of the right mask, of the right 0.6 of the left
    mask; blue what the other picture shows, times `gain`."""
    matrix = np.zeros((6, 8))
    matrix[0, 6], matrix[1, 7], matrix[2, 5] = 0.8, 0.4, gain
    matrix[3, 7], matrix[4, 6], matrix[5, 2] = 0.8, 0.6, gain
    return written(path, 6, matrix, **EIGHT)


@pytest.mark.parametrize("left", [True, False])
@pytest.mark.parametrize(("hw", "budget"), [((40, 48), 640 * 640), ((200, 240), 64 * 64)])
def test_two_masks_are_each_pictures_own(tmp_path: Path, left: bool, hw: tuple[int, int], budget: int) -> None:
    """Closed form: in the own hole red tells that the own mask is there, green whether the other one is, and blue is the
    other picture's where that is known, 0 where it is not; whole and in tiles, one of them with nothing known in it."""
    rng = np.random.default_rng(0)
    mine, other = rng.integers(0, 256, (2, *hw, 3), np.uint8)
    hole, other_hole = np.zeros((2, *hw), bool)
    high, wide = hw
    hole[4 : high - 8, : wide // 2], other_hole[high // 2 :, wide // 4 : wide - 4] = True, True
    painter = PairFiller(Engine(two_mask_probe(tmp_path / "p.onnx"), budget=budget)).painter(
        other, other_hole, left=left
    )
    painted = painter.paint(mine, hole, 0)
    np.testing.assert_array_equal(painted[~hole], mine[~hole])
    np.testing.assert_array_equal(painted[hole][:, 0], 204)
    np.testing.assert_array_equal(painted[hole][:, 1], (102 if left else 153) * other_hole[hole])
    np.testing.assert_array_equal(painted[hole][:, 2], (other[..., 2] * ~other_hole)[hole])
    assert (hole & other_hole).any() and (hole & ~other_hole).any()


class Listener:
    """Stands for the engine of a two-mask network: records what it is fed, and gives 0.5."""

    path, budget, contract, inputs = Path("none.onnx"), 64 * 64, contract_of_planes(6, 2), ("planes",)

    def __init__(self) -> None:
        self.fed: list[np.ndarray] = []

    run_planes, layout = Engine.run_planes, Engine.layout

    def run(self, feed: dict[str, np.ndarray]) -> np.ndarray:
        self.fed.append(feed["planes"][0])
        return np.full_like(feed["planes"][:, :6], 0.5)


def test_a_tile_in_the_hole_continues_from_what_was_filled() -> None:
    """Probe: what a tile is shown without a mask is the picture where it was known and the answer (0.5) where an earlier tile
    filled it, never the answer in a picture that was known, and never a mask on what is shown."""
    planes, holes = np.full((6, 200, 200), 0.9, np.float32), np.zeros((2, 200, 200), bool)
    holes[0, 10:190, 10:150], holes[1, 10:190, 100:190] = True, True
    planes[0], planes[3] = 0.625 + 0.125 * holes[0], 0.625 + 0.125 * holes[1]  # 0.75 is hidden: no tile may see it
    listener = Listener()
    filled = fill_pair(listener, planes, holes)  # type: ignore[arg-type]
    shown = np.repeat(holes, 3, 0)
    np.testing.assert_allclose(filled, np.where(shown, np.float32(0.5), planes), atol=1e-6)
    went_on = 0
    for fed in listener.fed:
        for first, mask in ((0, fed[6] == 1), (3, fed[7] == 1)):
            assert (fed[first][mask] == 0).all()
            assert set(np.round(fed[first][~mask] * 8, 4).tolist()) <= {5, 4}
            went_on += int((fed[first] == 0.5).sum())
    assert went_on


def test_the_notes_say_which_masks_it_got(tmp_path: Path) -> None:
    """Law: nothing is guessed silently: the contract decides, and meta.json says what it decided."""
    nothing = np.zeros((24, 24), bool)
    one, two = (constant(tmp_path / "one.onnx", 6, 0, 0, 0, 0, 0, 0, **SIX), two_mask_probe(tmp_path / "two.onnx"))
    for model, reported in ((one, "one: the union"), (two, "two: the left")):
        notes = filler(model).painter(np.zeros((24, 24, 3), np.uint8), nothing, left=True).notes()
        assert notes["model"] == model.name and notes["masks"].startswith(reported)


@pytest.mark.slow
def test_a_pair_without_its_object(tmp_path: Path) -> None:
    """Closed form through the whole job: what neither camera sees in the left hole is the left colour, what is still open in the
    right the right one, and what the left one shows there is the left one's. Measured pixels stay."""
    model = constant(tmp_path / "p.onnx", 6, 0.2, 0.4, 0.6, 1, 0, 0.8, **SIX)
    left, right = (dlama.read_color(DEMO / name)[::2, ::2] for name in ("street.jpg", "right.jpg"))
    mask = dlama.read_mask(DEMO / "mask.png")[::2, ::2]
    whole = dlama.read_stereo_calib(DEMO / "calib.txt")
    rig = dlama.StereoRig(whole.left.resized(256, 256), whole.right.resized(256, 256))
    done = dlama.stereo(left, right, rig, mask=mask, filler="pair", model=model)
    seen = done.views[0]
    filled = seen.origin == Origin.FILLED
    lent = np.isin(seen.origin, (Origin.REPROJECTED, Origin.DEPTH_FILLED))
    assert (filled & mask).sum() > 0.9 * mask.sum() and ((filled | lent) & mask).sum() == mask.sum()
    np.testing.assert_array_equal(seen.color[filled], np.broadcast_to((51, 102, 153), (filled.sum(), 3)))
    given = seen.hole_type != HoleType.OBJECT
    np.testing.assert_array_equal(seen.color[given], left[given])
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
