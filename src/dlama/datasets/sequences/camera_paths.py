"""A path by name, or a file with cameras, and a scene in; the cameras to look from out."""

from __future__ import annotations

import math
from collections.abc import Mapping

from dlama.errors import InputError
from dlama.files.cameras import read_cameras
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import PATHS, interpolate_cameras, median_pivot
from dlama.geometry.scene import Scene

VIEWS_OF_PATH = 24
"""Cameras of a path by name, where no number is given."""
LONGEST = 100_000
"""Pictures of a video."""


def cameras_for(views: str | Mapping[str, Camera], scene: Scene) -> dict[str, Camera] | None:
    """Name -> camera of the views that are asked for; None: the frames' own ("frames"). Raises InputError, FileError."""
    if not isinstance(views, str):
        return dict(views)
    if views == "frames":
        return None
    if views in PATHS:
        cameras = _named_path(views, scene, VIEWS_OF_PATH)
        return {f"{views}-{number:04d}": camera for number, camera in enumerate(cameras)}
    if not views.lower().endswith(".json"):
        raise InputError(
            f"`views` is {views!r}; frames, {', '.join(PATHS)} or a JSON file with a list of cameras is expected"
        )
    return read_cameras(views)


def path_for(path: str, scene: Scene, seconds: float, fps: float, width: int | None = None) -> list[Camera]:
    """The cameras of a video: a path by name from the middle frame, or evenly between the cameras of a file.

    width: px of the pictures; None: the frames'. Raises InputError, FileError.
    """
    if not (0 < seconds < math.inf and 0 < fps <= 240):
        raise InputError(
            f"`seconds` is {seconds}, `fps` {fps}; both more than 0, and at most 240 pictures a second are expected"
        )
    count = max(1, round(seconds * fps))
    if count > LONGEST:
        raise InputError(f"`seconds` is {seconds}, `fps` {fps}: {count} pictures; at most {LONGEST} are expected")
    if path in PATHS:
        cameras = _named_path(path, scene, count)
    elif path.lower().endswith(".json"):
        cameras = interpolate_cameras(list(read_cameras(path).values()), count)
    else:
        raise InputError(f"`path` is {path!r}; {', '.join(PATHS)} or a JSON file with a list of cameras is expected")
    if width is None:
        return cameras
    if width < 2:
        raise InputError(f"`width` is {width} px; 2 or more is expected")
    first = cameras[0]
    return [camera.resized(width, max(2, round(width * first.height / first.width))) for camera in cameras]


def _named_path(name: str, scene: Scene, count: int) -> list[Camera]:
    middle = scene.middle_frame.load()
    return PATHS[name](middle.camera, count, median_pivot(middle.known_depth))
