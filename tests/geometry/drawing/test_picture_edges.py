"""Edges of depth misaligned with those of the picture: how far off, what moves where, and what never does (oracles: closed
forms)."""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np
import pytest

import dlama
from dlama.geometry.camera import Camera
from dlama.geometry.drawing.grid_mesh import find_joints
from dlama.geometry.drawing.picture_edges import MapGrid, align_edges, edge_uncertainty, find_other_surfaces
from dlama.geometry.frames import gathering
from dlama.geometry.frames.stored import PixelCache
from dlama.geometry.fusion import layer_mesh
from dlama.geometry.layers.decimation import decimate
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import context as filling_context
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill
from worlds import moved

WIDTH, HEIGHT, EDGE = 160, 144, 80
TABLE, WALL = (200, 160, 90), (40, 60, 130)
CAMERA = Camera.from_fov(WIDTH, HEIGHT, 60)


def depth_of(edge: np.ndarray | int) -> np.ndarray:
    """A slanted table at about 1 m to the left of a column (one for all rows, or H), a wall at 2 m to its right."""
    columns = np.arange(WIDTH)
    near = 1 / (1 - 0.001 * columns)
    return np.where(columns < np.reshape(edge, (-1, 1)), near, 2.0).repeat(HEIGHT if np.ndim(edge) == 0 else 1, 0)


def frame(edge: np.ndarray | int, camera: Camera = CAMERA) -> RGBD:
    """The picture's edge at column EDGE, with grain of 3 levels; that of depth where it is said."""
    color = np.where((np.arange(WIDTH) < EDGE)[:, None], TABLE, WALL)[None].repeat(HEIGHT, 0)
    grain = np.random.default_rng(0).normal(0, 3, color.shape)
    return RGBD(np.clip(color + grain, 0, 255).astype(np.uint8), depth_of(edge).astype(np.float32), camera)


def torn() -> np.ndarray:
    """H columns: a depth edge 2 px off on the mean, ragged by as much."""
    return EDGE + np.random.default_rng(1).choice([-3, -2, 0, 1, 2, 3], HEIGHT)


@pytest.mark.parametrize("off", [-4, -3, 2, 4])
def test_how_far_edges_are_off_is_measured(off: int) -> None:
    """Closed form: depth moved by so many pixels."""
    assert edge_uncertainty(View.from_rgbd(frame(EDGE + off))) == abs(off)


def test_edges_in_their_place_are_left_alone() -> None:
    """The very same depth, and nothing is misaligned: nothing changes for clean data."""
    view = View.from_rgbd(frame(EDGE))
    placed = align_edges(view)
    assert placed.depth is view.depth and not placed.mixed.any() and not placed.misaligned.any()


@pytest.mark.parametrize("size", [1, 8], ids=["160 px", "1280 px"])
def test_behind_an_edge_of_estimated_depth_is_a_halo(size: int) -> None:
    """Closed form: columns of the wall next to the table, two of a picture of 1024 px; none is seen from elsewhere."""
    halo = max(1, round(size * WIDTH / 512))
    exact = frame(EDGE)
    wh = WIDTH * size, HEIGHT * size
    color, depth = (cv2.resize(one, wh, interpolation=cv2.INTER_NEAREST) for one in (exact.color, exact.depth))
    color[:, EDGE * size : EDGE * size + halo] = 255
    source = RGBD(color, depth, Camera.from_fov(*wh, 60), estimate={"estimator": "a network"})
    found = find_joints(View.from_rgbd(source)).flying
    expected = np.zeros(wh, np.bool_)
    expected[EDGE * size : EDGE * size + halo] = True
    np.testing.assert_array_equal(found, expected.T)
    aside = dlama.render(source, moved(source.camera, shift=(0.1, 0, 0)))
    assert aside.color[~aside.hole].min(1).max() < 200 and not dlama.render(source, source.camera).hole.any()


@pytest.mark.parametrize("edge", [EDGE - 3, EDGE + 2, torn()], ids=["table too small", "too large", "torn"])
def test_pixels_go_to_the_surface_they_look_like(edge: np.ndarray | int) -> None:
    """Oracle: the scene itself, whose edge is where the picture has it; planes are continued, not copied."""
    found = align_edges(View.from_rgbd(frame(edge)))
    kept = ~found.mixed
    np.testing.assert_allclose(found.depth[kept], depth_of(EDGE)[kept], rtol=2e-3)
    assert found.mixed.mean() < 0.01


def test_the_own_view_is_untouched_and_no_fringe_is_seen_from_elsewhere() -> None:
    """Bit for bit at home; from the side, nothing at the wall's depth has the table's colour, nor the other way round."""
    source = frame(torn())
    home = dlama.render(source, source.camera)
    np.testing.assert_array_equal(home.color, source.color)
    np.testing.assert_array_equal(home.depth, source.depth)
    view = dlama.render(source, moved(CAMERA, shift=(0.1, 0, 0)))
    wall = ~view.hole & (view.depth > 1.5)
    like_table = np.abs(view.color.astype(int) - TABLE).sum(2) < np.abs(view.color.astype(int) - WALL).sum(2)
    assert not (like_table & wall).any() and not (~like_table & ~view.hole & ~wall).any()


def test_no_triangle_joins_two_surfaces() -> None:
    """Oracle: the table is nearer than 1.1 m and the wall at 2 m. Meshes had the file's depth along an aligned edge: bars
    reached from the one to the other."""
    for mesh in (decimate(View.from_rgbd(frame(torn()))).mesh, layer_mesh(View.from_rgbd(frame(torn())))):
        depth = mesh.vertices[:, 2][mesh.triangles]
        assert len(depth) and not ((depth.min(1) < 1.5) & (depth.max(1) > 1.5)).any()


def test_objects_thinner_than_the_reach_stay() -> None:
    """A pole of 3 px whose depth is right stays, though all of it is near an edge that is not."""
    source = frame(EDGE + 3)
    color, depth = source.color.copy(), source.depth.copy()
    color[:, 120:123], depth[:, 120:123] = (240, 240, 240), 1.2
    found = align_edges(View.from_rgbd(RGBD(color, depth, CAMERA)))
    assert found.misaligned[:, 120:123].all()
    np.testing.assert_array_equal(found.depth[:, 120:123], depth[:, 120:123])


@pytest.mark.parametrize("reach", [(7, 7), (6, 8)], ids=["in the middle", "the other surface is nearer"])
def test_nothing_moves_where_colours_tell_nothing(reach: tuple[int, int]) -> None:
    """Grey on grey: no pixel belongs to the other surface, so none moves, up to the last column of the band."""
    w = (1 / depth_of(EDGE)).astype(np.float32)
    grey = np.full((*w.shape, 3), 128, np.float32)
    band = np.zeros(w.shape, np.bool_)
    band[:, EDGE - reach[0] : EDGE + reach[1]] = True
    assert not find_other_surfaces(w, w > 0, band, grey, 0.02).any()


def test_an_edge_further_off_than_most_is_moved_too() -> None:
    """Oracle: the scene itself. Most edges are 3 px off, those of a few rows 6 px, where a share of .8 says 3."""
    edge = np.full(HEIGHT, EDGE + 3)
    edge[60:75] = EDGE + 6
    view = View.from_rgbd(frame(edge))
    assert edge_uncertainty(view) == 3
    found = align_edges(view)
    np.testing.assert_allclose(found.depth[~found.mixed], depth_of(EDGE)[~found.mixed], rtol=2e-3)


def test_depth_filled_next_to_a_misplaced_edge_counts_for_the_law() -> None:
    """Where the sensor gave none next to the edge, the wall that was filled there must not be hidden by more table."""
    source = frame(torn())
    depth = source.depth.copy()
    depth[:, EDGE : EDGE + 4] = 0
    measured = Scene((View.from_rgbd(RGBD(source.color, depth, CAMERA)),))
    filled = dlama.complete(RGBD(source.color, depth, CAMERA), [CAMERA]).scene
    law = Law.of(measured)
    where = np.zeros(depth.shape, np.bool_)
    where[:, EDGE + 1 : EDGE + 3] = True
    table = np.full(depth.shape, 1.1, np.float32)
    assert not law.violations(CAMERA, table, where).any()
    assert law.with_aligned_edges(filled).violations(CAMERA, table, where)[where].mean() > 0.9


def test_the_law_knows_whether_edges_are_misplaced() -> None:
    """A frame whose depth edge lies 3 px off the picture's, and one whose edges coincide."""
    for source, misplaced in ((frame(torn()), True), (frame(EDGE), False)):
        scene = Scene((View.from_rgbd(source),))
        assert Law.of(scene).with_aligned_edges(scene).misplaced_edges is misplaced


@pytest.mark.parametrize("read_anew", [False, True], ids=["in memory", "read anew"])
@pytest.mark.parametrize("held", [filling_context.HELD_BYTES, 1000], ids=["held", "made for each camera"])
def test_fillers_know_of_misplaced_edges_however_frames_are_kept(
    held: int, read_anew: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law: whether the law of all frames is held or made for each camera, and whether frames are read again, edges are placed."""
    monkeypatch.setattr(filling_context, "HELD_BYTES", held)
    monkeypatch.setattr(gathering, "PixelCache", lambda: PixelCache(0))
    contexts: list[FillContext] = []

    def recording(view: View, context: FillContext, seed: int) -> Fill:
        contexts.append(context)
        return Fill(view.color, np.full(view.hole.shape, np.inf, np.float32))

    def source(off: float) -> RGBD:
        return frame(torn(), moved(CAMERA, shift=(off, 0, 0)))

    frames = [partial(source, off) if read_anew else source(off) for off in (0.0, 0.002)]
    dlama.complete(frames, [moved(CAMERA, shift=(0.1, 0, 0))], filler=recording)
    assert contexts and contexts[-1].law.misplaced_edges


def enlarged(source: RGBD, width: int, height: int) -> RGBD:
    """The frame at another size: depth by the nearest pixel, the picture smoothly."""
    color = cv2.resize(np.ascontiguousarray(source.color), (width, height), interpolation=cv2.INTER_CUBIC)
    depth = cv2.resize(np.ascontiguousarray(source.depth), (width, height), interpolation=cv2.INTER_NEAREST)
    return RGBD(color, depth, Camera.from_fov(width, height, 60))


def slanted(edge: int) -> RGBD:
    """As `frame`, with depth that changes along columns, too."""
    source = frame(edge)
    return RGBD(source.color, source.depth * np.linspace(1, 1.2, HEIGHT, dtype=np.float32)[:, None], CAMERA)


@pytest.mark.parametrize("size", [(240, 180), (480, 432), (1100, 700)])
def test_an_enlarged_depth_map_is_measured_in_its_own_pixels(size: tuple[int, int]) -> None:
    """Closed form: edges that lie on the picture's do so enlarged; those 3 px off are off by as many times 3."""
    assert edge_uncertainty(View.from_rgbd(enlarged(slanted(EDGE), *size))) == 0
    off = edge_uncertainty(View.from_rgbd(enlarged(slanted(EDGE + 3), *size)))
    assert off == round(3 * max(size[0] / WIDTH, size[1] / HEIGHT))


def test_misplaced_edges_of_an_enlarged_map_are_placed() -> None:
    """Oracle: the scene itself, enlarged; but for the coarse pixels next to the edge."""
    found = align_edges(View.from_rgbd(enlarged(slanted(EDGE + 3), 480, 432)))
    true = enlarged(slanted(EDGE), 480, 432).depth
    kept = ~found.mixed
    np.testing.assert_allclose(found.depth[kept], true[kept], rtol=5e-3)
    assert found.mixed.mean() < 0.02


def test_the_pixels_of_an_enlarged_map_are_found() -> None:
    """Closed form: blocks of 3 x 3 pixels; of a map that was not enlarged, and of two flat boxes, every pixel is its own."""
    coarse = np.random.default_rng(0).uniform(1, 2, (60, 50)).astype(np.float32)
    grid = MapGrid.of(coarse.repeat(3, 0).repeat(3, 1))
    assert (grid.rows.pixel, grid.columns.pixel) == (3, 3)
    np.testing.assert_array_equal(grid.sample_map(coarse.repeat(3, 0).repeat(3, 1)), coarse)
    np.testing.assert_array_equal(grid.enlarge(coarse), coarse.repeat(3, 0).repeat(3, 1))
    flat = np.full((60, 50), 2, np.float32)
    flat[10:20, 10:20] = 1
    assert not MapGrid.of(coarse).enlarged and not MapGrid.of(flat).enlarged
    for step in (3, 4):  # single readings on a lattice: `resize_depth=guided` left nothing of them
        lattice = np.zeros((300, 400), np.float32)
        lattice[::step, ::step] = np.random.default_rng(0).uniform(1, 9, lattice[::step, ::step].shape)
        assert not MapGrid.of(lattice).enlarged
