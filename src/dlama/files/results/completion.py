"""A Completion in; a directory of files out: pictures, depth, scene and meta.json; whole, or not at all."""

from __future__ import annotations

import json
import logging
import platform
import re
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from dlama import __version__
from dlama.completion.completion import Completion, StereoCompletion
from dlama.errors import InputError, OutputError, system_errors
from dlama.files.atomic_write import PathLike, new_directory
from dlama.files.cameras import camera_as_json
from dlama.files.rasters import depth, pictures
from dlama.files.results.preview import write_preview
from dlama.files.scenes import clouds, textured_mesh
from dlama.files.scenes import scene_npz as scenes
from dlama.geometry.figures.false_color import CHOICE_PALETTE, HOLE_PALETTE, ORIGIN_PALETTE
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.view import HoleType, Origin, View
from dlama.models.verify import sha256_of

LOG = logging.getLogger("dlama")

Job = Callable[[], Any]

RESULTS: dict[str, tuple[str, ...]] = {
    "image": ("image.png",),
    "depth": ("depth.png", "depth.exr"),
    "hole": ("hole.png", "hole_type.png"),
    "origin": ("origin.png",),
    "confidence": ("confidence.png",),
    "disparity": ("disparity_left.pfm", "disparity_right.pfm"),
    "points": ("scene.ply", "background.ply", "completed.ply"),
    "mesh": ("scene.glb",),
    "scene": ("scene.npz",),
    "preview": ("preview.png",),
    "choice": ("choice.png",),
}
"""What `write` can be asked for by name -> its files, where the completion has them; meta.json is always written."""
ON_REQUEST = ("choice",)
"""Those that are written only where they are named."""


@system_errors(OutputError)
def write(
    completion: Completion,
    directory: PathLike,
    *,
    only: Sequence[str] | None = None,
    inputs: Mapping[str, PathLike] | None = None,
    intrinsics_from: str = "given in Python",
    seconds: Mapping[str, float] | None = None,
    input_addresses: Mapping[str, str] | None = None,
) -> Path:
    """Write a completion to a directory (made if need be) and return it. If anything fails nothing is left behind.

    One view: its pictures lie at the top. A stereo pair: the left view at the top, the right one in `right/`. Several views:
    `view-01/`, `view-02/`, ..., and the last one at the top.

    Args:
        completion: What `view`, `remove`, `stereo` or `complete` gave.
        directory: Files of the same names in it are replaced, all others stay.
        only: Of "image", "depth", "hole", "origin", "confidence", "disparity" (of pairs), "points", "mesh", "scene", "preview"
            and "choice"; None: all but "choice". meta.json is always written.
        inputs: Role -> file; path and SHA-256 of each go into meta.json.
        intrinsics_from: In words, where the source camera's intrinsics come from.
        seconds: Stages before the completion, such as reading, for meta.json.
        input_addresses: Role -> what meta.json says in place of the path, of inputs that were fetched from elsewhere.

    Raises:
        InputError: a name in `only` that is not known.
        OutputError: the directory cannot be written, or a result would replace one of `inputs`.
        FileError: an input cannot be read.
    """
    names = checked_results(only)
    target, started = Path(directory), time.perf_counter()
    check_inputs_stay(target, file_names(completion, names), inputs or {})
    meta = {**described(completion, intrinsics_from), "inputs": hashed(inputs or {}, input_addresses or {})}
    with new_directory(target) as folder:
        jobs = scene_jobs(folder, completion)  # the longest first, so that both threads end together
        for place, view in places(completion).items():
            jobs |= view_jobs(folder / place, view, place, choice_of(completion, view))
        jobs["preview.png"] = lambda: write_preview(folder / "preview.png", completion)
        wanted = {file for name in names for file in RESULTS[name]}
        jobs = {file: job for file, job in jobs.items() if file.rpartition("/")[2] in wanted}
        for file in jobs:
            (folder / file).parent.mkdir(exist_ok=True)
        results = run(jobs)
        if "depth" in names:
            clipped = {place: results[f"{place}depth.png"] for place in places(completion)}
            meta["depth_png_clipped_pixels"] = clipped if len(clipped) > 1 else clipped[""]
        took = {**(seconds or {}), **meta["seconds"], "write": time.perf_counter() - started}
        meta["seconds"] = {stage: round(value, 4) for stage, value in took.items()}
        (folder / "meta.json").write_text(as_json(meta), encoding="utf-8")
    return target


def file_names(completion: Completion, only: Sequence[str] | None = None) -> list[str]:
    """The files that `write` makes of a completion, relative to its directory, sorted. Raises InputError as `write` does."""
    wanted = {file for name in checked_results(only) for file in RESULTS[name]}
    jobs = [*scene_jobs(Path(), completion), "preview.png", *(["background.ply"] if completion.scene.objects else [])]
    for place, view in places(completion).items():
        jobs += view_jobs(Path(), view, place, choice_of(completion, view))
    return sorted(["meta.json", *(file for file in jobs if file.rpartition("/")[2] in wanted)])


def check_inputs_stay(directory: Path, files: Sequence[str], inputs: Mapping[str, PathLike]) -> None:
    """Raise OutputError where one of the files to be written to a directory is an input of the same run, by any path or link."""
    for name in files:
        place = directory / name
        for role, path in inputs.items():
            if place.exists() and place.samefile(path):
                raise OutputError(
                    f"{place}: is the {role} that was read, the result of this name would replace it; give another directory"
                )


def checked_results(only: Sequence[str] | None) -> tuple[str, ...]:
    """The names of what is to be written: for None all of RESULTS but those ON_REQUEST.

    Raises InputError: an unknown name, or none at all.
    """
    default = tuple(name for name in RESULTS if name not in ON_REQUEST)
    names = default if only is None else (only,) if isinstance(only, str) else tuple(only)
    for name in names:
        if name not in RESULTS:
            raise InputError(f"only is {name!r}; names of {', '.join(RESULTS)} are wanted")
    if not names:
        raise InputError(f"only is empty; names of {', '.join(RESULTS)} are wanted")
    return names


def places(completion: Completion) -> dict[str, View]:
    """Sub-folder ("" = the top) -> the completed view that is written there."""
    views = completion.views
    if isinstance(completion, StereoCompletion):
        return {"": views[0], "right/": views[1]}
    if len(views) == 1:
        return {"": views[0]}
    return {"": completion.view, **{f"view-{number:02d}/": view for number, view in enumerate(views, 1)}}


def main_view(completion: Completion) -> View:
    """The view at the top of the directory: the left one of a pair, else the last."""
    return places(completion)[""]


def choice_of(completion: Completion, view: View) -> UInt8Array | None:
    """Which guess counts most in each pixel of a view of the completion; None where its filler does not choose."""
    found = [choice for one, choice in zip(completion.views, completion.choices) if one is view]
    return found[0] if found else None


def view_jobs(folder: Path, view: View, place: str, choice: UInt8Array | None) -> dict[str, Job]:
    """The pictures of one view."""
    jobs: dict[str, Job] = {
        "image.png": lambda: pictures.write_color(folder / "image.png", view.color),
        "depth.png": lambda: depth.write_depth_png(folder / "depth.png", view.depth),
        "depth.exr": lambda: depth.write_depth_exr(folder / "depth.exr", view.depth),
        "hole.png": lambda: pictures.write_mask(folder / "hole.png", view.hole_type > 0),
        "hole_type.png": lambda: pictures.write_codes(folder / "hole_type.png", view.hole_type, HOLE_PALETTE),
        "origin.png": lambda: pictures.write_codes(folder / "origin.png", view.origin, ORIGIN_PALETTE),
        "confidence.png": lambda: pictures.write_grey(folder / "confidence.png", view.confidence),
    }
    if choice is not None:
        jobs["choice.png"] = lambda: pictures.write_codes(folder / "choice.png", choice, CHOICE_PALETTE)
    return {f"{place}{name}": job for name, job in jobs.items()}


def scene_jobs(folder: Path, completion: Completion) -> dict[str, Job]:
    """The scene as arrays, points (without removed objects, and with them) and triangles, and a pair's disparities."""

    def points() -> None:
        clouds.write_ply(folder / "scene.ply", completion.background)
        if completion.scene.objects:
            shutil.copyfile(folder / "scene.ply", folder / "background.ply")

    jobs: dict[str, Job] = {
        "scene.glb": lambda: textured_mesh.write_textured_glb(folder / "scene.glb", completion.scene),
        "scene.ply": points,
        "scene.npz": lambda: scenes.write_npz(folder / "scene.npz", main_view(completion), completion.scene),
    }
    if completion.scene.objects:
        jobs["completed.ply"] = lambda: clouds.write_ply(folder / "completed.ply", completion.completed)
    if isinstance(completion, StereoCompletion):
        jobs["disparity_left.pfm"] = lambda: depth.write_disparity_pfm(
            folder / "disparity_left.pfm", completion.disparity_left
        )
        jobs["disparity_right.pfm"] = lambda: depth.write_disparity_pfm(
            folder / "disparity_right.pfm", completion.disparity_right
        )
    return jobs


def run(jobs: Mapping[str, Job]) -> dict[str, Any]:
    """What each job returns, two at a time (encoders let go of the interpreter); the first error is raised."""

    def one(item: tuple[str, Job]) -> tuple[str, Any]:
        LOG.info("write %s", item[0])
        return item[0], item[1]()

    with ThreadPoolExecutor(2) as pool:
        return dict(pool.map(one, jobs.items()))


def described(completion: Completion, intrinsics_from: str) -> dict[str, Any]:
    """The head of meta.json: where the views stand, what their codes mean, which versions made them."""
    return {
        "dlama": __version__,
        "source_camera": {**camera_as_json(completion.source.camera), "intrinsics_from": intrinsics_from},
        "cameras": [camera_as_json(view.camera) for view in completion.views],
        **completion.meta,
        "legends": legends(),
        "versions": versions(),
    }


def legends() -> dict[str, dict[str, Any]]:
    """What the codes of the code pictures mean and how they are coloured."""
    return {
        "hole_type.png": {str(int(code)): [code.name.lower(), list(HOLE_PALETTE[code])] for code in HoleType},
        "origin.png": {str(int(code)): [code.name.lower(), list(ORIGIN_PALETTE[code])] for code in Origin},
        "hole.png": {"0": "known", "255": "unknown before filling, after dilation: every pixel that was written"},
        "depth.png": {"0": "missing", "1..65534": "millimetres", "65535": "far (sky)"},
        "scene.glb": {"colour": "texture, sRGB, unlit", "far": "sky has no triangles; scene.npz has it"},
        "depth.exr": {"0": "missing", "inf": "far (sky)", "else": "metres"},
    }


def versions() -> dict[str, str]:
    """Versions of what computes the result; a package that is not installed is left out."""
    found = {"dlama": __version__, "python": platform.python_version()}
    for name in ("numpy", "numba", "opencv-python-headless", "opencv-python", "pillow", "OpenEXR"):
        try:
            found[name.split("-python")[0]] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def hashed(inputs: Mapping[str, PathLike], addresses: Mapping[str, str] | None = None) -> dict[str, dict[str, str]]:
    """Role -> path (or its address) and SHA-256 of each input file. Raises FileError."""
    named = {role: (addresses or {}).get(role, str(path)) for role, path in inputs.items()}
    return {role: {"path": named[role], "sha256": sha256_of(Path(path))} for role, path in inputs.items()}


def as_json(meta: Mapping[str, Any]) -> str:
    """Indented JSON with rows of numbers on one line each."""
    text = json.dumps(json_ready(dict(meta)), indent=2, allow_nan=False)
    rows = re.compile(r"\[\n\s+([^\[\]{}]*?)\n\s+\]")
    return rows.sub(lambda row: "[" + re.sub(r"\s*\n\s*", " ", row[1]) + "]", text) + "\n"


def json_ready(value: Any) -> Any:
    """NumPy numbers and arrays, and not-a-numbers, as JSON can hold them."""
    if isinstance(value, dict):
        return {str(key): json_ready(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(one) for one in value]
    if isinstance(value, np.ndarray):
        return json_ready(value.tolist())
    if isinstance(value, np.generic):
        return json_ready(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
