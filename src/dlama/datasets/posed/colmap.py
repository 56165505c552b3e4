"""COLMAP folders in (a model in sparse/0, sparse or the folder; images/; depth maps next to them); posed frames and cases out.

Text: cameras.txt `ID MODEL W H params`, images.txt two lines each, `ID qw qx qy qz tx ty tz CAMERA NAME` and its points.
Binary: the same fields, little-endian. Poses are world to camera, axes OpenCV's, first pixel's centre at 0.5. Lengths have
the reconstruction's unit: with depth maps next to it, theirs. A scene is written as
a binary one. Format: colmap.github.io/format.html.

Depth: depth/NAME.png (16-bit millimetres), .exr, .pfm, .npy, of the picture NAME.jpg; or the dense workspace's own
stereo/depth_maps/NAME.jpg.geometric.bin (else .photometric.bin). It must have the unit of the model's positions: metres.
With depth_params.json next to the model, which 3D Gaussian Splatting's make_depth_scale.py writes, PNGs are inverse depth of a
network: code / 65536 x scale + offset, by the picture's NAME (github.com/graphdeco-inria/gaussian-splatting, scene/cameras.py).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.posed import nerfstudio
from dlama.datasets.posed.lenses import Lens
from dlama.datasets.posed.posed_frames import LOG, Listed, files_of
from dlama.datasets.text_tables import folders_in, natural_order, pose_at, read_rows
from dlama.errors import CameraError, FileError, any_error
from dlama.files.fields import read_json_fields
from dlama.files.rasters.depth import read_inverse_depth
from dlama.files.rasters.images import existing_file
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import PointCloud
from dlama.geometry.motion.poses import invert_pose, make_pose, quaternion_from_rotation, rotation_from_quaternion
from dlama.geometry.projection import depth_from_inverse
from dlama.geometry.rgbd import Float32Array
from dlama.writing.atomic_write import write_file

PARAMETERS = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8}
"""How many each model has, in the order of their numbers in binary files."""
CUT = "ends early; it is truncated, or no COLMAP file"


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """One entry of images."""

    name: str
    lens: Lens
    world_from_cam: Float64Array


def read_model(folder: Path) -> list[ColmapImage]:
    """The images of a model, by name. Raises FileError, CameraError (lens models with distortion: undistort first)."""
    if (folder / "cameras.txt").is_file():
        cameras = _text_cameras(folder / "cameras.txt")
        images = _text_images(folder / "images.txt", cameras)
    else:
        cameras = _binary_cameras(folder / "cameras.bin")
        images = _binary_images(folder / "images.bin", cameras)
    if not images:
        raise FileError(f"{folder}: the model holds no images")
    return sorted(images, key=lambda image: natural_order(image.name))


def _text_cameras(path: Path) -> dict[int, Lens]:
    cameras = {}
    for row in read_rows(path):
        if len(row.words) < 4:
            raise FileError(
                f"{row.at(0)}: the line has {len(row.words)} values; ID MODEL WIDTH HEIGHT PARAMS are expected"
            )
        numbers = [row.number(place) for place in range(4, len(row.words))]
        size = int(row.number(3)), int(row.number(2))
        cameras[int(row.number(0))] = _pinhole(path, row.at(1), row.words[1], numbers, size)
    return cameras


def _pinhole(path: Path, where: str, model: str, numbers: list[float], hw: tuple[int, int]) -> Lens:
    """The lens of a camera model with its parameters, which may distort by no more than shows. CameraError."""
    if model not in PARAMETERS:
        raise CameraError(f"{where}: camera model {model}; one of {', '.join(PARAMETERS)} is expected, undistort first")
    if len(numbers) != PARAMETERS[model]:
        raise CameraError(
            f"{where}: camera model {model} has {len(numbers)} parameters; {PARAMETERS[model]} are expected"
        )
    fx, fy, cx, cy, *terms = numbers if model in ("PINHOLE", "OPENCV") else (numbers[0], *numbers)
    if nerfstudio.distortion_px((fx, fy, cx, cy), hw, [*terms, 0, 0, 0, 0][:4]) > nerfstudio.SHOWS_PX:
        raise CameraError(
            f"{where}: the camera is distorted; a pinhole camera is expected, run colmap image_undistorter"
        )
    return Lens(str(path.parent), (fx, fy, cx, cy), 0.5, hw)


def _text_images(path: Path, cameras: Mapping[int, Lens]) -> list[ColmapImage]:
    found, points = [], 0
    for row in read_rows(path):  # a name may hold blanks, so more than ten words may be an image too
        if len(row.words) < 10 or (len(row.words) > 10 and row.line == points):
            continue  # the points of the image before, by threes
        points = row.line + 1
        quaternion = np.array([row.number(place) for place in (2, 3, 4, 1)])
        shift = np.array([row.number(place) for place in (5, 6, 7)])
        found.append(_image(row.at(0), " ".join(row.words[9:]), int(row.number(8)), cameras, quaternion, shift))
    return found


def _image(
    where: str,
    name: str,
    camera: int,
    cameras: Mapping[int, Lens],
    xyzw: Float64Array,
    shift: Float64Array,
) -> ColmapImage:
    if camera not in cameras:
        raise FileError(f"{where}: image {name} has camera {camera}, which cameras does not hold")
    norm = float(np.linalg.norm(xyzw))
    if not norm > 0:
        raise CameraError(f"{where}: image {name} has no rotation (quaternion 0)")
    cam_from_world = make_pose(rotation_from_quaternion(xyzw / norm), shift)
    return ColmapImage(name, cameras[camera], pose_at(where, invert_pose(cam_from_world)))


class _Bytes:
    """Binary fields read one after the other. struct.error, ValueError: the file ends before."""

    def __init__(self, path: Path) -> None:
        self.data, self.at = existing_file(path).read_bytes(), 0

    def take(self, kinds: str) -> tuple[float, ...]:
        """The next fields, of `struct` kinds such as "idd"."""
        found = struct.unpack_from("<" + kinds, self.data, self.at)
        self.at += struct.calcsize("<" + kinds)
        return found

    def text(self) -> str:
        """The next name, up to its NUL."""
        start, end = self.at, self.data.index(b"\0", self.at)
        self.at = end + 1
        return self.data[start:end].decode("utf-8", "replace")


def _binary_cameras(path: Path) -> dict[int, Lens]:
    data, cameras = _Bytes(path), dict[int, Lens]()
    with any_error(FileError, f"{path}: {CUT}"):
        for _ in range(int(data.take("Q")[0])):
            number, kind, width, height = (int(one) for one in data.take("iiQQ"))
            model = dict(enumerate(PARAMETERS)).get(kind, f"number {kind}")
            numbers = list(data.take("d" * PARAMETERS.get(model, 0)))
            cameras[number] = _pinhole(path, str(path), model, numbers, (height, width))
    return cameras


def _binary_images(path: Path, cameras: Mapping[int, Lens]) -> list[ColmapImage]:
    data, found = _Bytes(path), []
    with any_error(FileError, f"{path}: {CUT}"):
        for _ in range(int(data.take("Q")[0])):
            _, w, x, y, z, tx, ty, tz, camera = data.take("idddddddi")
            name = data.text()
            data.take(f"{24 * int(data.take('Q')[0])}x")  # its points
            found.append(_image(str(path), name, int(camera), cameras, np.array([x, y, z, w]), np.array([tx, ty, tz])))
    return found


POINT = np.dtype([("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8"), ("track", "<u8")])
"""Of points3D.bin, of a point without a track."""


def write_model(folder: Path, cameras: Mapping[str, Camera], cloud: PointCloud) -> None:
    """cameras.bin, images.bin and points3D.bin: a camera and an image of each view (name of its picture -> camera), and points
    with their colours; a point's error is 1 - its confidence, and it has no track. Binary, as readers of the text end a name at
    its first blank. Raises OutputError."""
    count = struct.pack("<Q", len(cameras))
    lenses, images = [count], [count]
    for number, (name, camera) in enumerate(cameras.items(), 1):
        lens = camera.fx, camera.fy, camera.cx, camera.cy
        lenses.append(struct.pack("<iiQQ4d", number, 1, camera.width, camera.height, *lens))  # 1: PINHOLE
        pose = camera.cam_from_world
        wxyz = np.roll(quaternion_from_rotation(pose[:3, :3]), 1)
        images.append(struct.pack("<i7di", number, *wxyz, *pose[:3, 3], number) + name.encode() + b"\0" + bytes(8))
    points = np.zeros(len(cloud), POINT)
    points["id"] = np.arange(1, len(cloud) + 1)
    points["xyz"], points["rgb"], points["error"] = cloud.points, cloud.color, 1 - cloud.confidence
    write_file(folder / "cameras.bin", b"".join(lenses))
    write_file(folder / "images.bin", b"".join(images))
    write_file(folder / "points3D.bin", struct.pack("<Q", len(points)) + points.tobytes())


FITTED = "depth_params.json"
"""Name of a picture -> scale and offset of its inverse depth."""
FIRST = "sparse/0"
"""The largest of the models that a mapper could not join."""
DENSE, DENSE_KINDS = "stereo/depth_maps", (".geometric.bin", ".photometric.bin")


def looks_like(root: Path) -> bool:
    """True where a model lies in a folder, and no listing of nerfstudio, which often has one next to it."""
    return is_scene(root) and not nerfstudio.looks_like(root)


def is_scene(root: Path) -> bool:
    """True where a model lies in a folder, also next to a listing: for a layout that is asked for."""
    return model_folder(root) is not None


def model_folder(root: Path) -> Path | None:
    """Where the model lies, if there is one."""
    for name in (FIRST, "sparse", ""):
        for kind in (".txt", ".bin"):
            if all((root / name / f"{part}{kind}").is_file() for part in ("cameras", "images")):
                return root / name
    return None


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    model = model_folder(folder)
    assert model is not None
    places = folders_in(model.parent) if model == folder / FIRST else []
    others = [each.name for each in places if each != model and model_folder(each) == each]
    if others:
        left = ", ".join(sorted(others, key=natural_order))
        LOG.warning("%s: model %s is read and %s not, whose poses are of other worlds", model.parent, model.name, left)
    fitted = read_json_fields(model / FITTED) if (model / FITTED).is_file() else None
    for image in read_model(model):
        stem = Path(image.name).with_suffix("").as_posix()
        name, depth = stem.replace("/", "_"), depth_of(folder, image)
        if depth is None:
            yield name, f"without depth/NAME.png (millimetres) or {DENSE}/NAME{DENSE_KINDS[0]}"
            continue
        units, color = 1000.0 if depth.suffix == ".png" else 1.0, folder / "images" / image.name
        files = files_of(color, depth, image.lens, image.world_from_cam, units, has_far=True)
        if fitted is not None and depth.suffix == ".png":
            fit = fitted.part(stem, fitted.values.get(stem, {"scale": 0, "offset": 0}))
            scale, offset = fit.number("scale"), fit.number("offset")
            if scale <= 0:
                yield name, f"without a scale above 0 in {FITTED}"
                continue
            files = replace(files, depth=partial(read_fitted_depth, depth, scale, offset))
        yield name, files


def read_fitted_depth(path: Path, scale: float, offset: float) -> Float32Array:
    """H x W metres of a PNG of inverse depth; +inf where that is not above 0. Raises FileError, DepthError."""
    return depth_from_inverse(read_inverse_depth(path) * np.float32(scale / 2**16) + np.float32(offset))


def depth_of(folder: Path, image: ColmapImage) -> Path | None:
    """The depth map next to the model for an image."""
    stem = Path(image.name).with_suffix("")
    kinds = (".png", ".exr", ".pfm", ".npy")
    places = [folder / name / f"{stem}{kind}" for name in ("depth", "depths") for kind in kinds]
    places += [folder / DENSE / f"{image.name}{kind}" for kind in DENSE_KINDS]
    return next((place for place in places if place.is_file()), None)
