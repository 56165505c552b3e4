"""Stereo folders in (Middlebury 2014, or left.png, right.png and calib.json); one SII case each out: the right view from
the left.

Middlebury: `im0.png, im1.png, calib.txt, disp0.pfm` (or `disp0GT.pfm`), optional `disp1.pfm`. Ours: `left.png, right.png`,
`calib.json`, and `disparity.npz` or `disp_left.png` with optional `disp_right.png`. calib.json: `width, height`, `K,
baseline_m, doffs` where the set is metric, `disparity_scale` of 8-bit disparity. Without K the rig is nominal.
Format: vision.middlebury.edu/stereo/data/scenes2014.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from dlama.datasets.frames import Case, Dataset, StereoTruth
from dlama.datasets.text_tables import scene_folders
from dlama.errors import FileError, check_same_size
from dlama.files.cameras import make_rig, read_stereo_calib
from dlama.files.fields import FileFields, read_json_fields
from dlama.files.rasters.depth import read_disparity
from dlama.files.rasters.pictures import read_color_of_camera
from dlama.geometry.camera import StereoRig
from dlama.geometry.projection import known_disparity
from dlama.geometry.rgbd import Float32Array

NOMINAL_BASELINE_M = 0.16
"""Of a rig whose numbers are not known; its focal length is the picture's width, px. Middlebury's own is 0.16 m."""


def looks_like_stereo(root: Path) -> bool:
    """True where a folder holds a left and a right picture."""
    return any((root / left).is_file() and (root / right).is_file() for left, right, *_ in _KINDS)


_KINDS = (
    ("im0.png", "im1.png", "calib.txt", ("disp0.pfm", "disp0GT.pfm"), ("disp1.pfm", "disp1GT.pfm")),
    ("left.png", "right.png", "calib.json", ("disparity.npz", "disp_left.png"), ("disp_right.png",)),
)
"""Pictures, calibration, and the disparities of the left and of the right view."""


def stereo_folder(root: Path) -> Dataset:
    """One case per pair; `root` is a pair's folder or holds several. No frames: most sets have no metric depth.

    Raises FileError.
    """
    name = root.resolve().name
    folders = scene_folders(root, looks_like_stereo, "im0.png and im1.png, or left.png and right.png")
    loads = {scene: partial(load_stereo, *_files(folder)) for scene, folder in folders.items()}
    cases = tuple(Case("sii", name, scene, "left_to_right", load) for scene, load in loads.items())
    return Dataset(name, "stereo", root, (), cases)


def _files(folder: Path) -> tuple[Path, Path, Path, Path, Path | None]:
    """The arguments of `load_stereo`."""
    left, right, calib, *kinds = next(names for names in _KINDS if (folder / names[0]).is_file())
    if not (folder / calib).is_file():
        raise FileError(f"{folder / calib}: no such file; a stereo folder needs it next to {left}")
    truth, other = (next((folder / name for name in names if (folder / name).is_file()), None) for names in kinds)
    if truth is None:
        raise FileError(f"{folder}: has no true disparity; {' or '.join(kinds[0])} is expected")
    return folder / left, folder / right, folder / calib, truth, other


def load_stereo(
    left: Path, right: Path, calib: Path, disparity_left: Path, disparity_right: Path | None
) -> StereoTruth:
    """Read a pair and its truth; raises FileError, DepthError, CameraError, ShapeError."""
    pair = read_color_of_camera(left), read_color_of_camera(right)
    hw = pair[0].shape[0], pair[0].shape[1]
    check_same_size(f"{right}:", pair[1].shape, "the left picture", hw)
    if calib.suffix == ".txt":
        rig, scale, metric = read_stereo_calib(calib, hw=hw), None, True
    else:
        fields = read_json_fields(calib)
        rig, metric = _rig(fields, hw)
        scale = fields.number("disparity_scale") if "disparity_scale" in fields else None
    disparity = _disparity(disparity_left, scale, rig)
    other = None if disparity_right is None else _disparity(disparity_right, scale, rig)
    return StereoTruth(*pair, rig, disparity, other, metric=metric)


def _disparity(path: Path, scale: float | None, rig: StereoRig) -> Float32Array:
    disparity = read_disparity(path, scale=scale)
    check_same_size(f"{path}:", disparity.shape, "the left picture", rig.left.hw)
    return known_disparity(disparity, rig)


def _rig(fields: FileFields, hw: tuple[int, int]) -> tuple[StereoRig, bool]:
    """The rig of a calib.json, and whether it is metric; first pixel's centre at 0.0 unless the file says otherwise."""
    size = fields.size(hw)
    if "K" not in fields:
        lens = float(hw[1]), float(hw[1]), hw[1] / 2, hw[0] / 2
        return make_rig(fields.path, size, (lens, lens), 0.5, NOMINAL_BASELINE_M), False
    fx, fy, cx, cy = lens = fields.intrinsics("K")
    right = fx, fy, cx + (fields.number("doffs") if "doffs" in fields else 0.0), cy
    return make_rig(fields.path, size, (lens, right), fields.pixel_center(0.0), fields.number("baseline_m")), True
