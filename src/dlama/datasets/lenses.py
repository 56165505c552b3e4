"""The option `camera`, or a camera file that lies with a data set, in; the lens of its frames out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dlama.datasets.posed_frames import Lens
from dlama.datasets.text_tables import read_json, read_matrix
from dlama.errors import CameraError
from dlama.files.atomic_write import PathLike
from dlama.files.cameras import read_camera
from dlama.files.checked_fields import FileFields
from dlama.geometry.camera import Camera

CameraOption = PathLike | Camera | None
OPEN3D_FIELDS = ("width", "height", "intrinsic_matrix")


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
    raise CameraError(f"{folder}: has no {' or '.join(names)}, and {advice}; give a camera (--camera FILE.json)")


def read_lens(path: Path) -> Lens:
    """Our camera JSON (its pose is not used), Open3D's camera_intrinsic.json, or a text file with a 3x3 or 4x4 K.

    Open3D's and the text file's first pixel has its centre at 0.0. Raises FileError, CameraError.
    """
    if path.suffix.lower() == ".txt":
        return text_lens(path, (3, 3))
    fields = read_json(path)
    if "intrinsic_matrix" in fields:
        return _of_open3d(fields)
    return _of_camera(read_camera(path), str(path))


def text_lens(path: Path, shape: tuple[int, int]) -> Lens:
    """A text file with the matrix K, as `shape` says 3x3, or 4x4 with nothing in the last row and column (ScanNet)."""
    K = read_matrix(path, shape)[:3, :3]
    return Lens(str(path), FileFields(path, {"the matrix K": K.tolist()}).intrinsics("the matrix K"), 0.0)


def _of_camera(camera: Camera, source: str) -> Lens:
    return Lens(source, (camera.fx, camera.fy, camera.cx, camera.cy), 0.5, camera.hw)


def _of_open3d(fields: FileFields) -> Lens:
    """`intrinsic_matrix` lists K column by column."""
    listed = fields.values["intrinsic_matrix"]
    if not isinstance(listed, list) or len(listed) != 9:
        raise CameraError(
            f"{fields.path}: intrinsic_matrix is {str(listed)[:60]}; 9 numbers, column by column, are wanted"
        )
    columns = [listed[start : start + 3] for start in (0, 3, 6)]
    K = [list(row) for row in zip(*columns)]
    intrinsics = FileFields(fields.path, {"intrinsic_matrix": K}).intrinsics("intrinsic_matrix")
    return Lens(str(fields.path), intrinsics, 0.0, fields.size(None))
