"""A 3-D photo in; a directory of files that show it out: page, mesh, splats, stereo pictures, loop; whole, or not at all."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.arguments import check_arguments
from dlama.completion.photo3d import Photo3D
from dlama.errors import OutputError, system_errors
from dlama.files.rasters.pictures import write_color
from dlama.files.results.completion import Writer, check_inputs_stay, choose_names
from dlama.files.results.meta_json import describe_source, hash_inputs, versions, write_meta
from dlama.files.results.video import check_video, write_video
from dlama.files.scenes.photo3d_page import LARGEST_GLB, glb_within, photo3d_page
from dlama.files.scenes.scene_npz import write_npz
from dlama.files.scenes.splats import scene_splats, write_splats
from dlama.files.scenes.spz import write_spz
from dlama.files.scenes.textured_mesh import bring_near
from dlama.files.scenes.usdz import usd_module, write_usdz
from dlama.geometry.camera import Camera
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.layers.layered_mesh import farthest_surface, mesh_layers
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.scene import Scene
from dlama.progress import Progress, begin_stage, take_progress
from dlama.writing.atomic_write import PathLike, new_directory

RESULTS: dict[str, tuple[str, ...]] = {
    "page": ("photo3d.html",),
    "mesh": ("photo3d.glb",),
    "usdz": ("photo3d.usdz",),
    "splats": ("splats.ply",),
    "spz": ("splats.spz",),
    "stereo": ("side_by_side.jpg", "anaglyph.jpg"),
    "loop": ("loop.mp4", "loop.webp"),
    "scene": ("scene.npz",),
}
"""What `write_photo3d` can be asked for by name -> its files; meta.json is always written."""
BY_DEFAULT = ("page", "mesh")
MOST_TRIANGLES = 100_000
"""What viewers of augmented reality take."""
LOOP_PICTURES, LOOP_FPS = 72, 24.0


def check_names(only: Sequence[str] | None = None, also: Sequence[str] = ()) -> tuple[str, ...]:
    """The names of what is to be written. InputError: an unknown one; MissingExtraError: what writes one is not installed."""
    names = choose_names(only, also, tuple(RESULTS), BY_DEFAULT)
    if "loop" in names:
        check_video(RESULTS["loop"][0])
    if "usdz" in names:
        usd_module("Usd")
    return names


@take_progress
@system_errors(OutputError)
def write_photo3d(
    photo: Photo3D,
    directory: PathLike,
    *,
    only: Sequence[str] | None = None,
    also: Sequence[str] = (),
    inputs: Mapping[str, PathLike] | None = None,
    intrinsics_from: str = "given in Python",
    seconds: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a 3-D photo to a directory (made if need be) and return it. If anything fails nothing is left behind.

    Args:
        photo: What `photo3d` gave.
        directory: Files of the same names in it are replaced, all others stay.
        only: Which of "page" (photo3d.html, one file that opens from disk, up to 8 MB), "mesh" (photo3d.glb, up to 100,000
            triangles and 10 MB), "usdz" (photo3d.usdz for AR Quick Look, extra `usd`), "splats" (splats.ply), "spz" (splats.spz,
            the same in a fifth of the bytes), "stereo" (side_by_side.jpg, anaglyph.jpg for red and cyan glasses), "loop"
            (loop.mp4, loop.webp, extra `video`) and "scene" (scene.npz); None: page and mesh. meta.json is always written.
        also: More of them.
        inputs: Role -> file; path and SHA-256 of each go into meta.json.
        intrinsics_from: In words, where the source camera's intrinsics come from.
        seconds: Stages before, such as reading, for meta.json.
        progress: Called with the name of each file as it is written.
    Raises:
        InputError: an unknown name; MissingExtraError: a loop without PyAV, usdz without usd-core; OutputError: the directory
            cannot be written.
    """
    check_arguments(write_photo3d, locals())
    names, target, started = check_names(only, also), Path(directory), time.perf_counter()
    files = [file for name in names for file in RESULTS[name]]
    check_inputs_stay(target, [*files, "meta.json"], inputs or {})
    about: dict[str, Any] = {}
    with new_directory(target) as folder:
        for file, write in file_writers(photo, about).items():
            if file in files:
                begin_stage(f"write {file}")
                write(folder / file)
        meta = {
            **describe_source(photo.box.camera, intrinsics_from),
            **photo.meta,
            "files": about,
            "inputs": hash_inputs(inputs or {}, {}),
            "versions": versions(),
        }
        write_meta(folder, meta, seconds or {}, time.perf_counter() - started)
    return target


def file_writers(photo: Photo3D, about: dict[str, Any]) -> dict[str, Writer]:
    """File -> what writes it to a path; `about` takes what is to be known of the files."""
    scene, box = photo.scene, photo.box

    @cache
    def parts() -> Any:
        found = mesh_layers(scene, box, MOST_TRIANGLES)
        about["triangles"] = sum(len(part.mesh.triangles) for part in found)
        return found

    @cache
    def near_parts() -> Any:
        return bring_near(parts(), box.camera, farthest_surface(scene))

    @cache
    def splats() -> Any:
        found = scene_splats(scene, box)
        about["splats"] = len(found)
        return found

    @cache
    def eyes() -> tuple[UInt8Array, UInt8Array]:
        bare = drop_errors(scene)
        left, right = (draw_smooth(bare, resize_to(box.at(side, 0, 0), 1920)) for side in (-0.2, 0.2))
        return left, right

    @cache
    def loop() -> list[UInt8Array]:
        """A turn round the source camera on an ellipse within the box, which ends where it begins."""
        bare, pictures = drop_errors(scene), list[UInt8Array]()
        for number in range(LOOP_PICTURES):
            begin_stage(f"draw picture {number + 1} of {LOOP_PICTURES} of the loop")
            turn = 2 * math.pi * number / LOOP_PICTURES
            camera = box.at(0.7 * math.sin(turn), 0.35 * math.cos(turn), 0)
            pictures.append(draw_smooth(bare, resize_to(camera, 640)))
        return pictures

    return {
        "photo3d.html": lambda path: path.write_text(photo3d_page(box, parts()), "utf-8"),
        "photo3d.glb": lambda path: path.write_bytes(glb_within(near_parts(), LARGEST_GLB)),
        "photo3d.usdz": lambda path: write_usdz(path, near_parts()),
        "splats.ply": lambda path: write_splats(path, splats()),
        "splats.spz": lambda path: write_spz(path, splats()),
        "side_by_side.jpg": lambda path: write_color(path, np.concatenate(eyes(), 1)),
        "anaglyph.jpg": lambda path: write_color(path, anaglyph(*eyes())),
        "loop.mp4": lambda path: write_video(path, loop(), LOOP_FPS),
        "loop.webp": lambda path: write_video(path, loop(), LOOP_FPS),
        "scene.npz": lambda path: write_npz(path, render(scene, box.camera), scene),
    }


def resize_to(camera: Camera, width: int) -> Camera:
    """The camera with a picture of that width, if it is wider."""
    share = min(1.0, width / camera.width)
    return camera.resized(round(camera.width * share), max(1, round(camera.height * share)))


def draw_smooth(scene: Scene, camera: Camera) -> UInt8Array:
    """H x W x 3: a camera's picture, drawn at twice its size and reduced: borders are smooth, and move by less than a pixel.
    The few pixels that no fill shows, which are wider there, take the nearest colour."""
    large = render(scene, camera.resized(2 * camera.width, 2 * camera.height), types=False)
    color = fill_with_nearest(large.color, ~large.hole)
    return np.asarray(cv2.resize(color, camera.wh, interpolation=cv2.INTER_AREA), np.uint8)


def drop_errors(scene: Scene) -> Scene:
    """The scene without the errors expected of its fills: drawing them takes a quarter of a picture's time."""
    fills = tuple(dataclasses.replace(fill.load(), errors=None) for fill in scene.fills)
    return dataclasses.replace(scene, fills=fills)


def anaglyph(left: UInt8Array, right: UInt8Array) -> UInt8Array:
    """For red and cyan glasses: the left picture's luminance (Rec. 601) in red, green and blue of the right one (half colour)."""
    red = np.rint(left @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)
    return np.dstack([red, right[..., 1], right[..., 2]])
