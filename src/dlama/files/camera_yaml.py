"""The YAML of ROS (camera_info: a calibration file or a printed message), or the YAML or XML of OpenCV, in; the fields of a
camera file, or of a pair's, out."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import Any

import cv2

from dlama.errors import CameraError, FileError, any_error, warn
from dlama.files.fields import FileFields
from dlama.files.rasters.images import existing_file
from dlama.writing.atomic_write import PathLike

SUFFIXES = (".yaml", ".yml", ".xml")
MATRIX = ("camera_matrix", "K", "k", "Camera_Matrix")
DISTORTION = ("distortion_coefficients", "D", "d", "Distortion_Coefficients")
PROJECTION = ("projection_matrix", "P", "p")
WIDTH, HEIGHT = ("image_width", "width", "image_Width"), ("image_height", "height", "image_Height")
"""Names of the fields: of calibration files; of a message that `rostopic echo` or `ros2 topic echo` prints; of Metashape."""
BLOCK_LIST = re.compile(r"^(\w+):[ ]*\n((?:[ ]*- [^\n]*\n)+)", re.MULTILINE)
"""A list with one number a line, as ROS 2 prints it and OpenCV does not read it."""


def read_yaml_fields(path: PathLike) -> FileFields:
    """K, pixel_center (0.0) and, where the file has them, width and height.

    Raises FileError, CameraError; warns of a distortion, which no camera here has.
    """
    expected = "the YAML or XML of a camera is expected, as ROS and OpenCV write it: camera_matrix, image_width, ..."
    matrix, distortion, projection, *size = _read_numbers(path, expected, MATRIX, DISTORTION, PROJECTION, WIDTH, HEIGHT)
    if len(matrix) != 9:
        raise CameraError(f"{path}: camera_matrix has {len(matrix)} numbers; 9 are expected; {expected}")
    if any(distortion):
        of_ros = ""
        if len(projection) == 12 and (rectified := _rows_of(projection)) != _rows_of(matrix):
            (fx, _, cx), (_, fy, cy), _ = rectified
            of_ros = " (image_rect's is projection_matrix: give "
            of_ros += f"`fx={fx:g}` `fy={fy:g}` `cx={cx:g}` `cy={cy:g}` `pixel_center=0.0`)"
        warn(
            f"{path}: its distortion ({', '.join(f'{each:g}' for each in distortion[:5])}) is not used: the picture is expected "
            f"to be undistorted, and camera_matrix to be its own{of_ros}"
        )
    return _with_size(path, {"K": _rows_of(matrix)}, size)


def read_yaml_pair(path: PathLike) -> FileFields:
    """left_K, right_K, baseline_m, pixel_center (0.0) and, where the file has them, width and height of a rectified pair.

    Of ROS the right camera's file, whose projection_matrix has the baseline; of OpenCV P1 and P2. Raises FileError, CameraError.
    """
    expected = "the YAML or XML of a rectified pair is expected: ROS's right camera (projection_matrix), or P1 and P2 of OpenCV"
    of_ros, first, second, *size = _read_numbers(path, expected, PROJECTION, ("P1",), ("P2",), WIDTH, HEIGHT)
    left, right = (of_ros, of_ros) if of_ros else (first, second)
    if len(left) != 12 or len(right) != 12:
        raise CameraError(f"{path}: has no projection matrices of 12 numbers; {expected}")
    baseline = -right[3] / (right[0] or 1.0)
    if baseline == 0:
        raise CameraError(f"{path}: its projection matrix has no baseline, as the left camera's; {expected}")
    values = {"left_K": _rows_of(left), "right_K": _rows_of(right), "baseline_m": baseline}
    return _with_size(path, values, size)


def _read_numbers(path: PathLike, expected: str, *fields: Sequence[str]) -> list[list[float]]:
    """The numbers of each field, by the first of its names that the file has; none where there is none. FileError."""
    file = existing_file(path)
    with any_error(FileError, f"{file}: cannot be read; {expected}"):
        text = file.read_bytes()[: 2**20].decode("utf-8-sig")
        kind = cv2.FILE_STORAGE_FORMAT_XML
        if file.suffix.lower() != ".xml":
            body = BLOCK_LIST.sub(_as_flow_list, _first_document(text))
            text = f"%YAML:1.0\n---\n{body}\n"  # OpenCV's head, which ROS leaves away
            kind = cv2.FILE_STORAGE_FORMAT_YAML
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY | kind)
        return [next(filter(None, (_numbers(storage.getNode(name)) for name in names)), []) for names in fields]


def _rows_of(matrix: Sequence[float]) -> list[list[float]]:
    """The 3 x 3 of a matrix of 3 rows."""
    wide = len(matrix) // 3
    return [list(matrix[wide * row : wide * row + 3]) for row in range(3)]


def _with_size(path: PathLike, values: dict[str, Any], size: Sequence[Sequence[float]]) -> FileFields:
    found = {name: each[0] for name, each in zip(("width", "height"), size) if each}
    return FileFields(path, {**values, "pixel_center": 0.0, **found})


def _first_document(text: str) -> str:
    """The lines up to the next `---`, without those of the head."""
    lines = itertools.dropwhile(lambda line: not line or line.startswith(("%", "---")), text.splitlines())
    return "".join(f"{line}\n" for line in itertools.takewhile(lambda line: not line.startswith("---"), lines))


def _as_flow_list(found: re.Match[str]) -> str:
    return f"{found[1]}: [{', '.join(line.strip()[2:] for line in found[2].splitlines())}]\n"


def _numbers(node: Any) -> list[float]:
    """Those of a number, a list, or the `data` of a matrix; none where there is nothing. ValueError: something else."""
    if node.isMap():
        node = node.getNode("data")
    if node.empty() or node.isNone():
        return []
    each = [node.at(place) for place in range(node.size())] if node.isSeq() else [node]
    if not all(one.isReal() or one.isInt() for one in each):
        raise ValueError("numbers are expected")
    return [one.real() for one in each]
