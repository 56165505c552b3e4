"""tsdf-fusion folders in (camera-intrinsics.txt, frame-XXXXXX.color.jpg, .depth.png, .pose.txt); posed frames and cases out.

One 3x3 K for colour and depth, first pixel's centre at 0.0 (the fusion code rounds projections to whole pixels); it
lies beside the frames or one folder above. Depth in millimetres, 0 and 65535 missing; poses camera to world.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dlama.datasets.frames import Dataset
from dlama.datasets.lenses import CameraOption, lens_for
from dlama.datasets.numbered_frames import TSDF_INTRINSICS, has_numbered_frames, numbered_frames
from dlama.datasets.text_tables import chosen_scenes, sequences
from dlama.datasets.view_pairs import PosedFrame, posed_dataset, posed_frame

LOOKED_FOR = f"frame-XXXXXX.color.jpg, .depth.png and .pose.txt with {TSDF_INTRINSICS} beside or above them"


def looks_like_tsdf_fusion(root: Path) -> bool:
    return has_numbered_frames(root) and any((each / TSDF_INTRINSICS).is_file() for each in (root, root.parent))


def tsdf_fusion(
    root: Path, *, camera: CameraOption = None, scenes: Sequence[str] | None = None, limit: int | None = None
) -> Dataset:
    """The sequences of a folder (itself one, or holding several). Raises FileError, CameraError."""
    frames: list[PosedFrame] = []
    for scene, folder in chosen_scenes(sequences(root, looks_like_tsdf_fusion, LOOKED_FOR), scenes).items():
        lens = lens_for(folder, folder.parent, camera, (TSDF_INTRINSICS,), f"the layout wants a {TSDF_INTRINSICS}")
        frames += numbered_frames(scene, folder, lens, posed_frame)
    return posed_dataset("tsdf-fusion", root, frames, limit)
