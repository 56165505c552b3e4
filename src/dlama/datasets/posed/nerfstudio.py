"""nerfstudio folders in (transforms.json with depth_file_path); posed frames and the cases between them out; and views of a
sequence written as such a folder, which trainers of splats read.

`transform_matrix` is camera to world with OpenGL axes (x right, y up, z back). `fl_x fl_y cx cy w h`, for all frames or for
each; first pixel's centre at 0.5. Depth times `depth_unit_scale_factor` (default 0.001, for NPY too; 1 for EXR, which
nerfstudio does not read) is metres; 0 is missing, 65535 in 16 bits far as in our own files. Distortion is refused where it
shows. Where a frame's `mask_path` is black its picture shows nothing of the scene.
Format: docs.nerf.studio/quickstart/data_conventions.html.

Written are images/NAME.png, depth/NAME.png (16-bit millimetres, 0 = missing, 65535 = far), hole/NAME.png (255 = colour and depth
were filled), origin/NAME.png (codes, docs/concepts/conventions.md), source/NAME.png (16 bit: 1 + the number of the frame a pixel
comes from, 0 = none) and transforms.json, whose `source_frames` names those numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from dlama.datasets.posed.posed_frames import Lens, Listed, files_of, units_per_metre
from dlama.datasets.text_tables import holds, pose_at
from dlama.errors import CameraError
from dlama.files.fields import FileFields, Intrinsics, read_json_fields
from dlama.files.rasters.depth import write_depth_png
from dlama.files.rasters.pictures import read_region, save_picture, write_codes, write_color, write_mask
from dlama.files.results.meta_json import write_json
from dlama.geometry.camera import Camera
from dlama.geometry.figures.false_color import ORIGIN_PALETTE
from dlama.geometry.view import View

NAME = "transforms.json"
looks_like = holds(NAME)
CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Camera axes: y and z turn round; the same matrix both ways."""
UNIT = "depth_unit_scale_factor"
DEPTH_UNIT = 0.001
PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "PERSPECTIVE")
SHOWS_PX = 0.5
"""Distortion that moves a corner by no more than this is left alone."""


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    fields = read_json_fields(folder / NAME)
    units = units_per_metre(fields, UNIT, DEPTH_UNIT)
    units_of_exr = units_per_metre(fields, UNIT, 1.0)
    for number, each in enumerate(fields.entries("frames", "frames")):
        frame = fields.part(f"frames[{number}]", each)
        if "depth_file_path" not in frame:
            yield "", f"without a depth_file_path in {NAME}"
            continue
        color, depth = (Path(frame.text(name)) for name in ("file_path", "depth_file_path"))
        pose = pose_at(f"{frame.path}: transform_matrix", frame.matrix("transform_matrix", (4, 4)) @ CV_FROM_GL)
        lens = lens_of(FileFields(frame.path, {**fields.values, **frame.values}))
        own = units_of_exr if depth.suffix.lower() == ".exr" else units
        files = files_of(folder / color, folder / depth, lens, pose, own, has_far=True)
        if "mask_path" in frame:
            files = replace(files, shown=partial(read_region, folder / frame.text("mask_path")))
        yield color.stem, files


def lens_of(fields: FileFields) -> Lens:
    """The lens of one frame, its own fields before the shared ones; raises CameraError."""
    model = fields.values.get("camera_model", "OPENCV")
    if model not in PINHOLES:
        raise CameraError(
            f"{fields.path}: camera_model is {model}; one of {', '.join(PINHOLES)} is expected, undistort first"
        )
    fx, fy, cx, cy = (fields.number(name) for name in ("fl_x", "fl_y", "cx", "cy"))
    for name in ("k4", "k5", "k6"):
        if name in fields and fields.number(name) != 0:
            raise CameraError(
                f"{fields.path}: {name} is not 0; a pinhole camera is expected, undistort the pictures first"
            )
    height, width = fields.count("h"), fields.count("w")
    terms = [fields.number(name) if name in fields else 0.0 for name in ("k1", "k2", "p1", "p2", "k3")]
    moved = distortion_px((fx, fy, cx, cy), (height, width), terms)
    if moved > SHOWS_PX:
        raise CameraError(
            f"{fields.path}: k1 ... p2 move the picture's corners by {moved:.1f} px; a pinhole camera is expected, undistort "
            "the pictures first"
        )
    return Lens(str(fields.path), (fx, fy, cx, cy), 0.5, (height, width))


def distortion_px(
    intrinsics: Intrinsics, hw: tuple[int, int], terms: Sequence[float], project: Any = cv2.projectPoints
) -> float:
    """How far distortion moves the worst corner; terms: as OpenCV's `project` (or fisheye.projectPoints) has them."""
    fx, fy, cx, cy = intrinsics
    corners = np.array([(x, y) for x in (0, hw[1]) for y in (0, hw[0])], np.float64)
    with np.errstate(all="ignore"):  # a focal length of 0 is reported as such
        rays = np.c_[(corners - (cx, cy)) / (fx, fy), np.ones(4)]
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        moved, _ = project(rays[:, None], np.zeros(3), np.zeros(3), K, np.array(terms))
        return float(np.linalg.norm(moved[:, 0] - corners, axis=1).max())


FOLDERS, MASKS = ("images", "depth", "hole", "origin", "source"), "masks"
"""Of each view one picture in each."""


def write_view(folder: Path, name: str, view: View, masked: bool = False) -> None:
    """The five pictures of one view and, if `masked`, where it has a colour (255); the folders are there. Raises OutputError."""
    frame = np.zeros(view.hole.shape, np.uint16) if view.frame is None else view.frame
    write_color(folder / "images" / f"{name}.png", view.color)
    write_depth_png(folder / "depth" / f"{name}.png", view.depth)
    write_mask(folder / "hole" / f"{name}.png", view.filled | view.color_hole)
    write_codes(folder / "origin" / f"{name}.png", view.origin, ORIGIN_PALETTE)
    save_picture(folder / "source" / f"{name}.png", Image.fromarray(frame * np.uint16(view.origin > 0)))
    if masked:
        write_mask(folder / MASKS / f"{name}.png", ~view.color_hole)


def write_transforms(
    folder: Path,
    cameras: Mapping[str, Camera],
    source_frames: Sequence[str],
    more: Mapping[str, Any],
    masked: bool = False,
) -> None:
    """transforms.json of the views by name, with further fields that trainers do not look at; masked: the views are. Raises
    OutputError."""
    first = next(iter(cameras.values()))
    shared = first if all(camera.same_lens_as(first) for camera in cameras.values()) else None
    fields: dict[str, Any] = {"camera_model": "OPENCV"}
    if shared is not None:
        fields |= _lens_fields(shared)
    fields |= {UNIT: DEPTH_UNIT, "source_frames": list(source_frames), **more}
    fields["frames"] = [
        {
            "file_path": f"images/{name}.png",
            "depth_file_path": f"depth/{name}.png",
            "hole_file_path": f"hole/{name}.png",
            "source_file_path": f"source/{name}.png",
            **({"mask_path": f"{MASKS}/{name}.png"} if masked else {}),
            **({} if shared is not None else _lens_fields(camera)),
            "transform_matrix": (camera.world_from_cam @ CV_FROM_GL).tolist(),
        }
        for name, camera in cameras.items()
    ]
    write_json(folder / NAME, fields)


def _lens_fields(camera: Camera) -> dict[str, float]:
    numbers = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    return {"w": camera.width, "h": camera.height, **numbers, "k1": 0, "k2": 0, "p1": 0, "p2": 0}
