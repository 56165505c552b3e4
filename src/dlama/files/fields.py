"""JSON and calib.txt of Middlebury or KITTI in; named fields out, each checked as it is asked for; errors name file and field."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dlama.arguments import is_finite
from dlama.errors import CameraError, FileError, any_error, format_size, warn
from dlama.files.rasters.images import existing_file
from dlama.geometry.camera import Float64Array, intrinsics_of
from dlama.writing.atomic_write import PathLike

LONGEST_SIDE = 2**24
"""Pixels of the longest side of a picture that a file may name."""

Intrinsics = tuple[float, float, float, float]
"""fx, fy, cx, cy in pixels, as the file counts them."""
LENS = ("fx", "fy", "cx", "cy")


@dataclass(frozen=True)
class FileFields:
    """The fields of one file."""

    path: PathLike
    values: dict[str, Any]

    def __contains__(self, name: object) -> bool:
        return name in self.values

    def number(self, name: str) -> float:
        """A finite number; raises CameraError."""
        value = self._field(name)
        if isinstance(value, bool) or not is_finite(value):
            raise CameraError(f"{self.path}: {name} is {_format_value(value)}; a finite number is expected")
        return float(value)

    def count(self, name: str) -> int:
        """A whole number >= 1; raises CameraError."""
        value = self.number(name)
        if value != int(value) or not 1 <= value <= LONGEST_SIDE:
            raise CameraError(
                f"{self.path}: {name} is {value:g}; a whole number of pixels, 1 to {LONGEST_SIDE}, is expected"
            )
        return int(value)

    def numbers(self, name: str, count: int) -> list[float]:
        """So many finite numbers; raises CameraError."""
        return [float(value) for value in self._array(name, (count,), f"{count} finite numbers are expected")]

    def matrix(self, name: str, shape: tuple[int, int]) -> Float64Array:
        """A matrix of finite numbers; raises CameraError."""
        return self._array(name, shape, f"a {shape[0]}x{shape[1]} matrix of finite numbers is expected")

    def _array(self, name: str, shape: tuple[int, ...], expected: str) -> Float64Array:
        value = self._field(name)
        try:
            array = np.array(value, np.float64)
        except (TypeError, ValueError, OverflowError):
            array = np.full(shape, np.nan)
        if array.shape != shape or not np.isfinite(array).all():
            raise CameraError(f"{self.path}: {name} is {_format_value(value)}; {expected}")
        return array

    def intrinsics(self, name: str) -> Intrinsics:
        """fx, fy, cx, cy of a matrix fx 0 cx / 0 fy cy / 0 0 1; raises CameraError for any other."""
        return intrinsics_of(self.matrix(name, (3, 3)), f"{self.path}: {name}")

    def lens(self) -> Intrinsics:
        """fx, fy, cx, cy from fields of these names; raises CameraError."""
        fx, fy, cx, cy = (self.number(name) for name in LENS)
        return fx, fy, cx, cy

    def pixel_center(self, default: float) -> float:
        """Where K puts the first pixel's centre, which a Camera checks; raises CameraError where that is no number."""
        return self.number("pixel_center") if "pixel_center" in self else default

    def size(self, hw: tuple[int, int] | None) -> tuple[int, int]:
        """(height, width) from the file, which must be those of the picture `hw`; `hw` where the file has none. CameraError."""
        if hw is not None and "width" not in self and "height" not in self:
            return hw
        height, width = self.count("height"), self.count("width")
        if hw is not None and (height, width) != tuple(hw):
            turned = " (a picture with an EXIF orientation is read as viewers show it)" if (width, height) == hw else ""
            raise CameraError(
                f"{self.path}: the camera is {width}x{height} and the picture {format_size(hw)}; both must be the same{turned}"
            )
        return height, width

    def warn_of_unknown(self, known: Sequence[str]) -> None:
        """Warn (UserWarning) of fields that nothing reads: one may be a misspelt pose, or a distortion."""
        unknown = [f"'{name}'" for name in self.values if name not in known]
        if unknown:
            warn(
                f"{self.path}: fields that are not known are not used: {', '.join(unknown)}; known are {', '.join(known)}"
            )

    def text(self, name: str) -> str:
        """A text that is not empty; raises FileError."""
        return str(self._of_kind(name, str, "a text"))

    def entries(self, name: str, of: str) -> list[object]:
        """A list with something in it, `of` says of what; raises FileError."""
        return list(self._of_kind(name, list, f"a list of {of}"))

    def part(self, name: str, values: object) -> FileFields:
        """`values` as the fields of an object within this one, whose errors call it `name`; raises FileError."""
        where = f"{self.path}: {name}"
        if not isinstance(values, dict):
            raise FileError(f"{where} is {_format_value(values)[:40]}; an object with named fields is expected")
        return FileFields(where, values)

    def _of_kind(self, name: str, kind: type, expected: str) -> Any:
        value = self.values.get(name)
        if not isinstance(value, kind) or not value:
            raise FileError(f"{self.path}: {name} is {_format_value(value)[:40]}; {expected} is expected")
        return value

    def _field(self, name: str) -> Any:
        if name not in self.values:
            raise CameraError(f"{self.path}: field '{name}' is missing; it has {', '.join(self.values) or 'none'}")
        return self.values[name]


def intrinsics_in(fields: FileFields) -> Intrinsics:
    """fx, fy, cx, cy of a camera's fields (`read_camera_fields` of cameras), as its file counts pixels. Raises CameraError."""
    matrix = next((name for name in ("K", "cam0") if name in fields), None)
    if matrix is None:
        return fields.lens()
    if any(name in fields for name in LENS):
        raise CameraError(f"{fields.path}: K and fx, fy, cx, cy are both given; one of them is expected")
    return fields.intrinsics(matrix)


def read_json_fields(path: PathLike) -> FileFields:
    """The fields of a JSON object. Raises FileError (no JSON: with line and column)."""
    return json_fields(path, json_text(path))


def read_json_pair(path: PathLike) -> FileFields:
    """The fields of the JSON of a pair: left_K, right_K, baseline_m, ...; of the calib.json of a stereo folder K is left_K, doffs
    and pixel_center are 0 unless it has them. Raises FileError, CameraError."""
    fields = read_json_fields(path)
    if "left_K" in fields:
        return fields
    has = dict(fields.values)
    if "right_K" in has or "K" not in has:
        expected = "left_K, right_K or doffs, and baseline_m of a pair are expected"
        raise CameraError(f"{path}: field 'left_K' is missing; {expected}; it has {', '.join(has) or 'none'}")
    return FileFields(path, {"left_K": has.pop("K"), "doffs": 0.0, "pixel_center": 0.0, **has})


def json_text(path: PathLike) -> str:
    """The text of a JSON file; raises FileError where it is not there, or no UTF-8."""
    file = existing_file(path)
    try:
        return file.read_text(encoding="utf-8-sig")
    except ValueError as error:
        raise FileError(f"{file}: is no JSON: it is no text in UTF-8") from error


def json_fields(path: PathLike, text: str) -> FileFields:
    """The fields of a JSON object as text; raises FileError that names `path`, line and column."""
    return fields_of(path, json_value(path, text))


def fields_of(path: PathLike, values: object) -> FileFields:
    """What a JSON text holds, as the fields of an object; raises FileError for anything else."""
    if not isinstance(values, dict):
        raise FileError(f"{path}:1:1: holds a JSON {type(values).__name__}; an object with named fields is expected")
    return FileFields(path, values)


def json_value(path: PathLike, text: str) -> Any:
    """What a JSON text holds; raises FileError that names `path`, line and column."""
    try:
        return json.loads(text, object_pairs_hook=lambda pairs: _each_once(path, pairs))
    except json.JSONDecodeError as error:
        raise FileError(f"{path}:{error.lineno}:{error.colno}: is no JSON ({error.msg})") from error
    except FileError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path}: is no JSON ({error})") from error


def _each_once(path: PathLike, pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Fields by name. FileError: one is given twice."""
    ((name, count),) = Counter(name for name, _ in pairs).most_common(1) or [("", 1)]
    if count > 1:
        raise FileError(f"{path}: field '{name}' is given twice; each field is expected once")
    return dict(pairs)


def read_calib_txt(path: PathLike) -> FileFields:
    """The fields of a Middlebury calib.txt: lines `name=number` or `name=[a b c; d e f; g h i]`; the same of one of KITTI, and K
    or fx, fy, cx, cy of a text that holds nothing else; pixel_center (0.0). Raises FileError."""
    file = existing_file(path)
    wrong = f"{file}: is no calib.txt of Middlebury or KITTI and no K (9 or 16 numbers, or fx fy cx cy)"
    with any_error(FileError, f"{wrong}, lines 'name=value' are expected"):
        text = file.read_text(encoding="utf-8-sig")
        values = _kitti_fields(text) or _matrix_fields(text)
        if not values:
            lines = [line.partition("=") for line in text.splitlines() if line.strip()]
            if other := next((line for line, sign, _ in lines if not sign), ""):
                raise FileError(f"{wrong}: a line is {other[:60]!r}; 'name=value' is expected, or a JSON file")
            values = _each_once(file, [(name.strip(), _calib_value(value.strip())) for name, _, value in lines])
    return FileFields(file, {**values, "pixel_center": 0.0})


def _kitti_fields(text: str) -> dict[str, Any]:
    """cam0, cam1 (px) and baseline (mm) of KITTI's colour cameras: P2 and P3, or P_rect_02 and P_rect_03, 3 x 4 each, which are
    for pictures of S_rect_02 (width, height); {}: there are none. ValueError: other numbers."""
    found = re.findall(r"^P(?:_rect_0)?([23]):(.*)", text, re.MULTILINE)
    if [name for name, _ in found] != ["2", "3"]:
        return {}
    left, right = (np.array(numbers.split(), np.float64).reshape(3, 4) for _, numbers in found)
    baseline = 1000 * float((left[0, 3] - right[0, 3]) / max(left[0, 0], 1e-9))
    size = re.search(r"^S_rect_02:(.*)", text, re.MULTILINE)
    sides = dict(zip(("width", "height"), map(float, size[1].split()))) if size else {}
    return {"cam0": left[:, :3].tolist(), "cam1": right[:, :3].tolist(), "baseline": baseline, **sides}


def _matrix_fields(text: str) -> dict[str, Any]:
    """K of a text of numbers alone: 3 x 3 (BOP's scenes, cam_K.txt) or 4 x 4 (ScanNet); or fx, fy, cx, cy (ETH3D's SLAM
    sequences); {}: it is none."""
    try:
        numbers = np.array(text.replace(",", " ").split(), np.float64)
    except ValueError:
        return {}
    if numbers.size == 4:
        return dict(zip(LENS, numbers.tolist()))
    side = {9: 3, 16: 4}.get(numbers.size)
    return {"K": numbers.reshape(side, side)[:3, :3].tolist()} if side else {}


def _calib_value(text: str) -> float | list[list[float]]:
    if text.startswith("[") and text.endswith("]"):
        return [[float(number) for number in row.split()] for row in text[1:-1].split(";")]
    return float(text)


def _format_value(value: Any) -> str:
    try:
        text = json.dumps(value) if not isinstance(value, float) else str(value)
    except (ValueError, RecursionError):  # a whole number of more than 4300 digits, lists in lists without end
        text = f"a {type(value).__name__} that is too long to show"
    return text if len(text) <= 60 else text[:57] + "..."
