"""ScanNet scenes in (color/N.jpg, depth/N.png, pose/N.txt, intrinsic/intrinsic_color.txt); posed frames and cases out.

Depth in millimetres, 0 missing; poses camera to world, -inf where tracking was lost (left out, and counted in a warning).
Colour (1296x968) is bigger than depth (640x480): it is brought to the depth's size by area means and its K with it.
The first pixel's centre is at 0.0. Format: github.com/ScanNet/ScanNet.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.datasets.posed.lenses import CameraOption, lens_for
from dlama.datasets.posed.posed_frames import Listed, files_of
from dlama.datasets.text_tables import files_by_stem, holds, natural_order, pose_at, read_matrix

looks_like = holds("color", "depth", "pose")
INTRINSICS = ("intrinsic/intrinsic_color.txt", "intrinsics_color.txt")
"""As the reader of .sens files exports them, and as scannet_frames_25k has them."""


def list_frames(folder: Path, root: Path, camera: CameraOption) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    lens = lens_for(folder, root, camera, INTRINSICS, "no other file says where colours are seen from")
    colors = files_by_stem(folder / "color", (".jpg", ".jpeg", ".png"))
    poses = files_by_stem(folder / "pose", (".txt",))
    for name in sorted({*colors, *poses}, key=natural_order):
        if name not in colors or name not in poses:
            yield name, "without a picture" if name in poses else "without a pose"
            continue
        pose = read_matrix(poses[name], finite=False)
        if np.isfinite(pose).all():
            at = pose_at(f"{poses[name]}:1:1", pose)
            yield name, files_of(colors[name], folder / "depth" / f"{name}.png", lens, at)
        else:
            yield name, "without a pose: tracking was lost"
