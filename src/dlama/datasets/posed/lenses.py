"""The option `camera`, or a camera file that lies with a data set, in; a pinhole camera's intrinsics before a picture was opened,
out; and depth of one camera as another sees it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.errors import CameraError, FileError
from dlama.files.cameras import make_camera, read_camera_fields
from dlama.files.fields import FileFields, Intrinsics, intrinsics_in
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.projection import project_to_pixels, unproject
from dlama.geometry.rgbd import Float32Array
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

    def camera(self, world_from_cam: Float64Array, hw: tuple[int, ...] | None = None) -> Camera:
        """The camera at a pose, of a picture of that size where they are for none; raises CameraError."""
        height, width = self.hw or hw or ()
        return make_camera(self.source, (height, width), self.intrinsics, self.pixel_center, world_from_cam)


def lens_for(folder: Path, root: Path, camera: CameraOption, names: Sequence[str], advice: str) -> Lens:
    """The option where given, else the first file of these names in the folder, or above it up to the data set's root.

    Raises CameraError with the `advice` where there is none; FileError.
    """
    if isinstance(camera, Camera):
        return Lens("the given camera", (camera.fx, camera.fy, camera.cx, camera.cy), 0.5, camera.hw)
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
    """The intrinsics of any file that `read_camera` takes, whose size may be that of a picture to come; its pose is not used.

    Raises FileError, CameraError.
    """
    fields = read_camera_fields(path)
    hw = fields.size(None) if "width" in fields else None
    return Lens(str(path), intrinsics_in(fields), fields.pixel_center(0.5), hw)


def json_lens(fields: FileFields) -> Lens:
    """The fields `width`, `height`, `K` and `pixel_center` (0.0 where it is missing); raises CameraError."""
    return Lens(str(fields.path), fields.intrinsics("K"), fields.pixel_center(0.0), fields.size(None))


def units_per_metre(fields: FileFields, name: str, default: float | None = None) -> float:
    """1 / a field that holds metres per unit of depth; raises CameraError (no number), FileError (not > 0)."""
    scale = fields.number(name) if default is None or name in fields else default
    if scale <= 0:
        raise FileError(f"{fields.path}: {name} is {scale:g}; metres per unit > 0 are expected")
    return 1 / scale


def register_depth(
    read: Callable[[], Float32Array], depth_lens: Lens, lens: Lens, color_from_depth: Float64Array
) -> Float32Array:
    """Depth moved into the colour camera, at a size at which no cracks open. FileError, CameraError."""
    depth = np.nan_to_num(read(), nan=0.0, posinf=0.0, neginf=0.0)
    source, target = depth_lens.camera(color_from_depth), lens.camera(np.eye(4))
    source = source.resized(depth.shape[1], depth.shape[0])
    factor = min(1.0, source.fx / target.fx, source.fy / target.fy)
    target = target.resized(max(1, round(target.width * factor)), max(1, round(target.height * factor)))
    return warp_depth(depth.astype(np.float32), source, target)


def warp_depth(depth: Float32Array, source: Camera, target: Camera) -> Float32Array:
    """Depth as seen from another camera close by: each reading goes to the pixel it falls into, the nearest wins.

    H x W of the target, 0 where nothing fell. Fit for a target with the shorter focal length, where no cracks open.
    """
    rows, columns = np.nonzero(depth)
    points = unproject(source, columns + 0.5, rows + 0.5, depth[rows, columns])
    y, x, z, inside = project_to_pixels(points, target)
    out = np.full(target.hw, np.inf, np.float32)
    np.minimum.at(out, (y[inside], x[inside]), z[inside].astype(np.float32))
    return np.where(np.isinf(out), np.float32(0), out)
