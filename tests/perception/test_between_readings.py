"""Depth of single readings, as of a LIDAR, filled between them; masks, removals and frames of such depth; missing depth beyond a
sensor's range (oracles: the world; laws)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import dlama
from dlama.datasets.posed.view_pairs import Overlaps
from dlama.datasets.sequences.loading import open_frames
from dlama.geometry.camera import Camera
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD
from dlama.perception.missing_depth import DepthByColor, move_beyond_range, reach_between, repeat_readings
from dlama.perception.planes import SMOOTH
from posed_folders import write_nerfstudio
from worlds import Box, Plane, World, innermost_pixel, moved

CAMERA = Camera.from_fov(256, 192, 70)
FLOOR, WALL = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 5), (0, 0, -1))
BOX = Box((-0.6, 0.1, 2.6), (0.1, 1, 3.2))
ROOM = World((FLOOR, WALL, BOX))
ROWS, COLUMNS = 5, 2


def scan(rgbd: RGBD, rows: int = ROWS, columns: int = COLUMNS, top: int = 0) -> RGBD:
    """The frame with depth in every so many rows and columns alone, from row `top` on."""
    depth = np.zeros_like(rgbd.depth)
    depth[top::rows, ::columns] = rgbd.depth[top::rows, ::columns]
    return dataclasses.replace(rgbd, depth=depth)


def test_readings_keep_their_bits_and_depth_between_them_is_that_of_the_surfaces() -> None:
    """Closed form: floor, wall and a box; above the first row nothing was read, and it stays missing beyond the reach."""
    whole, top = ROOM.rgbd(CAMERA), 60
    sparse = scan(whole, top=top)
    dense = dlama.densify(sparse)
    known = sparse.depth > 0
    np.testing.assert_array_equal(dense.depth[known], sparse.depth[known])
    np.testing.assert_array_equal(dense.color, whole.color)
    between = np.zeros_like(known)
    between[top:] = ~known[top:]
    off = np.abs(dense.depth / whole.depth - 1)[between]
    assert (off < 0.02).mean() > 0.95 and np.median(off) < 0.002
    assert not dense.depth[: top - reach_between(known) - 1].any()


def test_a_scan_below_a_sky_that_is_marked_is_a_scan() -> None:
    """Oracle: the floor; half of the picture is known to be far, as a segmenter marks sky, and stays so.
    Wires before the sky are none."""
    whole = World((FLOOR,)).rgbd(CAMERA)
    assert 0.3 < whole.far.mean() < 0.6
    depth = np.where(whole.far, np.float32(np.inf), scan(whole).depth)
    dense = dlama.densify(dataclasses.replace(whole, depth=depth))
    assert dense.far[whole.far].all()
    below = whole.valid & (whole.depth < 20)
    np.testing.assert_allclose(dense.depth[below], whole.depth[below], rtol=0.02)
    wires = np.where(np.arange(256) % 9, np.float32(np.inf), np.float32(4)) * np.ones((192, 1), np.float32)
    wires[:20, :20] = 0
    assert dlama.densify(thin := dataclasses.replace(whole, depth=wires)) is thin
    repeated = repeat_readings(depth)
    assert np.array_equal(np.isposinf(repeated), whole.far) and (repeated[below] > 0).all()


def test_the_frame_round_a_scan_gives_no_depth() -> None:
    """Law: a white frame shows nothing of the scene; next to it depth is that of the scene, not far."""
    whole = World((FLOOR, WALL)).rgbd(CAMERA)
    color, depth = whole.color.copy(), scan(whole).depth.copy()
    frame = np.ones(depth.shape, np.bool_)
    frame[6:-6, 6:-6] = False
    color[frame], depth[frame] = 255, 0
    dense = dlama.densify(RGBD(color, depth, CAMERA))
    assert dense.padding is not None and not dense.depth[frame].any()
    assert np.isfinite(dense.depth).all()


@pytest.mark.parametrize("kept", ["all", "a half", "two of three rows"])
def test_depth_that_is_no_scan_is_left_as_it_is(kept: str) -> None:
    """A map without holes, with a large one, and with stripes: the same object comes back."""
    whole = World((FLOOR, WALL)).rgbd(CAMERA)
    depth = whole.depth.copy()
    if kept == "a half":
        depth[:, :128] = 0
    if kept == "two of three rows":
        depth[::3] = 0
    rgbd = dataclasses.replace(whole, depth=depth)
    assert dlama.densify(rgbd) is rgbd
    assert repeat_readings(depth) is depth


def test_behind_an_object_of_a_scan_lies_what_is_there() -> None:
    """The world without the box: the floor and the wall behind it, to a hundredth of their depth in nine of ten pixels. The
    picture is larger than the grid that surfaces are continued on: hardly a cell of that was all read."""
    camera = Camera.from_fov(512, 384, 70)
    mask = ROOM.trace(camera)[1] == 2
    done = dlama.remove(scan(ROOM.rgbd(camera)), mask, filler="layered", dilate=0)
    off = np.abs(done.view.depth / World((FLOOR, WALL)).rgbd(camera).depth - 1)[mask]
    assert (off < 0.01).mean() > 0.9


def test_a_click_in_a_scan_finds_the_object() -> None:
    """The box's own pixels."""
    mask = ROOM.trace(CAMERA)[1] == 2
    assert iou(dlama.find_mask(scan(ROOM.rgbd(CAMERA)), clicks=[innermost_pixel(mask)]).mask, mask) > 0.85


def test_scans_are_one_scene_where_they_were_made_dense_and_else_it_is_said_how() -> None:
    """Two posed scans: as read no surface is common, and the message names what mends it; dense they show one room."""
    cameras = CAMERA, moved(CAMERA, turn=(0, 15, 0), shift=(0.4, 0, 0))
    frames = [scan(ROOM.rgbd(camera), rows=7, columns=3) for camera in cameras]
    with pytest.raises(dlama.InputError, match=r"dlama\.densify"):
        dlama.scene(frames)
    assert len(dlama.scene([dlama.densify(frame) for frame in frames]).frames) == 2


def test_readings_are_repeated_as_far_as_they_reach() -> None:
    """Closed form: one reading in 6 x 6 pixels is its block's depth; far from any reading nothing is."""
    depth = np.zeros((60, 90), np.float32)
    depth[3:30:6, 3::6] = np.arange(1, 76).reshape(5, 15)
    found = repeat_readings(depth)
    for row, column in np.argwhere(depth > 0):
        block = found[row - 2 : row + 3, column - 2 : column + 3]
        np.testing.assert_array_equal(block, np.full(block.shape, depth[row, column]))
    assert not found[27 + reach_between(depth > 0) + 1 :].any()


def test_frames_of_scans_overlap_as_the_frames_do() -> None:
    """The share of two whole frames, to a twentieth."""
    cameras = CAMERA, moved(CAMERA, turn=(0, 15, 0))

    def share(seen: Callable[[RGBD], RGBD]) -> float:
        frames = [seen(World((FLOOR, WALL)).rgbd(camera)) for camera in cameras]
        posed = [SimpleNamespace(load_depth=lambda one=one: (one.depth, one.camera)) for one in frames]
        return Overlaps(posed).share(0, 1)  # type: ignore[arg-type]

    assert abs(share(scan) - share(lambda whole: whole)) < 0.05


def test_a_data_set_of_scans_is_one_scene_and_its_meta_data_say_how(tmp_path: Path) -> None:
    """A folder of two posed scans, and of the same frames whole (oracle: `decisions`, and the world's depth)."""
    cameras = {"a": CAMERA, "b": moved(CAMERA, turn=(0, 15, 0), shift=(0.4, 0, 0))}
    decided = []
    for name, seen in (("scans", scan), ("whole", lambda rgbd: rgbd)):
        frames = {frame: seen(ROOM.rgbd(camera)) for frame, camera in cameras.items()}
        folder = write_nerfstudio(tmp_path / name, frames, cameras)
        meta = dlama.sequence(folder, filler="telea").write(tmp_path / f"{name}-out", only=[])
        decided.append(meta["decisions"].get("depth", {}).get("name"))
        done = open_frames(tmp_path / f"{name}-out")[0].load()
        off = np.abs(done.depth / ROOM.rgbd(CAMERA).depth - 1)
        assert (off < 0.02).mean() > 0.95
    assert decided == ["densified", None]


SMALL = Camera.from_fov(192, 144, 60)
LONG_ROOM = World((FLOOR, Plane((0, 0, 9), (0, 0, -1)), Box((-0.5, 0.0, 1.6), (0.5, 1.0, 2.2))))


def test_a_room_continues_where_the_range_ends() -> None:
    """Law: what was not seen lies beyond the range, though a table that is nearer touches it; what was measured stays."""
    true = LONG_ROOM.rgbd(SMALL)
    lost = true.depth > 4
    depth = np.where(lost, np.float32(0), true.depth)
    done = dlama.complete(
        RGBD(true.color, depth, SMALL, padding=np.zeros(lost.shape, np.bool_)), [SMALL], filler="layered"
    )
    assert lost.mean() > 0.3 and (done.view.depth[lost] > 0.95 * 4).all()
    np.testing.assert_array_equal(done.view.depth[~lost], depth[~lost])


def test_a_hole_in_a_near_surface_stays_on_it() -> None:
    """Law: a screen without depth on a wall of 2 m stays there, however far the room is next to it; so does a small hole at the
    end of the range."""
    w = np.full((144, 192), 0.5, np.float32)
    w[:, 150:] = 0.1
    for part in (np.s_[40:90, 30:90], np.s_[10:20, 170:180]):
        missing = np.zeros(w.shape, np.bool_)
        missing[part] = True
        filled = DepthByColor(w, np.full(w.shape, SMOOTH, np.int8), missing)
        assert move_beyond_range(filled, np.where(missing, 0, w).astype(np.float32), missing, missing) is filled


def test_between_readings_depth_is_not_moved() -> None:
    """Law: of a room that a LIDAR read in one pixel of fifty, what is missing between readings stays between them."""
    true = LONG_ROOM.rgbd(SMALL)
    depth = true.depth * (np.random.default_rng(0).random(true.depth.shape) < 0.02)
    done = dlama.complete(
        RGBD(true.color, depth, SMALL, padding=np.zeros(depth.shape, np.bool_)), [SMALL], filler="layered"
    )
    assert (np.abs(done.view.depth / true.depth - 1) < 0.05).mean() > 0.95
