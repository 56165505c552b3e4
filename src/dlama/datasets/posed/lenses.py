"""The option `camera`, or a camera file that lies with a data set, in; a pinhole camera's intrinsics before a picture was opened,
out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dlama.datasets.text_tables import read_matrix, read_rows
from dlama.errors import CameraError, FileError
from dlama.files.camera_yaml import SUFFIXES, read_yaml_fields
from dlama.files.cameras import make_camera, read_camera
from dlama.files.fields import FileFields, Intrinsics
from dlama.geometry.camera import Camera, Float64Array
from dlama.writing.atomic_write import PathLike

CameraOption = PathLike | Camera | None
"""The option `camera` of layouts whose files may say nothing of intrinsics: a camera file, or a Camera (its pose is not used)."""


@dataclass(frozen=True)
class Lens:
    """Intrinsics as a file says them, before any picture was opened."""

    source: str
    """The file or option they come from, for messages."""
    intrinsics: Intrinsics
    """fx, fy, cx, cy of the colour picture, px."""
    pixel_center: float
    """Where they put the first pixel's centre: 0.5 or 0.0."""
    hw: tuple[int, int] | None = None
    """The picture size they are for; None: the picture's."""
    scales: bool = False
    """Whether pictures of other sizes and the same proportions have them too, scaled."""

    @classmethod
    def of_matrix(
        cls, source: str, K: Sequence[Sequence[float]], center: float, hw: tuple[int, int] | None = None
    ) -> Lens:
        """Of a 3x3 matrix; raises CameraError that begins with the source for one that is none of a pinhole camera."""
        return cls(source, FileFields(source, {"the matrix K": K}).intrinsics("the matrix K"), center, hw)

    def camera(self, world_from_cam: Float64Array, hw: tuple[int, ...] | None = None) -> Camera:
        """The camera at a pose, of a picture of that size where they are for none; raises CameraError."""
        height, width = self.hw or hw or ()
        return make_camera(self.source, (height, width), self.intrinsics, self.pixel_center, world_from_cam)


def lens_for(folder: Path, root: Path, camera: CameraOption, names: Sequence[str], advice: str) -> Lens:
    """The option where given, else the first file of these names in the folder, or above it up to the data set's root.

    Raises CameraError with the `advice` where there is none; FileError.
    """
    if isinstance(camera, Camera):
        return _of_camera(camera, "the given camera")
    if camera is not None:
        return read_lens(Path(camera))
    for place in (folder, *folder.parents):
        for name in names:
            if (place / name).is_file():
                return read_lens(place / name)
        if place == root:
            break
    raise CameraError(f"{folder}: has no {' or '.join(names)}, and {advice}; give `camera=FILE.json`")


def read_lens(path: Path) -> Lens:
    """Our camera JSON (its pose is not used), the YAML of ROS or OpenCV, Open3D's camera_intrinsic.json, or a text file with a
    3x3 K, a 4x4 one with nothing in the last row and column (ScanNet), or fx fy cx cy (ETH3D's SLAM sequences).

    The first pixel of all but the first has its centre at 0.0. Raises FileError, CameraError.
    """
    if path.suffix.lower() == ".txt":
        rows = read_rows(path)
        if len(rows) == 1:
            fx, fy, cx, cy = rows[0].numbers("fx fy cx cy", 4)
            return Lens(str(path), (fx, fy, cx, cy), 0.0)
        size = 4 if len(rows) == 4 else 3
        return Lens.of_matrix(str(path), read_matrix(path, (size, size))[:3, :3].tolist(), 0.0)
    if path.suffix.lower() in SUFFIXES:
        fields = read_yaml_fields(path)
        return Lens(str(path), fields.intrinsics("K"), 0.0, fields.size(None) if "width" in fields else None)
    return _of_camera(read_camera(path), str(path))


def json_lens(fields: FileFields) -> Lens:
    """The fields `width`, `height`, `K` and `pixel_center` (0.0 where it is missing); raises CameraError."""
    return Lens(str(fields.path), fields.intrinsics("K"), fields.pixel_center(0.0), fields.size(None))


def units_per_metre(fields: FileFields, name: str, default: float | None = None) -> float:
    """1 / a field that holds metres per unit of depth; raises CameraError (no number), FileError (not > 0)."""
    scale = fields.number(name) if default is None or name in fields else default
    if scale <= 0:
        raise FileError(f"{fields.path}: {name} is {scale:g}; metres per unit > 0 are expected")
    return 1 / scale


def _of_camera(camera: Camera, source: str) -> Lens:
    return Lens(source, (camera.fx, camera.fy, camera.cx, camera.cy), 0.5, camera.hw)
