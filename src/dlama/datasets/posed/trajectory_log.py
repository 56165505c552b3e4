"""Redwood / Open3D folders in (trajectory.log, depth/, image|rgb|color/, camera_intrinsic.json); posed frames and cases out.

Each pose is five lines: three whole numbers, the first of them the frame's place (from 0) among the pictures in the order of
their names, and a 4x4 matrix, camera to world. Depth in millimetres, 0 missing. Open3D's K puts the first pixel's centre
at 0.0. Format: redwood-data.org/indoor/fileformat.html.
"""

from __future__ import annotations

from pathlib import Path

from dlama.datasets.posed.lenses import CameraOption, lens_for
from dlama.datasets.posed.posed_frames import Listed, files_of
from dlama.datasets.text_tables import files_in, matrix_of, pose_at, read_rows
from dlama.errors import FileError
from dlama.geometry.camera import Float64Array

LOGS = ("trajectory.log", "scene/trajectory.log")
"""Where the poses lie; Open3D's reconstruction writes the second."""
COLOR_FOLDERS = ("image", "rgb", "color")
LINES = 5
"""Of a pose: a head and the rows of a matrix."""


def looks_like(root: Path) -> bool:
    """True where a folder holds depth/ and a log of poses."""
    return any((root / name).is_file() for name in LOGS) and (root / "depth").is_dir()


def list_frames(folder: Path, root: Path, camera: CameraOption) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    names = "camera_intrinsic.json", "intrinsic.json", "camera.json"
    advice = "the log has no intrinsics (Open3D's own default for PrimeSense is 525 525 319.5 239.5)"
    lens = lens_for(folder, root, camera, names, advice)
    colors = next((folder / name for name in COLOR_FOLDERS if (folder / name).is_dir()), None)
    if colors is None:
        raise FileError(f"{folder}: has no folder {', '.join(COLOR_FOLDERS)} with the colour pictures")
    color, depth = files_in(colors, (".jpg", ".jpeg", ".png")), files_in(folder / "depth", (".png",))
    if len(color) != len(depth):
        raise FileError(
            f"{folder}: {colors.name}/ holds {len(color)} pictures and depth/ {len(depth)}; as many are expected"
        )
    log = next(folder / name for name in LOGS if (folder / name).is_file())
    for place, pose in sorted(read_log(log, len(color)).items()):
        yield color[place].stem, files_of(color[place], depth[place], lens, pose)


def read_log(path: Path, pictures: int) -> dict[int, Float64Array]:
    """World-from-camera poses by the frame's place; raises FileError and CameraError with line and column."""
    rows = read_rows(path)
    if not rows or len(rows) % LINES:
        raise FileError(f"{path}: holds {len(rows)} lines; {LINES} for each pose are expected")
    poses: dict[int, Float64Array] = {}
    for start in range(0, len(rows), LINES):
        head, matrix = rows[start], rows[start + 1 : start + LINES]
        place = head.numbers("the frame's place and two more whole numbers", 3)[0]
        if place != int(place) or not 0 <= place < pictures:
            raise FileError(f"{head.at(0)}: the frame's place is {head.words[0]}; 0 to {pictures - 1} is expected")
        if place in poses:
            raise FileError(f"{head.at(0)}: frame {head.words[0]} comes a second time")
        poses[int(place)] = pose_at(matrix[0].at(0), matrix_of(matrix))
    return poses
