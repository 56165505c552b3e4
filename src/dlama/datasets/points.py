"""A scene.npz, a .ply, a folder of results or of a data set in; its points, and the camera they were seen from, out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.datasets.layouts import RECORDINGS, layout_of, list_dataset
from dlama.errors import FileError, InputError, system_errors
from dlama.files.scenes.clouds import read_ply
from dlama.files.scenes.scene_npz import read_npz
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud, concatenate
from dlama.geometry.fusion import scene_cloud
from dlama.geometry.projection import lift


@system_errors(FileError)
def points_in(path: Path) -> tuple[PointCloud, Camera | None, str]:
    """The points of a scene.npz, a .ply, a folder of results or of a data set; the first camera; what is not shown, in words.

    Raises InputError, FileError.
    """
    if not path.exists():
        raise FileError(
            f"{path}: no such file or folder; a scene.npz, a .ply, a folder of results or a data set is expected"
        )
    cloud, camera, note = _read_points(path)
    if not len(cloud):
        raise InputError(f"{path}: holds no points, so that there is nothing to show")
    return cloud, camera, note


def _read_points(path: Path) -> tuple[PointCloud, Camera | None, str]:
    results, suffix = path / "scene.npz", path.suffix.lower()
    if suffix == ".npz" or results.is_file():
        _, scene = read_npz(results if path.is_dir() else path)
        return scene_cloud(scene, objects=False), scene.frames[0].camera, ""
    if path.is_dir() or suffix in RECORDINGS:
        return points_of_frames(path)
    if suffix == ".ply":
        return read_ply(path), None, ""
    kind = f"a {path.suffix} file" if path.suffix else "a file without an ending"
    raise InputError(f"{path}: is {kind}; a scene.npz, a .ply or a folder is expected")


def points_of_frames(folder: Path) -> tuple[PointCloud, Camera, str]:
    """The same of the frames of a data set, at most 100, evenly spread, as measured."""
    listed = list_dataset(folder, layout_of(folder, None), {"limit": 0}).frames  # no pairs are needed
    if not listed:
        raise InputError(f"{folder}: lists no posed frames with depth, so that there is nothing to show in 3-D")
    first = [each for each in listed if each.scene == listed[0].scene]
    picked = [first[round(at)] for at in np.linspace(0, len(first) - 1, min(len(first), 100))]
    left_out = f"; {len(picked)} of {len(listed)} frames, all of scene {listed[0].scene!r}"
    frames = [each.load() for each in picked]
    note = left_out if len(picked) < len(listed) else ""
    return concatenate([lift(each) for each in frames]), frames[0].camera, note
