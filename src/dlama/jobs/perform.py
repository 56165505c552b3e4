"""One job in; its results in a folder, and a row that says what came of it, out. Runs in any process.

What computes is imported where it is used: the process that hands out jobs computes nothing, and stays small.
"""

from __future__ import annotations

import json
import re
import socket
import statistics
import time
import traceback
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dlama.errors import DlamaError, InputError
from dlama.files.drafts import DRAFT
from dlama.jobs.early import check_options
from dlama.jobs.inputs import JobInputs, is_pointed, mask_and_pointing, mask_settings
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
)
from dlama.jobs.results.result import JobResult
from dlama.jobs.storage import MARKER, Output, fetch, file_stamp, is_address
from dlama.models.verify import sha256_of
from dlama.workers.memory import peak_mib, reset_peak

HALF_MADE = re.compile(rf"\S*?{re.escape(DRAFT)}[^/]*-job/(?:{re.escape(DRAFT)}[^/]*-)?result\b")
"""The path of a result while it is made; a message names the one that it was to have."""
RESULT = "result"
"""The folder of a result while it is made."""


@dataclass(frozen=True)
class Task:
    """A job, and where its results go."""

    job: Job
    output: Output
    prefix: str = ""
    """Before the id, below OUT: `staged/` where results are packed."""
    attempt: int = 1
    number: int = 0
    """Its place in the list."""


def work(task: Task) -> JobResult:
    """Run a job. Any error of a bad input becomes a failed row; MemoryError is raised, so that the process is replaced."""
    since_reset, started = reset_peak(), time.perf_counter()
    job = task.job
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        try:
            row = _perform(task)
        except MemoryError:
            raise
        except Exception as error:
            row = failed_row(job, error)
            row = replace(row, error=HALF_MADE.sub(lambda _: task.output.of(job.id), row.error))
    return replace(
        row,
        seconds=round(time.perf_counter() - started, 4),
        peak_mib=_round(peak_mib(since_reset)),
        host=socket.gethostname(),
        attempts=task.attempt,
        finished=round(time.time(), 3),
        options_hash=job.options_hash if row.status == "done" else "",
        warnings=tuple(dict.fromkeys(" ".join(str(one.message).split()) for one in caught)),
    )


def failed_row(job: Job, error: Exception) -> JobResult:
    """The row of a job that could not be run."""
    trace = "" if isinstance(error, DlamaError) else "".join(traceback.format_exception(error))
    kind = type(error).__name__
    return JobResult(job.id, "failed", job.verb, kind, " ".join(str(error).split()) or kind, trace=trace)


def died_row(job: Job, how: str, attempts: int) -> JobResult:
    """The row of a job whose process died, `how` in words, as often as it may."""
    line = f"its process ended {attempts} times while it ran ({how})"
    about = {"attempts": attempts, "finished": round(time.time(), 3), "host": socket.gethostname()}
    return JobResult(job.id, "failed", job.verb, "WorkerDied", line, **about)  # type: ignore[arg-type]


def _perform(task: Task) -> JobResult:
    job = task.job
    if job.error:
        raise InputError(job.error)
    if job.verb not in PERFORM:
        raise InputError(f"`verb` is {job.verb!r}; one of {', '.join(PERFORM)} is expected")
    stamps = {
        role: file_stamp(path) for role, path in job.files.items()
    }  # before they are read: a change meanwhile is seen
    with task.output.staging() as folder, fetch(job.files) as files:
        this = JobInputs(addresses={role: path for role, path in job.files.items() if is_address(path)})
        _check(job, files)
        PERFORM[job.verb](this, job, {**job.parameters, **files}, folder / RESULT)
        meta = json.loads((folder / RESULT / MARKER).read_text("utf-8"))
        hashes = {role: one["sha256"] for role, one in meta.get("inputs", {}).items()}
        inputs = {
            role: {"path": job.files[role], "sha256": hashes.get(role) or sha256_of(path), "stamp": stamps[role]}
            for role, path in files.items()
        }
        place = f"{task.prefix}{job.id}"
        task.output.put(folder / RESULT, place)
    figures: dict[str, Any] = {name: _mean(meta.get(name)) for name in ("hole_share", "depth_only_share")}
    figures |= {name: meta.get(name) for name in ("law_moves", "law_violations")}
    return JobResult(job.id, "done", job.verb, folder=place, seconds_by_stage=meta["seconds"], inputs=inputs, **figures)


def _view(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    from dlama.completion.verbs import view

    rgbd = job.load() if job.load else _picture(this, p)
    this.write_completion(view(rgbd, **_target(p), **_method(p)), output, **_select(p, RESULTS))


def _remove(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    from dlama.completion.verbs import remove

    truth: Any = job.load() if job.load else None
    rgbd = _picture(this, p) if truth is None else getattr(truth, "source", truth)
    if _is_pointed(p):
        mask = _find_pointed(this, p, rgbd, Path(p.get("image", "")))
    elif hasattr(truth, "mask"):
        this.removed = mask = truth.mask
    elif "mask" in p:
        mask = this.read_mask_file(Path(p["mask"]), _select(p, MASKING), _path(p, "image"))
    else:
        raise InputError("no object to remove is given: give `mask=FILE`, `click`, `box` or `salient`")
    this.write_completion(remove(rgbd, mask, **_target(p), **_method(p)), output, **_select(p, RESULTS))


def _stereo(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    from dlama.completion.stereo.stereo import stereo

    options: Any = _select(p, ("right_view", "matcher", "max_disparity", "far"))
    if job.load:
        truth = job.load()
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
    done = stereo(left, right, rig, disparity=known, mask=masks[0], mask_right=masks[1], **options, **_method(p))
    this.write_completion(done, output, **_select(p, RESULTS))


def _depth(this: JobInputs, job: Job, p: Mapping[str, Any], output: Path) -> None:
    from dlama.files.results.estimated_depth import write_depth

    rgbd = job.load() if job.load else _picture(this, p)
    write_depth(rgbd, output, inputs=this.inputs, seconds={"read": round(this.read_seconds, 4)})


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
    given = {**p, **(mask_settings(**pointing) if pointing else {})}
    check_options(given, None if image is None else Path(image), removes)


def _picture(this: JobInputs, p: Mapping[str, Any]) -> Any:
    options = _select(p, READING) | _select(p, ESTIMATING)
    return this.read_picture(Path(p["image"]), _path(p, "depth"), _select(p, LENS), options)


def _target(p: Mapping[str, Any]) -> dict[str, Any]:
    from dlama.files.cameras import read_camera

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
    object_class = options.pop("object_class", None)
    return this.find_pointed(rgbd, image, mask_settings(**options), object_class)


def _select(p: Mapping[str, Any], names: Any) -> dict[str, Any]:
    """Those of these parameters that were given; network files as paths."""
    found = {name: p[name] for name in names if name in p}
    return {name: _network(value) if name in NETWORKS else value for name, value in found.items()}


def _network(value: str) -> str | Path:
    return Path(value) if Path(value).is_file() else value


def _path(p: Mapping[str, Any], name: str) -> Path | None:
    return Path(p[name]) if name in p else None


def _mean(values: list[float] | None) -> float | None:
    return round(statistics.fmean(values), 6) if values else None


def _round(value: float | None) -> float | None:
    return None if value is None else round(value, 1)
