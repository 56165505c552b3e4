"""nerfstudio folders in (transforms.json with depth_file_path); posed frames and the cases between them out; and views of a
sequence written as such a folder, which trainers of splats read.

`transform_matrix` is camera to world with OpenGL axes (x right, y up, z back). `fl_x fl_y cx cy w h`, for all frames or for
each; first pixel's centre at 0.5. NeRF's synthetic sets and instant-ngp have `camera_angle_x` (radians, the whole angle) in place
of `fl_x`, may leave out the others and the pictures' endings, and split the listing (transforms_train.json ...).
Depth times `depth_unit_scale_factor` (default 0.001, for NPY too; 1 for EXR, which nerfstudio does not read) is metres; 0 is
missing, 65535 in 16 bits far as in our own files. Distortion is refused where it shows. Where a frame's `mask_path` is black its
picture shows nothing of the scene.
Formats: docs.nerf.studio/quickstart/data_conventions.html; github.com/bmild/nerf, load_blender.py; instant-ngp's nerf_loader.cu.

Written are images/NAME.png, depth/NAME.png (16-bit millimetres, 0 = missing, 65535 = far), hole/NAME.png (255 = colour and depth
were filled), origin/NAME.png (codes, docs/concepts/conventions.md), source/NAME.png (16 bit: 1 + the number of the frame a pixel
comes from, 0 = none) and transforms.json, whose `source_frames` names those numbers.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from dlama.datasets.posed.lenses import Lens, units_per_metre
from dlama.datasets.posed.posed_frames import Listed, files_of
from dlama.datasets.text_tables import pose_at
from dlama.errors import CameraError, FileError
from dlama.files.fields import FileFields, Intrinsics, read_json_fields
from dlama.files.rasters.depth import write_depth_png
from dlama.files.rasters.images import SUFFIXES, picture_hw
from dlama.files.rasters.masks import read_region, write_mask
from dlama.files.rasters.pictures import save_picture, write_codes, write_color
from dlama.files.results.meta_json import write_json
from dlama.geometry.camera import Camera
from dlama.geometry.figures.false_color import ORIGIN_PALETTE
from dlama.geometry.view import View

NAME = "transforms.json"
SPLITS = ("train", "val", "test")
"""Listings called transforms_SPLIT.json, where there is no NAME: all are read."""
CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Camera axes: y and z turn round; the same matrix both ways."""
UNIT = "depth_unit_scale_factor"
DEPTH_UNIT = 0.001
PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "PERSPECTIVE")
SHOWS_PX = 0.5
"""Distortion that moves a corner by no more than this is left alone."""


def looks_like(root: Path) -> bool:
    """Whether a folder has a listing, whole or split."""
    return bool(listings_of(root))


def listings_of(folder: Path) -> dict[str, Path]:
    """The listings of a folder, by what the names of their frames begin with: splits call frames alike."""
    whole = folder / NAME
    parts = {f"{split}_": folder / f"transforms_{split}.json" for split in SPLITS}
    return {"": whole} if whole.is_file() else {prefix: path for prefix, path in parts.items() if path.is_file()}


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    listed = []
    for prefix, path in listings_of(folder).items():
        fields = read_json_fields(path)
        entries = enumerate(fields.entries("frames", "frames"))
        frames = [fields.part(f"frames[{number}]", each) for number, each in entries]
        colors = [picture_at(folder, frame.text("file_path")) for frame in frames]
        names = [prefix + name for name in names_of(colors)]
        listed += [(*each, fields) for each in zip(names, colors, frames)]
    if all("depth_file_path" not in frame for _, _, frame, _ in listed):
        raise FileError(
            f"{folder}: none of its {len(listed)} frames has a depth_file_path; name the depth of each frame so (16-bit PNG in "
            "millimetres, EXR in metres). Of single photos `dlama depth` estimates it"
        )
    for name, color, frame, fields in listed:
        if "depth_file_path" not in frame:
            yield "", "without a depth_file_path"
            continue
        depth = folder / frame.text("depth_file_path")
        pose = pose_at(f"{frame.path}: transform_matrix", frame.matrix("transform_matrix", (4, 4)) @ CV_FROM_GL)
        lens = lens_of(FileFields(frame.path, {**fields.values, **frame.values}), color)
        units = units_per_metre(fields, UNIT, 1.0 if depth.suffix.lower() == ".exr" else DEPTH_UNIT)
        files = files_of(color, depth, lens, pose, units, has_far=True)
        if "mask_path" in frame:
            files = replace(files, shown=partial(read_region, folder / frame.text("mask_path")))
        yield name, files


def names_of(pictures: Sequence[Path]) -> list[str]:
    """What frames are called by their pictures: where those of several folders have one name, as of rigs, by the folder, too."""
    whole = [path.absolute() for path in pictures]
    shared = os.path.commonpath([path.parent for path in whole])
    below = {path: path.relative_to(shared).with_suffix("").as_posix().replace("/", "_") for path in whole}
    several = len({path.stem for path in below}) < len(below)
    return [below[path] if several else path.stem for path in whole]


def picture_at(folder: Path, name: str) -> Path:
    """The picture that a listing names, also without its ending; the first of them where there is none."""
    path = folder / name
    if path.suffix.lower() in SUFFIXES or path.is_file():
        return path
    whole = [path.with_name(path.name + suffix) for suffix in SUFFIXES]
    return next((each for each in whole if each.is_file()), whole[0])


def lens_of(fields: FileFields, picture: Path) -> Lens:
    """The lens of one frame, its own fields before the shared ones; raises CameraError, FileError."""
    model = fields.values.get("camera_model", "OPENCV")
    if model not in PINHOLES:
        raise CameraError(
            f"{fields.path}: camera_model is {model}; one of {', '.join(PINHOLES)} is expected, undistort first"
        )
    sized = "h" in fields or "w" in fields
    height, width = (fields.count("h"), fields.count("w")) if sized else picture_hw(picture)
    intrinsics = intrinsics_of(fields, height, width)
    for name in ("k4", "k5", "k6"):
        if name in fields and fields.number(name) != 0:
            raise CameraError(
                f"{fields.path}: {name} is not 0; a pinhole camera is expected, undistort the pictures first"
            )
    terms = [fields.number(name) if name in fields else 0.0 for name in ("k1", "k2", "p1", "p2", "k3")]
    moved = distortion_px(intrinsics, (height, width), terms)
    if moved > SHOWS_PX:
        raise CameraError(
            f"{fields.path}: k1 ... p2 move the picture's corners by {moved:.1f} px; a pinhole camera is expected, undistort "
            "the pictures first"
        )
    return Lens(str(fields.path), intrinsics, 0.5, (height, width))


def intrinsics_of(fields: FileFields, height: int, width: int) -> Intrinsics:
    """What a frame has of fx, fy, cx and cy; by the whole angle that the camera sees, and from the picture's centre, where it
    has not. Raises CameraError."""
    if "fl_x" not in fields and "camera_angle_x" not in fields:
        raise CameraError(
            f"{fields.path}: has neither fl_x (pixels) nor camera_angle_x (radians); one of them is expected"
        )
    fx = fields.number("fl_x") if "fl_x" in fields else _focal(fields, "camera_angle_x", width)
    fy = _focal(fields, "camera_angle_y", height) if "camera_angle_y" in fields else fx
    fy = fields.number("fl_y") if "fl_y" in fields else fy
    cx, cy = (fields.number(name) if name in fields else side / 2 for name, side in (("cx", width), ("cy", height)))
    return fx, fy, cx, cy


def _focal(fields: FileFields, name: str, side: int) -> float:
    """Pixels, of the angle under which a side of the picture is seen. Raises CameraError."""
    angle = fields.number(name)
    if not 0 < angle < math.pi:
        raise CameraError(f"{fields.path}: {name} is {angle:g}; radians between 0 and {math.pi:.4g} are expected")
    return side / 2 / math.tan(angle / 2)


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


def write_view(folder: Path, name: str, view: View, masked: bool = False) -> int:
    """The five pictures of one view and, if `masked`, where it has a colour (255); the folders are there. Returns how many pixels
    are too deep for millimetres in 16 bits, as `write_depth_png`. Raises OutputError."""
    frame = np.zeros(view.hole.shape, np.uint16) if view.frame is None else view.frame
    write_color(folder / "images" / f"{name}.png", view.color)
    clipped = write_depth_png(folder / "depth" / f"{name}.png", view.depth)
    write_mask(folder / "hole" / f"{name}.png", view.filled | view.color_hole)
    write_codes(folder / "origin" / f"{name}.png", view.origin, ORIGIN_PALETTE)
    save_picture(folder / "source" / f"{name}.png", Image.fromarray(frame * np.uint16(view.origin > 0)))
    if masked:
        write_mask(folder / MASKS / f"{name}.png", ~view.color_hole)
    return clipped


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
