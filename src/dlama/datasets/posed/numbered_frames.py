"""Folders of frame-XXXXXX.color.png|jpg, .depth.png, .pose.txt in (7-Scenes, tsdf-fusion); posed frames and their cases out.

Depth in millimetres, 0 and 65535 missing; poses camera to world.
7-Scenes: a pose is the depth camera's. Colour and depth come from two cameras that the set does not align (its page gives
585, 585, 320, 240 for depth and nothing for colour): depth is moved into the colour camera, whose numbers were measured on
redkitchen (COLOR_LENS, COLOR_FROM_DEPTH). With `camera` the two are taken as one camera instead.
tsdf-fusion: one 3x3 K for colour and depth in camera-intrinsics.txt next to the frames or one folder above, first pixel's
centre at 0.0 (the fusion code rounds projections to whole pixels). Format: github.com/andyzeng/tsdf-fusion.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from dlama.datasets.posed.lenses import CameraOption, Lens, lens_for, register_depth
from dlama.datasets.posed.posed_frames import Listed, files_of
from dlama.datasets.text_tables import files_in, pose_at, read_matrix
from dlama.geometry.motion.poses import invert_pose

DEPTH_LENS = Lens("7-Scenes' published camera", (585.0, 585.0, 320.0, 240.0), 0.0, (480, 640))
MEASURED = "7-Scenes' measured colour camera (`camera=FILE.json` gives another)"
COLOR_LENS = Lens(MEASURED, (526.0, 526.0, 320.0, 237.0), 0.0, (480, 640))
COLOR_FROM_DEPTH = np.array([[1, 0, 0, -0.025], [0, 1, 0, 0.004], [0, 0, 1, 0], [0, 0, 0, 1.0]])
"""Metres. Measured, not published: image edges against depth edges, and agreement of brightness across views."""
TSDF_INTRINSICS = "camera-intrinsics.txt"


def has_intrinsics(root: Path) -> bool:
    """True where tsdf-fusion's intrinsics lie in a folder or the one above."""
    return any((each / TSDF_INTRINSICS).is_file() for each in (root, root.parent))


def has_numbered_frames(root: Path) -> bool:
    """True if frame-*.color.*, its depth and its pose lie right in the folder."""
    first = next(root.glob("frame-*.pose.txt"), None)
    return first is not None and first.with_name(f"{frame_name(first)}.depth.png").is_file()


def seven_scenes_frames(folder: Path, root: Path, camera: CameraOption) -> Listed:
    """The frames of one sequence of 7-Scenes. Raises FileError, CameraError."""
    if camera is not None:
        yield from numbered_files(folder, lens_for(folder, root, camera, (), ""))
        return
    for name, files in numbered_files(folder, DEPTH_LENS):
        if not isinstance(files, str):
            depth = partial(register_depth, files.depth, DEPTH_LENS, COLOR_LENS, COLOR_FROM_DEPTH)
            pose = files.world_from_cam @ invert_pose(COLOR_FROM_DEPTH)
            files = replace(files, depth=depth, lens=COLOR_LENS, world_from_cam=pose)
        yield name, files


def tsdf_fusion_frames(folder: Path, root: Path, camera: CameraOption) -> Listed:
    """The frames of one sequence, whose K lies in its folder or in the one above. Raises FileError, CameraError."""
    advice = f"the layout needs a {TSDF_INTRINSICS}"
    return numbered_files(folder, lens_for(folder, folder.parent, camera, (TSDF_INTRINSICS,), advice))


SEVEN_SCENES = SimpleNamespace(
    looks_like=lambda root: has_numbered_frames(root) and not has_intrinsics(root), list_frames=seven_scenes_frames
)
TSDF_FUSION = SimpleNamespace(
    looks_like=lambda root: has_numbered_frames(root) and has_intrinsics(root), list_frames=tsdf_fusion_frames
)
"""What the other layouts have as functions of their files."""


def frame_name(path: Path) -> str:
    """frame-000012 of frame-000012.pose.txt."""
    return path.name.split(".")[0]


def numbered_files(folder: Path, lens: Lens) -> Listed:
    """The frames of one folder in the order of their numbers; raises FileError."""
    for pose in files_in(folder, (".txt",)):
        if pose.name.endswith(".pose.txt"):
            name = frame_name(pose)
            colors = [folder / f"{name}.color{suffix}" for suffix in (".png", ".jpg")]
            color = next((each for each in colors if each.is_file()), None)
            if color is None:
                yield name, "without a picture"
                continue
            at = pose_at(f"{pose}:1:1", read_matrix(pose))
            yield name, files_of(color, folder / f"{name}.depth.png", lens, at)
