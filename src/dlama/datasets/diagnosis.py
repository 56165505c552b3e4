"""Paths of inputs in; what is wrong with them, in findings, out: the public function behind `dlama doctor`.

Inputs are read as every verb reads them, once; what the reader refuses is the finding. Checks examine what was read.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from dlama.arguments import check_arguments
from dlama.datasets.dataset_checks import Found, examine_dataset
from dlama.datasets.layouts import is_capture_file
from dlama.datasets.posed.scene_file import is_scene_file
from dlama.errors import FileError, InputError, ShapeError, format_size, system_errors
from dlama.files.cameras import camera_for, read_stereo_calib
from dlama.files.photos.depth import read_photo_depth
from dlama.files.rasters.depth import MILLIMETRES
from dlama.files.rasters.images import SUFFIXES, orientation_of, read_stored
from dlama.files.rasters.masks import read_mask
from dlama.files.rasters.orientation import apply_orientation
from dlama.files.rasters.pictures import read_color
from dlama.files.rasters.turned_pairs import check_mask_fits, doubtful_turn, orientation_difference
from dlama.files.rgbd import read_rgbd
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray, percent
from dlama.perception.depth_scale import describe_depth_source
from dlama.perception.diagnosis.finding import Finding, Observed
from dlama.perception.diagnosis.lens import check_exif, check_lens
from dlama.perception.diagnosis.registration import correlate_edges
from dlama.perception.diagnosis.rgbd_checks import check_terraces, describe_frame, run_checks
from dlama.perception.diagnosis.stereo_pair import check_pair
from dlama.perception.monocular import describe_bars
from dlama.writing.atomic_write import PathLike

LENS = ("camera", "fx", "fy", "cx", "cy", "fov", "pixel_center")
READING = ("depth_scale", "depth_range", "channel", "far", "resize_depth", "radial_depth", "inverse_depth")
MASKING = ("mask_polarity", "soft_mask", "mask_class")
"""Options of `diagnose`, as `read_rgbd` and `read_mask` take them."""
CLEAR_TAG = "clear the tag (exiftool -Orientation= FILE)"
UNTURNED = (0, 1, 2, 3, 4, 5, 8, 7, 6)
"""EXIF orientation -> the one that undoes it."""


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
    resize_depth: Literal["guided", "nearest"] | None = None,
    radial_depth: bool = False,
    inverse_depth: bool = False,
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
        layout: How the data set lies on disk, as in `dlama evaluate`; default: recognised. With it go `camera`,
            `depth_range` and `depth_scale`.
        camera, fx, fy, cx, cy, fov, pixel_center, depth_scale, depth_range, channel, far, resize_depth, radial_depth,
            inverse_depth: As in `read_rgbd`.
        mask_polarity, soft_mask, mask_class: As in `read_mask`.

    Returns:
        Findings of severity "fault" (results would be wrong), "note", and at the end one that is "fine". Inputs that
        cannot be read are one finding: the reader's message.

    Raises:
        InputError: no right picture is given, or an option that does not apply to these inputs.
    """
    given = dict(locals())
    check_arguments(diagnose, given)
    examine, takes = examination_of(Path(first), given)
    defaults = {name: one.default for name, one in inspect.signature(diagnose).parameters.items()}
    for name, value in given.items():
        if name not in takes | {"first"} and value != defaults[name]:
            raise InputError(f"{Path(first)}: `{name}` is {value}; it does not apply to these inputs")
    try:
        found, names, parts = examine()
    except InputError as error:
        return (Finding("reading", "fault", 1.0, error.marked),)
    verdict = "read as" if any(each.severity == "fault" for each in found) else "nothing wrong:"
    return (*found, Finding("understood", "fine", 1.0, f"{names}: {verdict} {', '.join(parts)}"))


def examination_of(place: Path, given: Mapping[str, Any]) -> tuple[Callable[[], Found], set[str]]:
    """How inputs are looked at, by the arguments of `diagnose`: as a data set, a photo, a pair, or a picture and its depth; and
    which of the arguments apply to them. InputError: there is nothing, or a pair without its right picture."""

    def pick(names: Sequence[str]) -> dict[str, Any]:
        return {name: given[name] for name in names}

    second, calib = given["second"], given["calib"]
    if place.is_dir() or (second is None and (is_scene_file(place) or is_capture_file(place))):
        options = pick(("camera", "depth_range", "depth_scale"))
        return partial(examine_dataset, place, given["layout"], options), {"layout", *options}
    if second is None:
        if not place.exists():
            raise InputError(f"{place}: no such file or folder")
        if calib is not None:
            raise InputError(f"{place}: a left picture needs its right one")
        return partial(_examine_photo, place, pick(LENS)), set(LENS)
    if calib is not None:
        return partial(_examine_pair, place, Path(second), calib), {"second", "calib"}
    run = partial(_examine_picture, place, Path(second), given["mask"], pick((*LENS, *READING)), pick(MASKING))
    return run, {"second", "mask", *LENS, *READING, *MASKING}


def _examine_picture(
    image: Path, depth: Path, mask: PathLike | None, reading: Mapping[str, Any], masking: Mapping[str, Any]
) -> Found:
    removed: BoolArray | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what the checks look at, and of turned files, which are findings
        rgbd = read_rgbd(image, depth, **reading)
        if mask is not None:
            removed = read_mask(mask, **masking)
            check_mask_fits(removed, mask, image)
    found, rgbd = check_orientation(rgbd, image, depth)
    if mask is not None and (differs := doubtful_turn(image, mask)):
        found.append(Finding("orientation", "note", 0.5, differs, CLEAR_TAG))
    found += _compare_with_exif(rgbd.camera, image)
    names = image.name, depth.name, "mask" if mask is None else Path(mask).name
    how = reading["inverse_depth"], reading["radial_depth"]
    seen = Observed.of(rgbd, names, removed, _units(depth, reading), *how)
    found += run_checks(seen)
    if reading["resize_depth"] is None:
        found += check_terraces(seen)
    parts = [*describe_frame(rgbd), f"{percent(rgbd.depth == 0)} missing", f"{percent(rgbd.far)} far"]
    parts += [] if removed is None else [f"mask {percent(removed)}"]
    return found, ", ".join(names[: 2 if mask is None else 3]), parts


def _units(depth: Path, reading: Mapping[str, Any]) -> float | None:
    """Numbers of the file that make a metre; None where its range says how it is read."""
    whole = depth.suffix.lower() in SUFFIXES
    return None if reading["depth_range"] else reading["depth_scale"] or (MILLIMETRES if whole else 1.0)


def check_orientation(rgbd: RGBD, image: Path, depth: Path) -> tuple[list[Finding], RGBD]:
    """Where only one of the two files is turned by its tag: a fault, and the frame as it is stored, if their edges fit so."""
    if not doubtful_turn(image, depth):
        return [], rgbd
    turns = [orientation_of(image), orientation_of(depth)]
    color = apply_orientation(rgbd.color, UNTURNED[turns[0]])
    metres = apply_orientation(rgbd.depth, UNTURNED[turns[1]])
    same_size = color.shape[:2] == metres.shape == rgbd.depth.shape
    if same_size and correlate_edges(color, metres) > correlate_edges(rgbd.color, rgbd.depth):
        what = f"{orientation_difference(image, depth)}; picture and depth fit as their pixels are stored"
        return [Finding("orientation", "fault", 0.95, what, CLEAR_TAG)], RGBD(color, metres, rgbd.camera)
    return [Finding("orientation", "note", 0.5, orientation_difference(image, depth), CLEAR_TAG)], rgbd


def _compare_with_exif(camera: Camera, image: Path) -> list[Finding]:
    """The camera that was given, compared with the one that the picture's file tells of."""
    if image.suffix.lower() not in SUFFIXES or read_stored(image).focal_35mm is None or check_lens(camera):
        return []
    return check_exif(camera, camera_for((camera.height, camera.width), image=image)[0])


def _examine_photo(image: Path, lens: Mapping[str, Any]) -> Found:
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always", UserWarning)
        own = read_photo_depth(image)
        if own is None:
            what = f"{image.name}: carries no depth: it is estimated, unless a depth file is given"
            found = [Finding("photo-depth", "note", 1.0, what)]
            if bars := describe_bars(read_color(image)):
                found.append(Finding("bars", "fault", 0.9, f"{image.name}: {bars}", "crop them off"))
            return found, image.name, ["a picture"]
        rgbd = read_rgbd(image, **lens)
    found = check_lens(rgbd.camera)
    found += [Finding("photo-depth", "note", 1.0, " ".join(str(one.message).split())) for one in noted]
    size = format_size(own.about["size"][::-1])
    parts = [*describe_frame(rgbd), f"depth {describe_depth_source(own.about)}, {size}"]
    parts += [f"accuracy {own.about['accuracy']}"] if "accuracy" in own.about else []
    return found, image.name, parts


def _examine_pair(left: Path, right: Path, calib: PathLike) -> Found:
    pictures = read_color(left), read_color(right)
    rig = read_stereo_calib(calib, hw=pictures[0].shape[:2])
    names = f"{left.name}, {right.name}"
    if pictures[0].shape != pictures[1].shape:
        sizes = " and ".join(format_size(each.shape) for each in pictures)
        raise ShapeError(f"{names}: are {sizes}; rectified pictures of one size are expected")
    found = check_lens(rig.left) + check_pair(*pictures, rig.doffs)
    found = [replace(each, what=f"{names}: {each.what}") for each in found]
    parts = [format_size(rig.left.hw), f"{rig.left.fov:.3g} degrees wide"]
    return found, names, [*parts, f"baseline {rig.baseline_m:.3g} m", f"doffs {rig.doffs:.3g} px"]
