"""Photos and worlds in -> packs of pictures with holes, and what belongs there, for tuning the painter (`painter`), out.

Photos get holes of the outlines of other photos' salient objects, or a strip next to one, as a moved camera uncovers, or what a
turned camera does not see; the truth is the photo. Worlds get an object removed; the truth is the world without it. Views are of
photos and worlds from another place, as small as a painter sees them, with what is known of the hole: its guides.

A pack is one file of compressed pictures, at most 60 MB, so that it can be sent to a computer with a GPU.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

from dlama.errors import DlamaError, MaskError
from dlama.geometry.holes import box_around, dilate_square, region_at, shrink_known
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.color.low_frequency import blend_with_low_frequency
from dlama.inpainters.layered.color.surface_colors import paint_surfaces
from dlama.inpainters.layered.depth.surfaces import continue_lawfully
from dlama.inpainters.layered.depth_first import hide_from_painter
from dlama.inpainters.networks.view_tensors import levels_of
from dlama.perception.masks.salient import saliency
from dlama.training.data.photos import read_photo
from dlama.training.data.samples.world_views import WorldSet
from dlama.writing.atomic_write import new_file
from view_tasks import FillTask, photo_task, pipeline_tasks
from world_cases import as_seen, world_case

WORLD_SIDE, STORED_SIDE, AROUND = 512, 384, 60
"""Pixels of a world's picture, and of the square of it that is kept; their middles are at most so far apart."""
VIEW_SIDE = 256
"""Pixels of a view."""
FIRST_WORLD, FIRST_HELD_OUT, MANY = 50_000, 90_000, 20_000
OF_PHOTOS, VIEW_SENSORS = 0.45, ("exact", "exact", "exact", "kinect", "matcher")
"""Share of views that are of photos; what sees the worlds of the others."""
VIEW_SHARES, FOV_DEG, TURN_DEG = (0.02, 0.6), (50, 80), (40, 12)
"""Hole of a view, in pictures; degrees of a turned camera's field of view, and by which it turns aside and up at most."""
OUTLINE_SHARES, HOLE_SHARES = (0.02, 0.6), (0.01, 0.4)
"""Of a photo, that an object covers whose outline is kept; of a crop."""
LONGER_SIDES = 0.12, 0.75
"""Of an outline in a crop, in sides of the crop."""
TURNED, TWO, STRIPS = 0.15, 0.3, 0.2
"""Shares of holes that a turned camera leaves, of holes of two outlines, of outlines that become strips."""
GROWTH = 1, 7
"""Sides in pixels, the last one excluded, of squares that holes are dilated by."""
NEAREST_QUANTILE = 0.98
"""Of inverse depth, that is white in the guide."""
QUALITY = 82
"""Of stored pictures (WebP)."""

Planes = dict[str, UInt8Array]
"""Names and H x W or H x W x 3 pictures of a crop."""


def write_pack(path: Path, entries: Iterable[dict[str, bytes]]) -> None:
    """A file of `painter_data.read_pack`: for each crop its pictures as compressed files. OutputError."""
    named = [(f"{number}/{name}", blob) for number, entry in enumerate(entries) for name, blob in entry.items()]
    names, blobs = zip(*named)
    ends = np.cumsum([0, *map(len, blobs)])
    with new_file(path) as draft, draft.open("wb") as stream:
        np.savez(stream, names=np.array(names), ends=ends, data=np.frombuffer(b"".join(blobs), np.uint8))


def compressed(planes: Planes) -> dict[str, bytes]:
    """Pictures of three channels as WebP, others, and `flags`, as PNG. The order of channels stays."""
    found = {}
    for name, plane in planes.items():
        lossy = plane.ndim == 3 and name != "flags"
        kind, how = (".webp", [cv2.IMWRITE_WEBP_QUALITY, QUALITY]) if lossy else (".png", [])
        found[name] = cv2.imencode(kind, plane, how)[1].tobytes()
    return found


def in_parallel(make: Callable[[int], Planes], numbers: Iterable[int]) -> list[dict[str, bytes]]:
    """The compressed crops of these numbers, made on all cores."""
    os.environ["OMP_NUM_THREADS"] = "1"  # crops are made side by side
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:  # a forked process waits for threads of networks
        return list(pool.map(partial(_compressed_crop, make), numbers, chunksize=8))


def _compressed_crop(make: Callable[[int], Planes], number: int) -> dict[str, bytes]:
    cv2.setNumThreads(1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return compressed(make(number))


def world_crop(number: int, photos: Sequence[Path], first: int) -> Planes:
    """A square of a world with an object (color) and without it (truth), and the object's mask; every other world has photos as
    textures."""
    rng = np.random.default_rng([number, 17])
    case = world_case(
        first + number, "removal", "exact", WorldSet("train", WORLD_SIDE, tuple(photos) if number % 2 else ())
    )
    rows, columns = box_around(case.mask, 0)
    top, left = (
        int(np.clip((side.start + side.stop - STORED_SIDE) // 2 + off, 0, WORLD_SIDE - STORED_SIDE))
        for side, off in zip((rows, columns), rng.integers(-AROUND, AROUND + 1, 2))
    )
    box = np.s_[top : top + STORED_SIDE, left : left + STORED_SIDE]
    return {
        "color": case.source.color[box], "truth": case.without.color[box], "mask": np.uint8(255) * case.mask[box],
    }  # fmt: skip


def view_crop(number: int, photos: Sequence[Path], textures: Sequence[Path], first: int) -> Planes:
    """A view of a photo or of a world (photos as textures in every other one), VIEW_SIDE pixels wide, as `planes_of_view`."""
    rng = np.random.default_rng([first, number, 11])
    while True:
        worlds = WorldSet("train", WORLD_SIDE, tuple(textures) if rng.random() < 0.5 else ())
        try:
            tasks = draw_tasks(photos, worlds, first, rng)
            good = tasks and VIEW_SHARES[0] < tasks[0].view.color_hole.mean() < VIEW_SHARES[1]
            if good and tasks[0].view.valid.any():
                return planes_of_view(tasks[0])
        except DlamaError:  # a photo of which no depth is estimated
            continue


def draw_tasks(photos: Sequence[Path], worlds: WorldSet, first: int, rng: np.random.Generator) -> list[FillTask]:
    """A photo from another place and back, or a world from another place."""
    if rng.random() < OF_PHOTOS:
        return [photo_task(photos[int(rng.integers(len(photos)))], WORLD_SIDE, rng)]
    views = worlds.views((first + int(rng.integers(MANY))) * worlds.group_size)
    if not views.pairs:
        return []
    source, target = views.pairs[0]
    frame = as_seen(views.frame(source), str(rng.choice(VIEW_SENSORS)), rng)
    return pipeline_tasks(frame, views.cameras[target], (views.frame(target),))


def planes_of_view(task: FillTask) -> Planes:
    """What a painter sees of a view, small: `color`, and in `flags` the share of each pixel that is hidden from it (0 or 255),
    that is open, and that lies out of view; the truth; and the guides: `surface`, the colours of the surfaces that continue, and
    `near`, the root of their inverse depth."""
    view, law, size = task.view, task.context.law, (VIEW_SIDE, VIEW_SIDE)
    surfaces, depth, _ = continue_lawfully(view, task.context, 0)
    hidden, _ = hide_from_painter(view, surfaces, depth, law, coarsely=True)
    painted = paint_surfaces(view, surfaces, task.context)
    holes, w = surfaces.without_leaves(view.color_hole), surfaces.inverse_depth
    painted = blend_with_low_frequency(view, painted, holes, w, surfaces.label)
    seen, share = shrink_known(view.color, ~hidden, size)
    open_, unseen = (levels_of(small(one.astype(np.float32), size)) for one in (view.color_hole, view.unseen_hole))
    return {
        "color": np.clip(np.round(seen), 0, 255).astype(np.uint8),
        "flags": np.stack([np.uint8(255) * (share < 0.5), open_, unseen], 2),
        "truth": small(task.truth.color, size),
        "surface": small(painted, size),
        "near": levels_of(np.sqrt(small(nearness(np.where(view.hole, depth, view.depth)), size))),
    }


def nearness(depth: Float32Array) -> Float32Array:
    """Inverse depth, 1 = what NEAREST_QUANTILE of the pixels that are not far do not exceed, at most 1. depth: H x W metres."""
    w = inverse_depth(depth)
    return np.minimum(w / np.quantile(w[w > 0], NEAREST_QUANTILE), 1).astype(np.float32) if w.any() else w


def small(plane: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A plane at a size (width, height), averaged."""
    return cv2.resize(plane, size, interpolation=cv2.INTER_AREA)


def outlines_of(photos: Sequence[Path]) -> list[BoolArray]:
    """The largest piece of the most salient object of each photo that has a fitting one, in its box."""
    found = []
    for photo in photos:
        try:
            salient = saliency(read_photo(photo)) > 0.5
        except MaskError:
            continue
        object_ = region_at(salient, np.s_[:, :])
        if OUTLINE_SHARES[0] < object_.mean() < OUTLINE_SHARES[1]:
            found.append(np.ascontiguousarray(object_[box_around(object_, 0)]))
    return found


def hole_of_photo(outlines: Sequence[BoolArray], side: int, rng: np.random.Generator) -> BoolArray:
    """side x side: what a removed object, or a turned camera, leaves of a photo."""
    if rng.random() < TURNED:
        return unseen_when_turned(side, rng)
    while True:
        hole = np.zeros((side, side), np.uint8)
        for _ in range(2 if rng.random() < TWO else 1):
            put_outline(hole, outlines[int(rng.integers(len(outlines)))], rng)
        grown = dilate_square(hole, int(rng.integers(*GROWTH)))
        if HOLE_SHARES[0] < grown.mean() < HOLE_SHARES[1]:
            return grown


def unseen_when_turned(side: int, rng: np.random.Generator) -> BoolArray:
    """side x side: what a camera that is turned does not see of the view of another one, at the same place."""
    columns, rows = np.meshgrid(*[np.linspace(-1, 1, side)] * 2)
    while True:
        slope = np.tan(np.radians(rng.uniform(*FOV_DEG) / 2))
        yaw, pitch = (np.radians(rng.uniform(-each, each)) for each in TURN_DEG)
        rays = np.stack([columns * slope, rows * slope, np.ones_like(rows)])
        turn = cv2.Rodrigues(np.array([pitch, 0, 0]))[0] @ cv2.Rodrigues(np.array([0, yaw, 0]))[0]
        x, y, z = np.tensordot(turn, rays, 1)
        hole = (z <= 0) | (np.maximum(np.abs(x), np.abs(y)) > slope * z)
        if VIEW_SHARES[0] < hole.mean() < VIEW_SHARES[1]:
            return hole


def put_outline(hole: UInt8Array, outline: BoolArray, rng: np.random.Generator) -> None:
    """Draw an outline, mirrored or not, or the strip next to it, into a hole, at most a quarter of it beyond the border."""
    side = len(hole)
    longer = side * float(np.exp(rng.uniform(*np.log(LONGER_SIDES))))
    wh = [max(4, int(each * longer / max(outline.shape))) for each in outline.shape[::-1]]
    shape = cv2.resize(outline.astype(np.uint8), wh, interpolation=cv2.INTER_NEAREST)
    if rng.random() < 0.5:
        shape = np.ascontiguousarray(shape[:, ::-1])
    if rng.random() < STRIPS:
        step = int(rng.integers(4, wh[0] // 2 + 5))
        wider = np.pad(shape, ((0, 0), (step, step)))
        shape = np.roll(wider, step, 1) & (1 - wider)
    height, width = shape.shape
    row, column = (int(rng.integers(-each // 4, side - 3 * each // 4)) for each in (height, width))
    inside = np.s_[max(row, 0) : row + height, max(column, 0) : column + width]
    part = hole[inside]
    part |= shape[max(-row, 0) :, max(-column, 0) :][: part.shape[0], : part.shape[1]]
