"""Completed views of a sequence in; a data set in nerfstudio's layout out, which trainers of splats and our own reader read.

images/NAME.png, depth/NAME.png (16-bit millimetres, 0 = missing, 65535 = far), hole/NAME.png (255 = colour and depth were
filled), origin/NAME.png (codes, docs/concepts/conventions.md), source/NAME.png (16 bit: 1 + the number of the frame a pixel
comes from, 0 = none) and transforms.json, whose `source_frames` names those numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dlama.datasets.posed.nerfstudio import CV_FROM_GL, DEPTH_UNIT, UNIT
from dlama.datasets.posed.nerfstudio import NAME as TRANSFORMS
from dlama.files.atomic_write import new_file
from dlama.files.rasters.depth import write_depth_png
from dlama.files.rasters.pictures import save_picture, write_codes, write_color, write_mask
from dlama.files.results.meta_json import as_json
from dlama.geometry.camera import Camera
from dlama.geometry.figures.false_color import ORIGIN_PALETTE
from dlama.geometry.view import View

FOLDERS = ("images", "depth", "hole", "origin", "source")
"""Of each view one picture in each."""


def write_view(folder: Path, name: str, view: View) -> None:
    """The five pictures of one view; the folders must be there. Raises OutputError."""
    frame = np.zeros(view.hole.shape, np.uint16) if view.frame is None else view.frame
    write_color(folder / "images" / f"{name}.png", view.color)
    write_depth_png(folder / "depth" / f"{name}.png", view.depth)
    write_mask(folder / "hole" / f"{name}.png", view.filled)
    write_codes(folder / "origin" / f"{name}.png", view.origin, ORIGIN_PALETTE)
    save_picture(folder / "source" / f"{name}.png", Image.fromarray(frame * np.uint16(view.origin > 0)))


def write_transforms(
    folder: Path, cameras: Mapping[str, Camera], source_frames: Sequence[str], more: Mapping[str, Any]
) -> Path:
    """transforms.json of the views by name, with further fields that trainers do not look at. Raises OutputError."""
    first = next(iter(cameras.values()))
    shared = first if all(camera.same_lens_as(first) for camera in cameras.values()) else None
    fields: dict[str, Any] = {"camera_model": "OPENCV"}
    if shared is not None:
        fields |= _lens(shared)
    fields |= {UNIT: DEPTH_UNIT, "source_frames": list(source_frames), **more}
    fields["frames"] = [
        {
            "file_path": f"images/{name}.png",
            "depth_file_path": f"depth/{name}.png",
            "hole_file_path": f"hole/{name}.png",
            "source_file_path": f"source/{name}.png",
            **({} if shared is not None else _lens(camera)),
            "transform_matrix": (camera.world_from_cam @ CV_FROM_GL).tolist(),
        }
        for name, camera in cameras.items()
    ]
    with new_file(folder / TRANSFORMS) as draft:
        draft.write_text(as_json(fields), encoding="utf-8")
    return folder / TRANSFORMS


def _lens(camera: Camera) -> dict[str, float]:
    numbers = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    return {"w": camera.width, "h": camera.height, **numbers, "k1": 0, "k2": 0, "p1": 0, "p2": 0}
