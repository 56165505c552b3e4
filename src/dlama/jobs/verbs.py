"""The parameters of a job in; what the function of its verb makes of its files, as files in a folder, out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dlama.completion.completion import Completion
from dlama.completion.stereo.stereo import stereo
from dlama.completion.verbs import remove, view, view_pair
from dlama.errors import InputError
from dlama.files.cameras import read_camera
from dlama.files.results.estimated_depth import write_depth
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.jobs.early import check_options
from dlama.jobs.inputs import JobInputs, Parameters, path_of, picture_of, select
from dlama.jobs.job import Job
from dlama.jobs.parameters import METHOD, is_moved, is_pointed
from dlama.jobs.storage import is_address


def run_verb(job: Job, files: Mapping[str, Path], output: Path) -> None:
    """Check the parameters of a job, whose files have local copies (role -> path), and perform it."""
    parameters = {**job.parameters, **files}
    check_job(job.verb, parameters, loaded=job.load is not None)
    this = JobInputs(addresses={role: path for role, path in job.files.items() if is_address(path)})
    perform(this, job.verb, parameters, output, job.load)


def check_job(verb: str, p: Parameters, loaded: bool = False) -> None:
    """InputError where a parameter cannot be, all of them in one message, before anything is computed."""
    removes = verb == "remove" or loaded or "mask" in p or is_pointed(p)
    check_options(p, path_of(p, "left" if verb == "stereo" else "image"), removes, verb == "stereo" and not is_moved(p))


def perform(
    this: JobInputs, verb: str, p: Parameters, output: Path, load: Callable[[], Any] | None = None
) -> Completion | RGBD:
    """Read the inputs of a job, call the function of its verb and write the result, which comes back.

    load: gives the inputs of a job that names no files.
    """
    truth: Any = None
    if load is not None:
        with this.timed("read"):
            truth = load()
    done = PERFORM[verb](this, p, truth)
    if isinstance(done, RGBD):
        write_depth(done, output, inputs=this.inputs, seconds=this.stages)
        return done
    done = replace(done, meta=done.meta | this.about_inputs())
    this.write_completion(done, output, p)
    return done


def _view(this: JobInputs, p: Parameters, truth: Any) -> Completion:
    target = _target(p)
    return view(this.read_source(p) if truth is None else truth, **target, **select(p, METHOD))


def _remove(this: JobInputs, p: Parameters, truth: Any) -> Completion:
    target = _target(p)
    mask = this.read_removed(p, "image", getattr(truth, "mask", None))  # before depth is estimated, which takes longer
    if mask is None:
        raise InputError("no object to remove is given: give `mask=FILE`, `click=X,Y` on the object, or `box=X,Y,W,H`")
    source = this.read_source(p) if truth is None else getattr(truth, "source", truth)
    masks: Any = mask(picture_of(source)) if callable(mask) else mask
    if isinstance(source, Scene):
        masks = {source.middle_number: masks}
    return remove(source, masks, **target, **select(p, METHOD))


def _stereo(this: JobInputs, p: Parameters, truth: Any) -> Completion:
    if truth is None:
        pair, known = this.read_pair(p), this.read_disparity_file(p)
        mask = this.read_removed(p, "left")
        right = this.read_mask_file(p, "mask_right", "right") if "mask_right" in p else None
    else:
        pair, known, right = (truth.left, truth.right, truth.rig), None, truth.mask_right
        mask = this.read_removed(p, "left", truth.mask_left)
    options = select(p, ("right_view", "matcher", "max_disparity", "far", *METHOD))
    done = stereo(*pair, disparity=known, mask=mask, mask_right=right, **options)
    return view_pair(done, _target(p), select(p, METHOD)) if is_moved(p) else done


def _depth(this: JobInputs, p: Parameters, truth: Any) -> RGBD:
    return this.read_picture(p) if truth is None else truth


PERFORM: dict[str, Callable[[JobInputs, Parameters, Any], Completion | RGBD]] = {
    "view": _view,
    "remove": _remove,
    "stereo": _stereo,
    "depth": _depth,
}
"""Verb -> reads the inputs, or takes those of a data set, and calls the function of that name."""


def _target(p: Parameters) -> dict[str, Any]:
    target = path_of(p, "to")
    return {"camera": read_camera(target) if target else None, **select(p, ("yaw", "pitch", "pivot", "dolly"))}
