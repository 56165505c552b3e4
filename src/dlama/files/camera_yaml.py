"""The YAML of ROS (camera_info: a calibration file or a printed message) or of OpenCV in; the fields of a camera file out."""

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

SUFFIXES = (".yaml", ".yml")
MATRIX, DISTORTION = ("camera_matrix", "K", "k"), ("distortion_coefficients", "D", "d")
"""Names of the fields: of calibration files; of a message that `rostopic echo` or `ros2 topic echo` prints."""
BLOCK_LIST = re.compile(r"^(\w+):[ ]*\n((?:[ ]*- [^\n]*\n)+)", re.MULTILINE)
"""A list with one number a line, as ROS 2 prints it and OpenCV does not read it."""


def read_yaml_fields(path: PathLike) -> FileFields:
    """K, pixel_center (0.0) and, where the file has them, width and height.

    Raises FileError, CameraError; warns of a distortion, which no camera here has.
    """
    file = existing_file(path)
    expected = (
        "the YAML of a camera is expected, as ROS (camera_info) and OpenCV write it: camera_matrix, image_width, ..."
    )
    with any_error(FileError, f"{file}: cannot be read; {expected}"):
        text = file.read_bytes()[: 2**20].decode("utf-8-sig")
        body = BLOCK_LIST.sub(_as_flow_list, _first_document(text))
        modes = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
        storage = cv2.FileStorage(f"%YAML:1.0\n---\n{body}\n", modes)  # OpenCV's head, which ROS leaves away
        matrix, distortion = (_first_numbers(storage, names) for names in (MATRIX, DISTORTION))
        size = {name: _first_numbers(storage, (f"image_{name}", name)) for name in ("width", "height")}
    if len(matrix) != 9:
        raise CameraError(f"{file}: camera_matrix has {len(matrix)} numbers; 9 are expected; {expected}")
    if any(distortion):
        warn(
            f"{file}: its distortion ({', '.join(f'{each:g}' for each in distortion[:5])}) is not used: the picture is expected "
            "to be undistorted, and camera_matrix to be its own"
        )
    values: dict[str, Any] = {"K": [matrix[0:3], matrix[3:6], matrix[6:9]], "pixel_center": 0.0}
    return FileFields(file, values | {name: found[0] for name, found in size.items() if found})


def _first_document(text: str) -> str:
    """The lines up to the next `---`, without those of the head."""
    lines = itertools.dropwhile(lambda line: not line or line.startswith(("%", "---")), text.splitlines())
    return "".join(f"{line}\n" for line in itertools.takewhile(lambda line: not line.startswith("---"), lines))


def _as_flow_list(found: re.Match[str]) -> str:
    return f"{found[1]}: [{', '.join(line.strip()[2:] for line in found[2].splitlines())}]\n"


def _first_numbers(storage: cv2.FileStorage, names: Sequence[str]) -> list[float]:
    """Those of the first of the fields that the file has."""
    return next(filter(None, (_numbers(storage.getNode(name)) for name in names)), [])


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
