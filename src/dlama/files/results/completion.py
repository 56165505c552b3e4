"""A Completion in; a directory of files out: pictures, depth, scene and meta.json; whole, or not at all."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from pathlib import Path
from typing import Any

from dlama.arguments import check_arguments
from dlama.completion.completion import Completion, StereoCompletion
from dlama.errors import InputError, OutputError, system_errors, warn
from dlama.files.rasters import depth, masks, pictures
from dlama.files.results.deep_color import deep_color, find_plate
from dlama.files.results.meta_json import describe_completion, hash_inputs, write_meta
from dlama.files.results.preview import write_preview
from dlama.files.scenes import clouds, textured_mesh
from dlama.files.scenes import scene_npz as scenes
from dlama.geometry.codes import Origin
from dlama.geometry.figures.false_color import HOLE_PALETTE, ORIGIN_PALETTE
from dlama.geometry.frames.thinning import thin_scene
from dlama.geometry.holes import check_mask
from dlama.geometry.projection import round_depth
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.view import View
from dlama.models.network_file import make_room
from dlama.progress import Progress, begin_stage, take_progress
from dlama.writing.atomic_write import PathLike, new_directory

Writer = Callable[[Path], Any]
"""Writes one file, whose path it takes."""

RESULTS: dict[str, tuple[str, ...]] = {
    "image": ("image.png",),
    "depth": ("depth.png", "depth.exr"),
    "hole": ("hole.png", "hole_type.png"),
    "origin": ("origin.png",),
    "confidence": ("confidence.png",),
    "disparity": ("disparity_left.pfm", "disparity_right.pfm"),
    "points": ("scene.ply", "completed.ply"),
    "mesh": ("scene.glb",),
    "scene": ("scene.npz",),
    "preview": ("preview.png",),
    "mask": ("mask.png",),
}
"""What `write` can be asked for by name -> its files, where the completion has them; meta.json is always written."""
BY_DEFAULT = ("image", "depth", "origin", "confidence", "mesh", "preview")
"""What is written where nothing is named: what a person opens, and what training reads."""


@take_progress
@system_errors(OutputError)
def write(
    completion: Completion,
    directory: PathLike,
    *,
    only: Sequence[str] | None = None,
    also: Sequence[str] = (),
    inputs: Mapping[str, PathLike] | None = None,
    intrinsics_from: str = "given in Python",
    seconds: Mapping[str, float] | None = None,
    input_addresses: Mapping[str, str] | None = None,
    mask: BoolArray | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a completion to a directory (made if need be) and return it. If anything fails nothing is left behind.

    One view: its pictures lie at the top. A stereo pair: the left view at the top, the right one in `right/`. Several views:
    `view-01/`, `view-02/`, ..., and the last one at the top. No view (`cameras` was empty): the scene's files alone.

    Args:
        completion: What `view`, `remove`, `stereo` or `complete` gave.
        directory: Files of the same names in it are replaced, all others stay; of those of an earlier result a warning says so.
        only: Which of "image", "depth", "hole", "origin", "confidence", "disparity" (of pairs), "points", "mesh", "scene",
            "preview" and "mask"; None: image, depth, origin, confidence, mesh and preview. meta.json is always written.
        also: More of them. "scene" is the file that `read_scene` and `dlama view` read.
        inputs: Role -> file; path and SHA-256 of each go into meta.json. Where "image" (of a pair "left", "right") has 16 bits a
            channel, image.png of its own view has them too, wherever it was measured.
        intrinsics_from: In words, where the source camera's intrinsics come from.
        seconds: Stages before the completion, such as reading, for meta.json.
        input_addresses: Role -> what meta.json says in place of the path, of inputs that were fetched from elsewhere.
        mask: H x W of the removed object, True = removed; what "mask" writes as mask.png.

    Raises:
        InputError: a name in `only` or `also` that is not known, "mask" without one, or one in `only` of what there is none;
            MaskError: that is none of the picture.
        OutputError: the directory cannot be written, or a result would replace one of `inputs`.
        FileError: an input cannot be read.
    """
    check_arguments(write, locals())
    names = check_results(only, also)
    if "mask" in names:
        if mask is None:
            option = "also" if "mask" in also else "only"
            raise InputError(f"`{option}` names mask, and `mask` is not given; bool H x W is expected")
        mask = check_mask(mask, completion.source.camera.hw)
    target, started, inputs = Path(directory), time.perf_counter(), inputs or {}
    files = file_names(completion, names)
    asked = choose_names(only, (), tuple(RESULTS), ())
    if absent := ", ".join(name for name in asked if RESULTS[name][0] not in files):
        raise InputError(
            f"{absent} is to be written, which the completion lacks; disparity is of stereo pairs, pictures are of views"
        )
    check_inputs_stay(target, files, inputs)
    warn_of_earlier_results(target, files)
    meta = {**describe_completion(completion, intrinsics_from), "inputs": hash_inputs(inputs, input_addresses)}
    make_room(main_view(completion).hole.size)
    with new_directory(target) as folder:
        plates = {role: path for role, path in inputs.items() if "bits" in meta["inputs"][role]}
        writers = chosen_writers(completion, names, mask, plates)
        meta |= describe_written(run_writers(writers, folder), names, completion)
        write_meta(folder, meta, seconds or {}, time.perf_counter() - started)
    return target


def describe_written(results: Mapping[str, Any], names: Sequence[str], completion: Completion) -> dict[str, Any]:
    """For meta.json, what the writers returned: clipped pixels of depth.png, bits of image.png; by view where there are more."""
    meta: dict[str, Any] = {}
    for name, field in (("depth", "depth_png_clipped_pixels"), ("image", "image_png_bits")):
        if name in names:
            found = {place: results[f"{place}{name}.png"] for place in views_by_folder(completion)}
            meta[field] = found if len(found) != 1 else found[""]
    return meta


def file_names(completion: Completion, only: Sequence[str] | None = None, also: Sequence[str] = ()) -> list[str]:
    """The files that `write` makes of a completion, relative to its directory, sorted. Raises InputError as `write` does."""
    return sorted(["meta.json", *chosen_writers(completion, check_results(only, also))])


def check_inputs_stay(directory: Path, files: Sequence[str], inputs: Mapping[str, PathLike]) -> None:
    """Raise OutputError where one of the files to be written to a directory is an input of the same run, by any path or link."""
    for name in files:
        place = directory / name
        for role, path in inputs.items():
            if place.exists() and place.samefile(path):
                raise OutputError(
                    f"{place}: is the {role} that was read, the result of this name would replace it; give another directory"
                )


def warn_of_earlier_results(directory: Path, files: Sequence[str]) -> None:
    """Warn (UserWarning) of files in a directory that an earlier result left there and `files` do not replace."""
    known = {name for each in RESULTS.values() for name in each}
    stay = sorted(name for name in known.difference(files) if (directory / name).is_file())
    if stay and (directory / "meta.json").is_file():
        warn(f"{directory}: of an earlier result there is still {', '.join(stay)}")


def check_results(only: Sequence[str] | None, also: Sequence[str] = ()) -> tuple[str, ...]:
    """The names of what is to be written: those of `only` (None: BY_DEFAULT), and those of `also`.

    Raises InputError: an unknown name, or none at all.
    """
    chosen = choose_names(only, also, tuple(RESULTS), BY_DEFAULT)
    if only is not None and not only:
        raise InputError(f"`only` is empty; names of {', '.join(RESULTS)} are expected")
    return chosen


def choose_names(
    only: Sequence[str] | None, also: Sequence[str], known: Sequence[str], default: Sequence[str]
) -> tuple[str, ...]:
    """The names of `only` (None: the default) and of `also`, each once; a string is NAME,NAME, as on the command line.

    InputError: unknown ones.
    """
    chosen, more = (tuple(names.split(",") if isinstance(names, str) else names or ()) for names in (only, also))
    for option, names in (("only", chosen), ("also", more)):
        unknown = [repr(name) for name in names if name not in known]
        if unknown:
            raise InputError(f"`{option}` is {', '.join(unknown)}; names of {', '.join(known)} are expected")
    return tuple(dict.fromkeys((*(default if only is None else chosen), *more)))


def views_by_folder(completion: Completion) -> dict[str, View]:
    """Sub-folder ("" = the top) -> the completed view that is written there."""
    views = completion.views
    if isinstance(completion, StereoCompletion):
        return {"": views[0], "right/": views[1]}
    if len(views) <= 1:
        return dict(zip([""], views))
    return {"": completion.view, **{f"view-{number:02d}/": view for number, view in enumerate(views, 1)}}


def main_view(completion: Completion) -> View:
    """The view at the top of the directory: the left one of a pair, else the last; of a scene alone its first frame."""
    return views_by_folder(completion).get("") or completion.scene.frames[0].load()


def chosen_writers(
    completion: Completion, names: Sequence[str], mask: Any = None, plates: Mapping[str, PathLike] | None = None
) -> dict[str, Writer]:
    """File -> what writes it, of the results in `names`; the longest first, so that both threads end together."""
    writers = scene_writers(completion)
    for place, view in views_by_folder(completion).items():
        of_view = view_writers(view, find_plate(completion, view, place, plates or {}))
        writers |= {f"{place}{name}": writer for name, writer in of_view.items()}
    if completion.views:
        writers["preview.png"] = lambda path: write_preview(path, completion)
    writers["mask.png"] = lambda path: masks.write_mask(path, mask)
    chosen = {file for name in names for file in RESULTS[name]}
    return {file: writer for file, writer in writers.items() if file.rpartition("/")[2] in chosen}


def view_writers(view: View, plate: PathLike | None) -> dict[str, Writer]:
    """The pictures of one view; plate: its file with 16 bits a channel, if it has one."""
    return {
        "image.png": lambda path: write_image(path, view, plate),
        "depth.png": lambda path: depth.write_depth_png(path, view.depth),
        "depth.exr": lambda path: depth.write_depth_exr(
            path,  # what was filled is as round as estimated depth is, and never nearer than it was
            round_depth(view.depth, up=True) if Origin.ESTIMATED in view.origins else view.depth,
        ),
        "hole.png": lambda path: masks.write_mask(path, view.hole_type > 0),
        "hole_type.png": lambda path: pictures.write_codes(path, view.hole_type, HOLE_PALETTE),
        "origin.png": lambda path: pictures.write_codes(path, view.origin, ORIGIN_PALETTE),
        "confidence.png": lambda path: pictures.write_grey(path, view.confidence),
    }


def write_image(path: Path, view: View, plate: PathLike | None) -> int:
    """The colours of a view; the bits a channel that were written. OutputError."""
    if plate is not None and (color := deep_color(view, plate)) is not None:
        pictures.write_deep_color(path, color)
        return 16
    pictures.write_color(path, view.color)
    return 8


def scene_writers(completion: Completion) -> dict[str, Writer]:
    """The scene as arrays, points (without removed objects, and with them) and triangles, and a pair's disparities."""
    writers: dict[str, Writer] = {
        "scene.glb": lambda path: textured_mesh.write_textured_glb(path, thin_scene(completion.scene)),
        "scene.ply": lambda path: clouds.write_ply(path, completion.background),
        "scene.npz": lambda path: scenes.write_npz(path, main_view(completion), completion.scene),
    }
    if completion.scene.removals:
        writers["completed.ply"] = lambda path: clouds.write_ply(path, completion.completed)
    if isinstance(completion, StereoCompletion):
        writers["disparity_left.pfm"] = lambda path: depth.write_disparity_pfm(path, completion.disparity_left)
        writers["disparity_right.pfm"] = lambda path: depth.write_disparity_pfm(path, completion.disparity_right)
    return writers


def run_writers(writers: Mapping[str, Writer], folder: Path) -> dict[str, Any]:
    """What each of the writers of files in a folder returns, two at a time (encoders let go of the interpreter); the first error
    is raised.

    One of the two threads is the caller's: memory that was freed in it is used again.
    """
    left, results = iter(list(writers.items())), {}
    for name in writers:
        (folder / name).parent.mkdir(exist_ok=True)

    def work() -> None:
        for name, writer in left:
            begin_stage(f"write {name}")
            results[name] = writer(folder / name)

    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(copy_context().run, work)  # its stages go where those of this thread go
        try:
            work()
        finally:
            other.result()
    return results
