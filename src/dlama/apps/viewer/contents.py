"""A path in; what the viewer shows of it, named clouds and the cameras that took their pictures, out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dlama.datasets.layouts import RECORDINGS, open_dataset
from dlama.errors import FileError, InputError
from dlama.files.scenes.clouds import read_ply
from dlama.files.scenes.scene_npz import HOW_WRITTEN, read_npz
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud, concatenate
from dlama.geometry.figures.false_color import ORIGIN_PALETTE
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.scene import Scene, contribution
from dlama.geometry.view import Origin, View, from_source

LOW, HIGH = (213, 94, 0), (86, 180, 233)
"""RGB of confidence 0 and 1; people who confuse red and green can distinguish these."""
MOST_FRAMES = 100
"""Of a data set, evenly spread; each costs a picture and its points."""
SEEN = (Origin.MEASURED, Origin.REPROJECTED, Origin.ESTIMATED, Origin.ELSEWHERE)
"""Origins of what a picture shows; the rest was filled."""


@dataclass(frozen=True)
class Frame:
    """A camera and the picture it took."""

    name: str
    camera: Camera
    color: UInt8Array
    """H x W x 3, RGB."""


@dataclass(frozen=True)
class Contents:
    """What there is to see."""

    title: str
    clouds: dict[str, PointCloud]
    """Points by what they are: `measured`, `filled`, `removed object`; those that hold any."""
    frames: tuple[Frame, ...] = ()
    scene: Scene | None = None
    """What a picture is rendered from, as a surface; None: from the points."""
    notes: list[str] = field(default_factory=list)
    """What is not shown, in words."""


def contents_of(path: Path) -> Contents:
    """What a scene.npz, a .ply, a folder of results or the folder of a data set holds. Raises InputError, FileError."""
    if path.is_dir():
        results = path / "scene.npz"
        if not results.is_file() and (path / "meta.json").is_file() and (path / "image.png").is_file():
            raise FileError(f"{path}: holds no scene.npz; {HOW_WRITTEN}")
        return of_scene(results) if results.is_file() else of_dataset(path)
    if not path.exists():
        raise FileError(
            f"{path}: no such file or folder; a scene.npz, a .ply, a folder of results or a data set is expected"
        )
    kinds: dict[str, Callable[[Path], Contents]] = {".npz": of_scene, ".ply": of_ply}
    kinds |= dict.fromkeys(RECORDINGS, of_dataset)
    if path.suffix.lower() not in kinds:
        kind = f"a {path.suffix} file" if path.suffix else "a file without an ending"
        raise InputError(f"{path}: is {kind}; a scene.npz, a .ply or a folder is expected")
    return kinds[path.suffix.lower()](path)


def of_scene(file: Path) -> Contents:
    """The layers of a scene: measured, filled, and what was removed; their cameras."""
    _, scene = read_npz(file)
    parts = [points_of(layer, contribution(layer)) for layer in scene.layers]
    known, filled = (concatenate([part[number] for part in parts]) for number in (0, 1))
    removed = concatenate([lift(each) for each in scene.removals])
    clouds = {"measured": known, "filled": filled, "removed object": removed}
    frames = tuple(
        Frame(f"{number}", layer.camera, layer.color)
        for number, layer in enumerate(scene.layers)
        if from_source(layer.origin).any()
    )
    return Contents(str(file), drop_empty(clouds, file), frames, scene)


def points_of(layer: View, added: BoolArray) -> tuple[PointCloud, PointCloud]:
    """(measured, filled): the points that a layer adds to its scene (H x W bool), by where they come from."""
    cloud, adds = lift(layer), added[layer.valid]
    known = np.isin(cloud.origin, SEEN)
    return select_points(cloud, adds & known), select_points(cloud, adds & ~known)


def of_ply(file: Path) -> Contents:
    """The points of a file, by their origins where it has them."""
    cloud = read_ply(file)
    known = np.isin(cloud.origin, SEEN)
    return Contents(
        str(file), drop_empty({"measured": select_points(cloud, known), "filled": select_points(cloud, ~known)}, file)
    )


def of_dataset(folder: Path) -> Contents:
    """The frames of a data set, at most MOST_FRAMES, as measured."""
    listed = open_dataset(folder).frames
    if not listed:
        raise InputError(f"{folder}: lists no posed frames with depth, so that there is nothing to show in 3-D")
    first = [each for each in listed if each.scene == listed[0].scene]
    picked = [first[round(at)] for at in np.linspace(0, len(first) - 1, min(len(first), MOST_FRAMES))]
    notes = []
    if len(picked) < len(listed):
        notes.append(f"{len(picked)} of {len(listed)} frames are shown, all of scene {listed[0].scene!r}")
    frames, clouds = [], []
    for each in picked:
        rgbd = each.load()
        frames.append(Frame(each.name, rgbd.camera, rgbd.color))
        clouds.append(lift(rgbd))
    return Contents(str(folder), drop_empty({"measured": concatenate(clouds)}, folder), tuple(frames), notes=notes)


def drop_empty(clouds: dict[str, PointCloud], path: Path) -> dict[str, PointCloud]:
    """Those that hold points. InputError where none does."""
    kept = {name: cloud for name, cloud in clouds.items() if len(cloud)}
    if not kept:
        raise InputError(f"{path}: holds no points, so that there is nothing to show")
    return kept


def select_points(cloud: PointCloud, where: BoolArray) -> PointCloud:
    """The points of a cloud where `where` (N bool, or numbers of points) says."""
    return PointCloud(cloud.points[where], cloud.color[where], cloud.origin[where], cloud.confidence[where])


def sample_points(clouds: dict[str, PointCloud], most: int) -> dict[str, PointCloud]:
    """At most so many points in all, each cloud thinned by the same share, drawn by lot (the same ones every time)."""
    total = sum(map(len, clouds.values()))
    if total <= most:
        return clouds
    rng = np.random.default_rng(0)
    kept = {}
    for name, cloud in clouds.items():
        count = max(1, round(len(cloud) * most / total))
        kept[name] = select_points(cloud, np.sort(rng.choice(len(cloud), count, replace=False)))
    return kept


def colors(cloud: PointCloud, by: str) -> UInt8Array:
    """N x 3 RGB: the `picture`'s colours, the `origin` of each point, or its `confidence`."""
    if by == "origin":
        return np.array(ORIGIN_PALETTE, np.uint8)[cloud.origin]
    if by == "confidence":
        share = np.clip(cloud.confidence, 0, 1)[:, None]
        return np.rint(share * HIGH + (1 - share) * LOW).astype(np.uint8)
    return cloud.color
