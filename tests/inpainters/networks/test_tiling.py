"""Crops and tiles: sizes exact, known pixels untouched, every hole pixel filled once, cheap where holes are small."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dlama.inpainters.networks import tiling as crops
from dlama.inpainters.networks.tiling import Layout, fill_crops

SMALL = Layout(multiple=8, minimum=16, budget=40 * 40)


def pointwise(planes: np.ndarray, hole: np.ndarray) -> np.ndarray:
    """A network that looks at one pixel only."""
    return (2 * planes + 3).astype(np.float32)


class Probe:
    """A pointwise network that keeps the sizes it was called with."""

    def __init__(self) -> None:
        self.sizes: list[tuple[int, ...]] = []

    def __call__(self, planes: np.ndarray, hole: np.ndarray) -> np.ndarray:
        self.sizes.append(planes.shape)
        assert planes.shape[2:] == hole.shape and hole.any()
        return pointwise(planes, hole)

    @property
    def pixels(self) -> int:
        return sum(height * width for *_, height, width in self.sizes)


def calls_for(hole: np.ndarray) -> Probe:
    """The network after filling this hole in an empty picture."""
    probe = Probe()
    fill_crops(np.zeros((1, 1, *hole.shape), np.float32), hole, probe, Layout())
    return probe


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.integers(1, 300), st.sampled_from([SMALL, Layout()]))
def test_tiles_equal_the_whole(seed: int, height: int, width: int, layout: Layout) -> None:
    """Law for a pointwise network: any holes, tiled or not, with the same result, known pixels bit for bit; the network sees
    multiples of 8, 16 px at least, and no more than the budget and padding."""
    rng = np.random.default_rng(seed)
    planes = rng.random((2, 1, height, width), np.float32)
    hole = np.zeros((height, width), bool)
    for _ in range(rng.integers(1, 6)):
        y, x = rng.integers(0, height), rng.integers(0, width)
        hole[y : y + rng.integers(1, 200), x : x + rng.integers(1, 200)] = True
    probe = Probe()
    tiled = fill_crops(planes, hole, probe, layout)
    np.testing.assert_allclose(tiled, np.where(hole, 2 * planes + 3, planes), rtol=1e-6)
    np.testing.assert_array_equal(tiled[..., ~hole], planes[..., ~hole])
    assert all(h % 8 == 0 and w % 8 == 0 and min(h, w) >= 16 for *_, h, w in probe.sizes)
    assert layout is not SMALL or all(h * w <= 48 * 48 * 3 for *_, h, w in probe.sizes)


def test_seams_are_blended() -> None:
    """Closed form: a network that gives another constant at each call leaves no step between tiles above a few per cent."""
    calls = iter(range(1000))

    def drifting(planes: np.ndarray, hole: np.ndarray) -> np.ndarray:
        return np.full_like(planes, next(calls) % 2)

    hole = np.ones((400, 400), bool)
    hole[::5, ::5] = False  # 4 % known, so no tile leans on another
    out = fill_crops(np.zeros((1, 1, 400, 400), np.float32), hole, drifting, Layout(budget=160**2))[0, 0]
    assert np.ptp(out[hole]) > 0.9
    assert abs(np.diff(out[1::5], axis=1)).max() < 0.08  # a ramp of 40 px: 1/40, steeper at corners
    assert abs(np.diff(out[:, 1::5], axis=0)).max() < 0.08


def test_a_tile_of_nothing_continues_from_its_neighbours() -> None:
    """Law: in a hole far larger than a tile, every call sees something known; the first of them the true rim."""
    shares: list[float] = []

    def looking(planes: np.ndarray, hole: np.ndarray) -> np.ndarray:
        shares.append(float((~hole).mean()))
        return np.full_like(planes, planes[..., ~hole].mean())

    hole = np.zeros((480, 480), bool)
    hole[40:440, 40:440] = True
    out = fill_crops(np.where(hole, 0, 7).astype(np.float32)[None, None], hole, looking, Layout(budget=128**2))
    assert min(shares) > 0.02
    np.testing.assert_allclose(out, 7, rtol=1e-5)


def test_a_small_hole_costs_little() -> None:
    """Closed form: one compact hole of 5 % costs a quarter of the picture at most; two far apart cost two crops."""
    hole = np.zeros((512, 512), bool)
    hole[200:314, 180:294] = True
    probe = calls_for(hole)
    assert len(probe.sizes) == 1 and probe.pixels <= 512 * 512 / 4
    yy, xx = np.mgrid[:512, :512]
    probe = calls_for((yy - 250) ** 2 + (xx - 260) ** 2 < 65**2)
    assert len(probe.sizes) == 1 and probe.pixels <= 512 * 512 / 4
    hole[:] = False
    hole[5, 5] = hole[500, 500] = True
    probe = calls_for(hole)
    assert len(probe.sizes) == 2 and probe.pixels < 512 * 512 / 20


def test_scattered_holes_cost_no_more_than_the_picture() -> None:
    """Law: salt everywhere is one call of the whole picture."""
    hole = np.random.default_rng(1).random((512, 512)) < 0.01
    assert calls_for(hole).sizes == [(1, 1, 512, 512)]


def test_groups_share_out_the_hole() -> None:
    """Law: every hole pixel is in exactly one group, and in its box with context where the picture has room."""
    hole = np.zeros((900, 1200), bool)
    rng = np.random.default_rng(2)
    for y, x in rng.integers(0, 880, (25, 2)):
        hole[y : y + 20, x : x + 20] = True
    count = np.zeros(hole.shape, int)
    for (top, bottom, left, right), group in crops.crops(hole, Layout()):
        count += group
        rows, columns = np.nonzero(group)
        assert top <= max(0, rows.min() - crops.CONTEXT) and bottom >= min(900, rows.max() + 1 + crops.CONTEXT)
        assert left <= max(0, columns.min() - crops.CONTEXT) and right >= min(1200, columns.max() + 1 + crops.CONTEXT)
    np.testing.assert_array_equal(count, hole)
    assert list(crops.crops(np.zeros((5, 5), bool), Layout())) == []


def test_a_network_of_one_size_sees_only_that() -> None:
    """Law: whatever the picture's size, each call is side x side; known pixels keep their bits, the hole has the answer."""
    rng = np.random.default_rng(1)
    for height, width, hole_part in (
        (20, 30, np.s_[5:15, 5:20]),
        (64, 64, np.s_[10:20, 10:50]),
        (90, 200, np.s_[20:70, 10:190]),
    ):
        planes = rng.random((1, 3, height, width), np.float32)
        hole = np.zeros((height, width), bool)
        hole[hole_part] = True
        probe = Probe()
        filled = fill_crops(planes, hole, probe, Layout(64, 64, 128 * 128, 64 * 64, side=64))
        assert set(probe.sizes) == {(1, 3, 64, 64)}
        assert np.array_equal(filled[..., ~hole], planes[..., ~hole])
        assert (filled[..., hole] > 2.5).all(), "2 x + 3 of values in 0..1, also through a shrunk crop"


def test_a_large_crop_is_shrunk_without_its_hole() -> None:
    """Closed form: what lies in the hole (here 99) never reaches the network, and a constant comes back exactly."""
    planes = np.full((1, 1, 100, 130), 0.5, np.float32)
    hole = np.zeros((100, 130), bool)
    hole[30:60, 20:100] = True
    planes[..., hole] = 99

    def network(seen: np.ndarray, open_: np.ndarray) -> np.ndarray:
        assert (abs(seen[..., ~open_] - 0.5) < 1e-5).all()
        return np.where(open_, np.float32(0.25), seen)

    filled = crops.call_resized(planes, hole, network, Layout(64, 64, side=64), 64)
    assert (abs(filled[0, 0, 40:50, 40:80] - 0.25) < 1e-5).all()


def test_what_pads_a_hole_is_a_hole() -> None:
    """Law: beyond the border the network sees the mirrored picture with the mirrored hole; what lies in holes stays unseen."""
    planes, hole = np.zeros((1, 1, 13, 13), np.float32), np.zeros((13, 13), bool)
    hole[:, 8:] = hole[9:] = True
    planes[..., hole] = 999
    seen: list[float] = []

    def looking(planes: np.ndarray, hole: np.ndarray) -> np.ndarray:
        assert planes.shape[2:] == hole.shape == (16, 16)
        seen.append(planes[..., ~hole].max())
        return planes * 0

    fill_crops(planes, hole, looking, SMALL)
    assert seen == [0]
