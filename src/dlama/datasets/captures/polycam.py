"""Polycam's raw export in (keyframes/: images, cameras, depth, confidence); posed frames and the cases between them out.

Files of a frame have its time stamp as their name. cameras/T.json: fx, fy, cx, cy, width, height and t_00 ... t_23, camera to
world in metres, ARKit's axes (x right, y up, z back). corrected_cameras and corrected_images, optimised and undistorted, are
taken where both are there. depth/T.png in millimetres, confidence/T.png 0 low, 127 medium, 255 high. Format:
github.com/PolyCam/polyform, README.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.nerfstudio import CV_FROM_GL
from dlama.datasets.posed.posed_frames import Listed, files_of_capture
from dlama.datasets.text_tables import files_by_stem, pose_at
from dlama.files.fields import read_json_fields

FOLDER = "keyframes"
BOTH = (("corrected_cameras", "corrected_images"), ("cameras", "images"))
"""Folders of cameras and pictures, the better ones first."""


def looks_like(root: Path) -> bool:
    """True where a folder holds keyframes/ with depth and cameras, or is that folder."""
    return any(
        (root / inside / "depth").is_dir() and any((root / inside / cameras).is_dir() for cameras, _ in BOTH)
        for inside in (FOLDER, "")
    )


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    inside = folder / FOLDER if (folder / FOLDER).is_dir() else folder
    suffixes = (".json", ".jpg", ".jpeg", ".png")
    corrected, own = ([files_by_stem(inside / name, suffixes) for name in names] for names in BOTH)
    cameras, pictures = corrected if all(corrected) else own
    depths, levels = (files_by_stem(inside / name, (".png",)) for name in ("depth", "confidence"))
    for name, camera in cameras.items():
        if name not in pictures:
            yield name, "without a picture"
        elif name not in depths:
            yield name, "without depth"
        else:
            yield name, files_of_capture(pictures[name], depths[name], *_camera(camera), levels.get(name), least=127)


def _camera(path: Path) -> tuple[Lens, np.ndarray]:
    fields = read_json_fields(path)
    rows = [[fields.number(f"t_{row}{column}") for column in range(4)] for row in range(3)]
    pose = pose_at(str(path), np.array([*rows, [0.0, 0.0, 0.0, 1.0]]) @ CV_FROM_GL)
    return Lens(str(path), fields.lens(), 0.5, fields.size(None)), pose
