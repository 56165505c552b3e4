"""The completed scene of a sequence and its cameras in; scene files, meshes, points, a COLMAP model and a video out.

Clouds and meshes are of the scene without duplicate surfaces, with equal brightness.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.datasets.posed.colmap import write_model
from dlama.files.rasters.pictures import read_color
from dlama.files.results.completion import choose_names
from dlama.files.results.video import write_video
from dlama.files.scenes.clouds import write_ply
from dlama.files.scenes.scene_npz import write_npz
from dlama.files.scenes.textured_mesh import write_textured_glb
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud, concatenate
from dlama.geometry.codes import HoleType
from dlama.geometry.frames.thinning import count_points, thin_scene
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.scene import Scene, contribution
from dlama.progress import begin_stage

RESULTS = ("scene", "points", "mesh", "colmap", "video")
"""What can be written next to the views: scene.npz, scene.ply, scene.glb, sparse/0, and video.mp4 or video.webp."""
BY_DEFAULT = ("mesh", "colmap", "video")
MOST_POINTS, MOST_MESHED = 10_000_000, 4_000_000
"""Points of scene.ply, of more every second, third, ...; points of the frames in scene.glb, those first that add most."""
COLMAP_POINTS = 200_000
"""Points of the COLMAP model."""
FPS = 12.0
"""Views that the video shows a second."""
MOST_ANIMATED, ANIMATED_WIDTH = 240, 480
"""Pictures of a WebP, which is held in memory whole, and their width; MP4 has all, as they are."""


def check_results(only: Sequence[str] | None, also: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of what is to be written: `only` (None: BY_DEFAULT) and `also`. InputError: an unknown name."""
    return choose_names(only, also, RESULTS, BY_DEFAULT)


def write_whole(folder: Path, whole: Scene, cameras: Mapping[str, Camera], chosen: Sequence[str]) -> dict[str, Any]:
    """What of RESULTS is chosen, of the scene as a whole and of its views; for meta.json: what was left out. Raises OutputError.

    Points and mesh have every surface once, without removed objects.
    """
    about: dict[str, Any] = {}
    if "scene" in chosen:
        begin_stage("write scene")
        write_npz(folder / "scene.npz", whole.frames[0].load(), whole)
    if {"points", "mesh", "colmap"} & set(chosen):
        begin_stage("write points and mesh")
        once = thin_scene(whole)
        counts = [layer.find_once(count_points) for layer in once.layers]
        if {"points", "colmap"} & set(chosen):
            cloud = cloud_of(once, max(1, math.ceil(sum(counts) / MOST_POINTS)))
            about["points"] = {"of": sum(counts), "written": len(cloud)}
            if "points" in chosen:
                write_ply(folder / "scene.ply", cloud)
            if "colmap" in chosen:
                (folder / "sparse" / "0").mkdir(parents=True, exist_ok=True)
                views = {f"{name}.png": camera for name, camera in cameras.items()}
                few = thin_points(cloud, max(1, math.ceil(len(cloud) / COLMAP_POINTS)))
                write_model(folder / "sparse" / "0", views, few)
            del cloud
        if "mesh" in chosen:
            meshed = largest_layers(once, counts)
            about["meshed_layers"] = {"of": len(once.layers), "written": len(meshed.layers)}
            write_textured_glb(folder / "scene.glb", meshed)
    if "video" in chosen:
        about["video"] = write_views_video(folder, list(cameras))
    return about


def cloud_of(scene: Scene, step: int) -> PointCloud:
    """The points that each layer adds, of each every `step`-th."""
    views = (layer.load_part() for layer in scene.layers)
    added = (lift(view.without(~contribution(view), HoleType.NONE)) for view in views)
    return concatenate([thin_points(cloud, step) for cloud in added])


def largest_layers(scene: Scene, counts: Sequence[int]) -> Scene:
    """The scene with those layers only that add most points (`counts`), up to MOST_MESHED points in all, one at least."""
    order = np.argsort([-count for count in counts], kind="stable")
    total = np.cumsum([counts[place] for place in order])
    kept = sorted(int(place) for place in order[: max(1, int((total <= MOST_MESHED).sum()))])
    first, *others = (scene.layers[place] for place in kept)
    return Scene((first,), fills=tuple(others))  # frames have one size, views another


def thin_points(cloud: PointCloud, step: int) -> PointCloud:
    """Every `step`-th point of a cloud, evenly."""
    return PointCloud(cloud.points[::step], cloud.color[::step], cloud.origin[::step], cloud.confidence[::step])


def write_views_video(folder: Path, names: Sequence[str]) -> str:
    """The views that lie in images/, one after the other: video.mp4 where PyAV is installed, else video.webp; its name.

    Holes were filled once for all of them, so that nothing flickers. Raises OutputError.
    """
    begin_stage("write video")
    if find_spec("av") is not None:
        write_video(folder / "video.mp4", pictures(folder, names), FPS)
        return "video.mp4"
    step = max(1, math.ceil(len(names) / MOST_ANIMATED))
    write_video(folder / "video.webp", pictures(folder, names[::step], ANIMATED_WIDTH), FPS / step)
    return "video.webp"


def pictures(folder: Path, names: Sequence[str], widest: int | None = None) -> Iterator[UInt8Array]:
    """The colours of views by name, scaled into the first one's size, and to a width where it is wider."""
    size = None
    for name in names:
        color = read_color(folder / "images" / f"{name}.png")
        if size is None:
            height, width = color.shape[:2]
            scale = 1.0 if widest is None else min(1.0, widest / width)
            size = round(width * scale), round(height * scale)
        yield color if color.shape[1::-1] == size else fit_into(color, size)


def fit_into(color: UInt8Array, size: tuple[int, int]) -> UInt8Array:
    """A picture (H x W x 3) scaled into a size (width, height), in black where its shape is another."""
    scale = min(size[0] / color.shape[1], size[1] / color.shape[0])
    width, height = (min(most, math.ceil(side * scale)) for side, most in zip(color.shape[1::-1], size))
    small = cv2.resize(color, (width, height), interpolation=cv2.INTER_AREA)
    left, above = (size[0] - width) // 2, (size[1] - height) // 2
    borders = above, size[1] - height - above, left, size[0] - width - left
    return np.asarray(cv2.copyMakeBorder(small, *borders, cv2.BORDER_CONSTANT), np.uint8)
