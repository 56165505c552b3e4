"""Uploaded files and the fields next to them in; an RGB-D picture or a stereo pair, and what was found in them, out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import dlama
from dlama.files.camera_yaml import read_yaml_pair
from dlama.files.cameras import read_camera_fields
from dlama.files.fields import intrinsics_in, read_calib_txt, read_json_fields
from dlama.files.rasters.images import SUFFIXES, picture_hw
from dlama.geometry.rgbd import RGBD, UInt8Array, describe_depth_range, percent
from dlama.jobs.inputs import JobInputs
from dlama.jobs.parameters import number
from dlama.perception.depth_scale import RULES, describe_depth_source
from dlama.web.answers import Fields, PageError, use_page_words
from dlama.web.form import read_form

ROLES: dict[str, tuple[str, ...]] = {
    "picture": SUFFIXES,
    "depth": (".png", ".tif", ".tiff", ".pgm", ".exr", ".pfm", ".npy", ".npz", ".pcd"),
    "camera": (".json", ".txt", ".yaml", ".yml", ".xml"),
    "right": SUFFIXES,
    "calib": (".txt", ".json", ".yaml", ".yml", ".xml"),
}
"""What a visitor can hand in -> the endings its file may have."""
LONGEST_NAME = 80


@dataclass(frozen=True)
class Upload:
    """A file that a visitor handed in."""

    name: str
    """What the visitor calls it: shown, and written into commands; never opened."""
    path: Path
    """Where it lies meanwhile: the visit's folder, the role and a known ending."""


@dataclass(frozen=True, eq=False)
class Source:
    """What was read."""

    rgbd: RGBD
    """The picture with its depth; of a pair the left one, with the depth that matching gives."""
    options: Mapping[str, Any]
    """Keyword arguments of `read_rgbd` that differ from its defaults."""
    job: JobInputs
    """Which files were read, and where the lens comes from."""
    facts: Mapping[str, str]
    """Field of the page -> what was found, in words."""
    pair: tuple[UInt8Array, UInt8Array, dlama.StereoRig] | None = None
    """Left, right and their cameras, of a stereo pair."""
    files: Mapping[str, Upload] = field(default_factory=dict)


def names_of(files: Mapping[str, Upload]) -> dict[Path, str]:
    """Our path of each upload -> the visitor's name of it."""
    return {upload.path: upload.name for upload in files.values()}


def file_name(name: str, role: str, taken: Mapping[str, Upload]) -> tuple[str, str]:
    """A visitor's name without folders and odd signs, of a role and unlike those of other roles, and its ending.

    PageError: an ending that the role does not take.
    """
    last = PureWindowsPath(PurePosixPath(name).name).name
    clean = re.sub(r"[^\w.()+ -]", "_", last).strip(". -") or role
    suffix = Path(clean).suffix.lower()
    if role not in ROLES:
        raise PageError(f"{role[:20]!r} is no file that this page takes; one of {', '.join(ROLES)} is expected")
    if suffix not in ROLES[role]:
        raise PageError(f"{clean}: ends in {suffix or 'nothing'}; one of {' '.join(ROLES[role])} is expected", role)
    clean = clean[: -len(suffix)][: LONGEST_NAME - len(suffix)] + clean[-len(suffix) :]
    while clean in {upload.name for other, upload in taken.items() if other != role}:
        clean = f"{role}-{clean}"
    return clean, suffix


def check_upload(upload: Upload, most_pixels: int, role: str) -> None:
    """Raise InputError where a camera's file is none, PageError where a picture says that it is larger than this page takes."""
    if role in ("camera", "calib"):
        check_lens_file(upload.path, role)
    elif upload.path.suffix in SUFFIXES:
        height, width = picture_hw(upload.path)
        if height * width > most_pixels:
            raise PageError(
                f"{upload.name}: is {width}x{height} pixels; this page takes up to {most_pixels / 1e6:.0f} million, "
                "scale it down or use the command line",
                role,
            )


def check_lens_file(path: Path, role: str) -> None:
    """Raise InputError where a file holds no camera, or nothing like a calibration; its size may be that of a picture to come."""
    if role == "camera":
        intrinsics_in(read_camera_fields(path))
    elif path.suffix == ".txt":
        read_calib_txt(path)
    elif path.suffix == ".json":
        read_json_fields(path)
    else:
        read_yaml_pair(path)


def read_source(files: Mapping[str, Upload], fields: Mapping[str, Any]) -> Source:
    """What the files of a visit hold. InputError."""
    if "picture" not in files:
        raise PageError("a picture is expected", "picture")
    return read_pair(files, fields) if "right" in files or "calib" in files else read_picture(files, fields)


def read_picture(files: Mapping[str, Upload], fields: Mapping[str, Any]) -> Source:
    """A picture with its depth file, or with estimated depth."""
    options = read_form(fields, "lens", "estimate", *(["depth"] if "depth" in files else []))
    job = JobInputs()
    used = {role: files[role] for role in ("picture", "depth", "camera") if role in files}
    paths = {"image" if role == "picture" else role: upload.path for role, upload in used.items()}
    rgbd = job.read_picture(options | paths)
    return Source(rgbd, options, job, facts_of(rgbd, options, job.intrinsics_from, used), files=used)


def read_pair(files: Mapping[str, Upload], fields: Mapping[str, Any]) -> Source:
    """A rectified stereo pair, matched once so that its left picture has depth to click on."""
    for role, what in (("right", "the right picture"), ("calib", "the calibration, calib.txt, JSON or YAML,")):
        if role not in files:
            depth = "; where a picture is depth, say so under “Choose file by file”" if role == "calib" else ""
            raise PageError(f"{what} of the stereo pair is expected{depth}", role)
    job = JobInputs()
    used = {role: files[role] for role in ("picture", "right", "calib")}
    paths = {"left" if role == "picture" else role: upload.path for role, upload in used.items()}
    left, right, rig = job.read_pair(paths)
    view = dlama.stereo(left, right, rig).views[0]
    rgbd = RGBD(left, view.depth, rig.left)
    facts = facts_of(rgbd, {}, job.intrinsics_from, used) | {"calib": f"baseline {rig.baseline_m:.4g} m"}
    return Source(rgbd, {}, job, facts, (left, right, rig), used)


def facts_of(rgbd: RGBD, options: Mapping[str, Any], lens_from: str, files: Mapping[str, Upload]) -> dict[str, str]:
    """Field of the page -> what was found there, in words."""
    width, height = rgbd.camera.wh
    lens = lens_from if lens_from == "assumed" else f"from {lens_from}"
    facts = {
        "picture": f"{width} x {height} pixels",
        "camera": f"{rgbd.camera.fov:.1f}° wide, fx {rgbd.camera.fx:.1f} px, {lens}",
        "depth": f"{describe_depth_range(rgbd.depth)}, {percent(rgbd.missing)} missing, {percent(rgbd.far)} sky",
    }
    if rgbd.estimate is not None:
        about = dict(rgbd.estimate)
        facts["depth"] = f"{describe_depth_source(about)}: {describe_depth_range(rgbd.depth)}"
        facts["known"] = use_page_words(RULES[about["scale"]["rule"]])
    elif "depth" in files:
        facts["scale"] = scale_in_words(files["depth"].path.suffix, options)
    return facts


def scale_in_words(suffix: str, options: Mapping[str, Any]) -> str:
    """Which scale a depth file was read with."""
    if "depth_range" in options:
        return f"1.0 is {options['depth_range']:g} m"
    if "depth_scale" in options:
        return f"{options['depth_scale']:g} units per metre, as you chose"
    whole = suffix in (".png", ".tif", ".tiff")
    return "1000 units per metre (millimetres, usual for 16 bits)" if whole else "read as metres"


def pixel_of(fields: Fields) -> tuple[int, int]:
    """Column and row. InputError."""
    return int(number("x", fields.get("x"))), int(number("y", fields.get("y")))
