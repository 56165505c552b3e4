"""Camera files, intrinsics and EXIF in, a Camera out, and back; pixel centres are converted here."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dlama.arguments import check_arguments
from dlama.errors import CameraError, FileError, format_size, system_errors, warn
from dlama.files.camera_yaml import SUFFIXES, read_yaml_fields, read_yaml_pair
from dlama.files.fields import (
    LENS,
    FileFields,
    Intrinsics,
    fields_of,
    intrinsics_in,
    json_text,
    json_value,
    read_calib_txt,
    read_json_pair,
)
from dlama.files.rasters.images import read_stored
from dlama.geometry.camera import Camera, StereoRig, check_pixel_center
from dlama.geometry.motion.poses import invert_pose
from dlama.perception.diagnosis.lens import check_lens, looks_like_radians
from dlama.writing.atomic_write import PathLike, write_file

OPTIONS = "camera options"
"""What messages call a camera that no file gives."""
NO_INTRINSICS = (
    "how wide the camera sees is not known: give `fov` in degrees, across the picture (phone main camera about 65, webcam 60, "
    "Kinect 57 to 63, EasySynth 90), or `camera=FILE.json`"
)
TEXTS = (".txt", ".csv")
"""Endings of a calib.txt, and of K alone as text."""
CAMERA_FIELDS = ("width", "height", *LENS, "K", "pixel_center", "world_from_cam", "comment", "intrinsics_from")
"""The last two say nothing of the camera; meta.json writes the last one."""
PAIR_FIELDS = ("left_K", "right_K", "baseline_m", "doffs", "pixel_center", "width", "height", "comment")


@system_errors(FileError)
def read_camera(path: PathLike, *, hw: tuple[int, int] | None = None) -> Camera:
    """A camera from our JSON or Open3D's, the left one of a calib.txt of Middlebury or KITTI, the YAML of ROS or OpenCV
    (or its XML), or a text of K alone (3x3, 4x4, or fx fy cx cy; the first pixel's centre at 0.0).

    JSON: `width, height` and `fx, fy, cx, cy` in pixels, or `K` (3x3); optional `pixel_center` (where the file puts the first
    pixel's centre: 0.5, the default, or 0.0) and `world_from_cam` (4x4). `hw` is the size the picture has; another in the file
    is an error, and a file without a size takes it. Raises FileError, CameraError; warns of a principal point outside the
    picture, and of unknown fields.
    """
    check_arguments(read_camera, locals())
    return _camera_of(read_camera_fields(path), hw)


def read_camera_fields(path: PathLike) -> FileFields:
    """The fields of a file that `read_camera` takes, in the names of our JSON: K (or cam0) or fx, fy, cx, cy; pixel_center,
    world_from_cam, width and height where the file has them. Raises FileError, CameraError; warns of unknown fields."""
    suffix = Path(path).suffix.lower()
    if suffix in TEXTS:
        return read_calib_txt(path)
    if suffix in SUFFIXES:
        return read_yaml_fields(path)
    found = json_value(path, json_text(path))
    if isinstance(found, list):
        quoted = shlex.quote(str(path))
        raise FileError(
            f"{path}: holds a list of {len(found)} cameras, one camera is expected; `dlama sequence SCENE --views {quoted}` and "
            f"`dlama video SCENE --path {quoted}` take a list (SCENE: the folder of a data set, or a scene.npz)"
        )
    fields, view = fields_of(path, found), dict[str, Any]()
    if "intrinsic" in fields and "extrinsic" in fields:  # of Open3D's window: a lens, and world to camera
        view["world_from_cam"] = invert_pose(np.reshape(fields.numbers("extrinsic", 16), (4, 4)).T)
        fields = fields.part("intrinsic", fields.values["intrinsic"])
    if "intrinsic_matrix" in fields:  # of Open3D: K column by column
        view |= {name: fields.values[name] for name in ("width", "height") if name in fields}
        K = np.reshape(fields.numbers("intrinsic_matrix", 9), (3, 3)).T.tolist()
        return FileFields(path, {"K": K, "pixel_center": 0.0, **view})
    if "dlama" in fields:  # a meta.json: the camera of image.png, of estimated depth, or of a 3-D photo's picture
        own = fields.values.get("camera", fields.values.get("source_camera"))
        listed = fields.entries("cameras", "cameras") if fields.values.get("cameras") else [own]
        fields = fields.part("camera", listed[-1])
    intrinsics_in(fields)  # what is missing is an error, before a field that is misspelt is warned of
    fields.warn_of_unknown(CAMERA_FIELDS)
    return fields


def _camera_of(fields: FileFields, hw: tuple[int, int] | None) -> Camera:
    pose = fields.matrix("world_from_cam", (4, 4)) if "world_from_cam" in fields else None
    return make_camera(fields.path, fields.size(hw), intrinsics_in(fields), fields.pixel_center(0.5), pose)


@system_errors(FileError)
def read_cameras(path: PathLike) -> dict[str, Camera]:
    """Name -> camera of a JSON list of cameras, each as `read_camera` takes one, with an optional `name` (default: its number).

    Raises FileError, CameraError, naming the camera and the field.
    """
    listed = json_value(path, json_text(path))
    if not isinstance(listed, list) or not listed:
        raise FileError(f"{path}: holds no list; a list of cameras, each with width, height, fx, ..., is expected")
    whole, cameras = FileFields(path, {}), dict[str, Camera]()
    for number, values in enumerate(listed):
        fields = whole.part(f"camera {number}", values)
        name = fields.text("name") if "name" in fields else f"{number:04d}"
        if name in cameras or Path(name).name != name:
            raise FileError(f"{fields.path}: name is {name!r}; a file's name that no other camera has is expected")
        cameras[name] = _camera_of(fields, None)
        whole.values.update(fields.values)
    whole.warn_of_unknown(("name", *CAMERA_FIELDS))
    return cameras


@system_errors(FileError)
def read_stereo_calib(path: PathLike, *, hw: tuple[int, int] | None = None) -> StereoRig:
    """A rectified pair from a calib.txt of Middlebury or KITTI, from JSON or YAML; the left camera is the world.

    calib.txt: `cam0`, `cam1`, `baseline` in mm, `doffs`, or KITTI's `P2`, `P3`; first pixel's centre at 0.0. JSON: `left_K`,
    `right_K`, `baseline_m`, `doffs`, `pixel_center` (default 0.5), `width`, `height`; or `K` in place of the first two, as in
    a stereo folder (`doffs` and `pixel_center` 0 by default). YAML: the right camera's of ROS (`projection_matrix`), or `P1`
    and `P2` of OpenCV's stereoRectify, also in XML. Of the right K and doffs (px, cx of the
    right minus cx of the left) one may be left out; where both are given they must agree within 0.01 px. A file without a size
    takes `hw`. Raises FileError, CameraError; warns of a principal point outside the picture.
    """
    check_arguments(read_stereo_calib, locals())
    suffix = Path(path).suffix.lower()
    if suffix in TEXTS:
        fields = read_calib_txt(path)
        lenses = _left_and_right(fields, "cam0", "cam1")
        baseline = fields.number("baseline") / 1000
    else:
        fields = read_yaml_pair(path) if suffix in SUFFIXES else read_json_pair(path)
        lenses = _left_and_right(fields, "left_K", "right_K")
        baseline = fields.number("baseline_m")
    rig = make_rig(path, fields.size(hw), lenses, fields.pixel_center(0.5), baseline)
    if suffix not in TEXTS:
        fields.warn_of_unknown(PAIR_FIELDS)
    return rig


def make_rig(
    source: PathLike, hw: tuple[int, int], lenses: tuple[Intrinsics, Intrinsics], pixel_center: float, baseline: float
) -> StereoRig:
    """The pair of two cameras so many metres apart, the left one at the origin; as `make_camera`. CameraError."""
    if not 1e-6 <= baseline <= 1e6:
        raise CameraError(f"{source}: the baseline is {baseline:g} m; a distance of 1e-06 to 1e+06 m is expected")
    if not 1e-3 <= baseline <= 20:  # m; likely in another unit
        warn(f"{source}: the baseline is {baseline:g} m; calib.txt counts millimetres, JSON and YAML count metres")
    pose = np.eye(4)
    pose[0, 3] = baseline
    left, right = (make_camera(source, hw, lens, pixel_center, at) for lens, at in zip(lenses, (None, pose)))
    try:
        return StereoRig(left, right)
    except CameraError as error:
        raise CameraError(f"{source}: {error}") from error


def write_camera(path: PathLike, camera: Camera) -> None:
    """Write our JSON, pixel_center 0.5; numbers survive exactly. Raises OutputError."""
    write_file(path, json.dumps(camera_as_json(camera), indent=1) + "\n")


def camera_as_json(camera: Camera) -> dict[str, Any]:
    """What `write_camera` writes, as plain numbers and lists."""
    numbers = {name: getattr(camera, name) for name in ("width", "height", *LENS)}
    return {**numbers, "pixel_center": 0.5, "world_from_cam": camera.world_from_cam.tolist()}


@system_errors(FileError)
def camera_for(
    hw: tuple[int, int],
    *,
    camera: PathLike | Camera | None = None,
    fx: float | None = None,
    fy: float | None = None,
    cx: float | None = None,
    cy: float | None = None,
    fov: float | None = None,
    image: PathLike | None = None,
    pixel_center: float = 0.5,
) -> tuple[Camera, str]:
    """The camera of a picture of size `hw`, and in words where its intrinsics came from.

    Exactly one source: a `camera`, or the file of one; `fx` (and `fy`, default fx) in pixels; `fov`, horizontal, degrees; or
    the EXIF focal length of `image`. `cx`, `cy` default to the centre; `pixel_center` says where they put the first pixel's
    centre. Raises CameraError: two sources, or none (the message explains fov).
    """
    check_pixel_center(pixel_center)
    if camera is not None and pixel_center != 0.5:
        raise CameraError(
            "`camera` and `pixel_center` contradict each other: a camera file has its own field pixel_center; give one of them"
        )
    given = [name for name, value in {"fx": fx, "fy": fy, "cx": cx, "cy": cy}.items() if value is not None]
    _check_one_source(camera, given, fov)
    if isinstance(camera, Camera):
        return camera, "the given camera"
    if camera is not None:
        return read_camera(camera, hw=hw), f"camera {Path(camera).name}"
    focal_x, focal_y, source = _focal_lengths(hw, fx, fy, fov, image)
    border = 0.5 - pixel_center  # cx and cy count as the options do, the middle counts from the picture's border
    center = (hw[1] / 2 - border if cx is None else cx, hw[0] / 2 - border if cy is None else cy)
    return make_camera(OPTIONS, hw, (focal_x, focal_y, *center), pixel_center), source


def make_camera(
    source: PathLike,
    hw: tuple[int, int],
    intrinsics: Sequence[float],
    pixel_center: float,
    world_from_cam: ArrayLike | None = None,
) -> Camera:
    """A Camera from fx, fy, cx, cy as `source` counts pixels; errors name the source.

    Raises CameraError; warns of a principal point outside the picture (crops have it), of K for another size or unit, and
    of pixels twice as long as wide.
    """
    fx, fy, cx, cy = intrinsics
    K = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    try:
        camera = Camera.from_K(K, hw[1], hw[0], pixel_center, world_from_cam)
    except CameraError as error:
        raise CameraError(f"{source}: {error.marked if source == OPTIONS else error}") from error
    if not (0 <= camera.cx <= camera.width and 0 <= camera.cy <= camera.height):
        warn(
            f"{source}: the principal point ({camera.cx:g}, {camera.cy:g}) lies outside the {format_size(hw)} picture; "
            "right for a crop, else check `cx` and `cy`"
        )
    for found in check_lens(camera):
        far_from_square = found.check == "pixel-shape" and not 0.5 <= fx / fy <= 2  # an anamorphic lens has 2
        of_other_picture = found.check in ("intrinsics-size", "focal-length")  # K for another size, or as shares of it
        if far_from_square or of_other_picture:
            warn(f"{source}: {found.what}: {found.mend}")
    return camera


def focal_of_film(millimetres: float, hw: tuple[int, ...]) -> float:
    """Pixels of a picture of that size, of a focal length in terms of 35 mm film."""
    return millimetres / math.hypot(36, 24) * math.hypot(*hw)  # diagonals are compared (CIPA DCG-001)


def _left_and_right(fields: FileFields, left_K: str, right_K: str) -> tuple[Intrinsics, Intrinsics]:
    """fx, fy, cx, cy of both cameras, the right one's cx held against doffs."""
    left = fields.intrinsics(left_K)
    doffs = fields.number("doffs") if "doffs" in fields else None
    if right_K in fields:
        right = fields.intrinsics(right_K)
        found = right[2] - left[2]
        if doffs is not None and abs(doffs - found) > 0.01:  # published calibrations are rounded
            raise CameraError(
                f"{fields.path}: doffs is {doffs:g}, but cx of {right_K} minus cx of {left_K} is {found:g}; "
                "they must agree within 0.01 px"
            )
        return left, right
    if doffs is None:
        raise CameraError(f"{fields.path}: has neither {right_K} nor doffs; one of them is expected")
    return left, (left[0], left[1], left[2] + doffs, left[3])


def _check_one_source(camera: PathLike | Camera | None, given: list[str], fov: float | None) -> None:
    if camera is not None and (given or fov is not None):
        other = given[0] if given else "fov"
        raise CameraError(f"`camera` and `{other}` contradict each other; give one of them")
    if fov is not None and {"fx", "fy"} & set(given):
        raise CameraError(f"`fov` and `{given[0]}` contradict each other; give one of them")
    if "fy" in given and "fx" not in given:
        raise CameraError("`fy` is given without `fx`; give `fx` (and `fy` only where it differs)")


def _focal_lengths(
    hw: tuple[int, int], fx: float | None, fy: float | None, fov: float | None, image: PathLike | None
) -> tuple[float, float, str]:
    if fx is not None:
        return fx, fx if fy is None else fy, "fx"
    if fov is not None:
        if looks_like_radians(fov):
            warn(
                f"`fov` is {fov:g} degrees, as narrow as a telescope's; if these are radians, give `fov={math.degrees(fov):.4g}`"
            )
        focal = Camera.from_fov(hw[1], hw[0], fov).fx
        return focal, focal, "fov"
    try:
        film = None if image is None else read_stored(image).focal_35mm
    except FileError as error:
        raise CameraError(f"{NO_INTRINSICS} ({error})") from error
    if film is not None:
        focal = focal_of_film(film, hw)
        return focal, focal, f"EXIF FocalLengthIn35mmFilm ({film:g} mm)"
    raise CameraError(NO_INTRINSICS)
