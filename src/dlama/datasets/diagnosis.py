"""Paths of inputs in; what is wrong with them, in findings, out: the public function behind `dlama doctor`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from dlama.arguments import check_arguments, check_number
from dlama.datasets.dataset_diagnosis import diagnose_dataset
from dlama.datasets.layouts import is_capture_file
from dlama.datasets.posed.scene_file import is_scene_file
from dlama.errors import FileError, InputError, system_errors
from dlama.files.atomic_write import PathLike
from dlama.files.diagnosis import DepthOptions, diagnose_pair, diagnose_photo, diagnose_rgbd
from dlama.geometry.camera import Camera
from dlama.perception.diagnosis.finding import Finding

DEFAULTS = {"pixel_center": 0.5, "mask_polarity": "fill", "soft_mask": False}
"""Of options of `diagnose` that are not None."""


@system_errors(FileError)
def diagnose(
    first: PathLike,
    second: PathLike | None = None,
    mask: PathLike | None = None,
    *,
    calib: PathLike | None = None,
    layout: str | None = None,
    camera: PathLike | Camera | None = None,
    fx: float | None = None,
    fy: float | None = None,
    cx: float | None = None,
    cy: float | None = None,
    fov: float | None = None,
    pixel_center: float = 0.5,
    depth_scale: float | None = None,
    depth_range: float | None = None,
    channel: str | None = None,
    far: float | None = None,
    resize_depth: Literal["nearest"] | None = None,
    mask_polarity: Literal["fill", "known"] = "fill",
    soft_mask: bool = False,
    mask_class: str | None = None,
) -> tuple[Finding, ...]:
    """What is wrong with inputs, with what confidence, and the option that mends it; the last finding says what was understood.

    Args:
        first: A picture; or, with `calib`, the left one of a stereo pair; or the folder of a data set, or a scene.npz.
        second: The picture's depth, or the right picture; without it, the depth that a photo's file carries is looked at.
        mask: What is to be removed from the picture.
        calib: The calibration of a stereo pair.
        layout: How the data set lies on disk, as in `dlama evaluate`; default: recognised. It also takes `camera`.
        camera, fx, fy, cx, cy, fov, pixel_center, depth_scale, depth_range, channel, far, resize_depth: As in `read_rgbd`.
        mask_polarity, soft_mask, mask_class: As in `read_mask`.

    Returns:
        Findings of severity "fault" (results would be wrong), "note", and at the end one that is "fine". A file that
        cannot be read is a finding, too.

    Raises:
        InputError: no right picture is given, or an option that does not apply to these inputs.
    """
    check_arguments(diagnose, locals())
    intrinsics = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "fov": fov, "pixel_center": pixel_center}
    for name, value in (intrinsics | {"depth_scale": depth_scale, "depth_range": depth_range, "far": far}).items():
        check_number(value, name)
    reading = DepthOptions(depth_scale, depth_range, channel, far, resize_depth)
    masking = {"mask_polarity": mask_polarity, "soft_mask": soft_mask, "mask_class": mask_class}
    of_picture = intrinsics | vars(reading) | masking
    if Path(first).is_dir() or (second is None and (is_scene_file(Path(first)) or is_capture_file(Path(first)))):
        _refuse(first, {"second": second, "mask": mask, "calib": calib, **of_picture})
        return tuple(diagnose_dataset(Path(first), layout, camera))
    if second is None and not Path(first).exists():
        raise InputError(f"{Path(first)}: no such file or folder")
    if second is None and calib is not None:
        raise InputError(f"{Path(first)}: a left picture needs its right one")
    if second is None:
        _refuse(first, {"mask": mask, "layout": layout, **vars(reading), **masking})
        return tuple(diagnose_photo(first, {"camera": camera, **intrinsics}))
    if calib is not None:
        _refuse(first, {"mask": mask, "layout": layout, "camera": camera, **of_picture})
        return tuple(diagnose_pair(first, second, calib))
    _refuse(first, {"layout": layout})
    lens = {"camera": camera, **intrinsics}
    return tuple(diagnose_rgbd(first, second, mask, lens_options=lens, depth_options=reading, mask_options=masking))


def _refuse(first: PathLike, others: Mapping[str, Any]) -> None:
    for name, value in others.items():
        if value is not None and value != DEFAULTS.get(name):
            raise InputError(f"{Path(first)}: `{name}` is {value}; it does not apply to these inputs")
