"""Replica as NICE-SLAM renders it (traj.txt, results/frame*.jpg and depth*.png, cam_params.json); posed frames and cases out.

A line of traj.txt is the 4x4 pose, row by row, camera to world, of the picture in that place by name. cam_params.json lies in the
scene's folder or the one above: `camera` has w h fx fy cx cy, the first pixel's centre at 0.0, and scale, units a metre of depth.
Format: github.com/cvg/nice-slam.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.datasets.posed.lenses import CameraOption, Lens, lens_for
from dlama.datasets.posed.posed_frames import Listed, files_of
from dlama.datasets.text_tables import files_in, holds, pose_at, read_rows
from dlama.errors import FileError
from dlama.files.fields import read_json_fields

POSES, PARAMETERS = "traj.txt", "cam_params.json"
looks_like = holds(POSES, "results")
UNITS = 6553.5
"""Of depth per metre, unless PARAMETERS says otherwise."""


def list_frames(folder: Path, root: Path, camera: CameraOption) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    lens, units = lens_and_units(folder, root, camera)
    pictures = files_in(folder / "results", (".jpg", ".png"))
    color, depth = ([each for each in pictures if each.name.startswith(name)] for name in ("frame", "depth"))
    rows = read_rows(folder / POSES)
    if not len(rows) == len(color) == len(depth):
        raise FileError(
            f"{folder}: results/ holds {len(color)} pictures frame* and {len(depth)} depth*, {POSES} {len(rows)} poses; as "
            "many are expected"
        )
    for row, picture, of_depth in zip(rows, color, depth):
        pose = np.reshape(row.numbers("a 4x4 matrix, row by row", 16), (4, 4))
        yield picture.stem, files_of(picture, of_depth, lens, pose_at(row.at(0), pose), units)


def lens_and_units(folder: Path, root: Path, camera: CameraOption) -> tuple[Lens, float]:
    """The camera, and the units of depth per metre. Raises FileError, CameraError."""
    found = [path for path in (folder / PARAMETERS, folder.parent / PARAMETERS) if path.is_file()]
    if camera is not None or not found:
        return lens_for(folder, root, camera, ("camera.json",), f"no {PARAMETERS}"), UNITS
    fields = read_json_fields(found[0])
    fields = fields.part("camera", fields.values.get("camera"))
    units = fields.number("scale") if "scale" in fields else UNITS
    return Lens(str(fields.path), fields.lens(), 0.0, (fields.count("h"), fields.count("w"))), units
