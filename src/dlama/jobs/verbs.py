"""A job and local copies of its files in; what the function of its verb makes of them, as files in a folder, out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from dlama.completion.stereo.stereo import stereo
from dlama.completion.verbs import remove, view
from dlama.errors import InputError
from dlama.files.cameras import read_camera
from dlama.files.results.estimated_depth import write_depth
from dlama.jobs.early import check_options
from dlama.jobs.inputs import JobInputs
from dlama.jobs.job import Job
from dlama.jobs.parameters import (
    ESTIMATING,
    LENS,
    MASKING,
    METHOD,
    NETWORKS,
    POINTING,
    READING,
    RESULTS,
    is_pointed,
    mask_and_pointing,
    mask_settings,
)
from dlama.jobs.storage import is_address


def run_verb(job: Job, files: Mapping[str, Path], output: Path) -> None:
    """Check the options of a job, read its inputs (role -> local copy), call the function of its verb and write to `output`."""
    this = JobInputs(addresses={role: path for role, path in job.files.items() if is_address(path)})
    _check(job, files)
    PERFORM[job.verb](this, job, {**job.parameters, **files}, output)


def _load(this: JobInputs, job: Job) -> Any:
    assert job.load is not None
    with this.timed("read"):
        return job.load()


def _view(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    rgbd = _load(this, job) if job.load else _picture(this, p)
    this.write_completion(view(rgbd, **_target(p), **_method(p)), output, **_select(p, RESULTS))


def _remove(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    truth: Any = _load(this, job) if job.load else None
    rgbd = _picture(this, p) if truth is None else getattr(truth, "source", truth)
    if _is_pointed(p):
        mask = _find_pointed(this, p, rgbd, Path(p.get("image", "")))
    elif hasattr(truth, "mask"):
        this.removed = mask = truth.mask
    elif "mask" in p:
        mask = this.read_mask_file(Path(p["mask"]), _select(p, MASKING), _path(p, "image"))
    else:
        raise InputError("no object to remove is given: give `mask=FILE`, `click`, `box` or `salient`")
    if not _is_pointed(p):
        mask = this.add_shadow(rgbd, mask, p.get("with_shadow", False))
    this.write_completion(remove(rgbd, mask, **_target(p), **_method(p)), output, **_select(p, RESULTS))


def _stereo(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    options: Any = _select(p, ("right_view", "matcher", "max_disparity", "far"))
    if job.load:
        truth = _load(this, job)
        left, right, rig, known = truth.left, truth.right, truth.rig, None
        masks: list[Any] = [truth.mask_left, truth.mask_right]
        this.removed = truth.mask_left
    else:
        left, right, rig = this.pair(Path(p["left"]), Path(p["right"]), Path(p["calib"]))
        known = this.optional_disparity(_path(p, "disparity"), p.get("disparity_scale"))
        masks = [
            None if role not in p else this.read_mask_file(Path(p[role]), _select(p, MASKING), _path(p, side), role)
            for role, side in (("mask", "left"), ("mask_right", "right"))
        ]
    if _is_pointed(p):
        masks[0] = lambda rgbd: _find_pointed(this, p, rgbd, Path(p.get("left", "")))
    elif masks[0] is not None and p.get("with_shadow"):
        masks[0] = partial(this.add_shadow, mask=masks[0], with_shadow=True)
    done = stereo(left, right, rig, disparity=known, mask=masks[0], mask_right=masks[1], **options, **_method(p))
    this.write_completion(done, output, **_select(p, RESULTS))


def _depth(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    rgbd = _load(this, job) if job.load else _picture(this, p)
    write_depth(rgbd, output, inputs=this.inputs, seconds=this.stages)


PERFORM: dict[str, Callable[[JobInputs, Job, Mapping[str, Any], Path], None]] = {
    "view": _view,
    "remove": _remove,
    "stereo": _stereo,
    "depth": _depth,
}
"""Verb -> reads the inputs, calls the function of that name, and writes."""


def _check(job: Job, files: Mapping[str, Any]) -> None:
    """InputError where an option cannot be, before anything is computed."""
    p = job.parameters
    pointing = {name: value for name, value in _select(p, POINTING).items() if name != "object_class"}
    image = files.get("image", files.get("left"))
    removes = job.verb == "remove" or job.load is not None or "mask" in p or is_pointed(p)
    given = {**p, **(mask_settings(pointing) if pointing else {})}
    check_options(given, None if image is None else Path(image), removes, job.verb == "stereo")


def _picture(this: JobInputs, p: Mapping[str, Any]) -> Any:
    options = _select(p, READING) | _select(p, ESTIMATING)
    return this.read_picture(Path(p["image"]), _path(p, "depth"), _select(p, LENS), options)


def _target(p: Mapping[str, Any]) -> dict[str, Any]:
    target = _path(p, "to")
    return {"camera": read_camera(target) if target else None, **_select(p, ("yaw", "pitch", "pivot", "dolly"))}


def _method(p: Mapping[str, Any]) -> dict[str, Any]:
    return _select(p, METHOD)


def _is_pointed(p: Mapping[str, Any]) -> bool:
    """Whether an object is pointed at. InputError: and there is a mask file too."""
    if not is_pointed(p):
        return False
    if "mask" in p:
        raise mask_and_pointing(p["mask"])
    return True


def _find_pointed(this: JobInputs, p: Mapping[str, Any], rgbd: Any, image: Path) -> Any:
    options = _select(p, POINTING)
    return this.find_pointed(rgbd, image, mask_settings(options), options.get("object_class"))


def _select(p: Mapping[str, Any], names: Any) -> dict[str, Any]:
    """Those of these parameters that were given; network files as paths."""
    found = {name: p[name] for name in names if name in p}
    return {name: Path(value) if name in NETWORKS and Path(value).is_file() else value for name, value in found.items()}


def _path(p: Mapping[str, Any], name: str) -> Path | None:
    return Path(p[name]) if name in p else None
