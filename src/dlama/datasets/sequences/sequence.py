"""A data set of posed frames in; the same completed, frame by frame or along a path of cameras, as a data set out."""

from __future__ import annotations

import logging
import math
import re
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from dlama import __version__
from dlama.completion.frames.stepwise import plan_for, steps_for, taken, taken_up
from dlama.completion.memory import check_memory
from dlama.datasets.frames import Frame
from dlama.datasets.posed.colmap_model import write_model
from dlama.datasets.posed.nerfstudio_writer import FOLDERS, write_transforms, write_view
from dlama.datasets.posed.posed_frames import CameraOption
from dlama.datasets.sequences.camera_paths import cameras_for
from dlama.datasets.sequences.scene_frames import open_frames, sliced
from dlama.datasets.sequences.state import SequenceState
from dlama.errors import DlamaError, FileError, InputError, OutputError, first_line, system_errors
from dlama.files.atomic_write import PathLike, new_file
from dlama.files.results.completion import as_json
from dlama.files.scenes.clouds import write_ply
from dlama.files.scenes.scene_npz import read_scene, write_npz
from dlama.files.scenes.textured_mesh import write_textured_glb
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud
from dlama.geometry.frames.gathering import scene as scene_of
from dlama.geometry.frames.thinning import thinned
from dlama.geometry.fusion import scene_cloud
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene

LOG = logging.getLogger("dlama")
COLMAP_POINTS = 200_000
"""Points of the COLMAP model; scene.ply has all."""
Progress = Callable[[int, int, str, bool], None]
"""Told after each view: how many are done, of how many, which one, and whether an earlier run had done it."""


@system_errors(OutputError)
def sequence(
    dataset: PathLike,
    output: PathLike,
    *,
    frames: str | None = None,
    masks: Mapping[str, BoolArray] | None = None,
    views: str | Mapping[str, Camera] = "frames",
    layout: str | None = None,
    scene: str | None = None,
    camera: CameraOption = None,
    depth_range: float | None = None,
    filler: str = "layered",
    model: str | Path | None = None,
    recipe: str = "dlama",
    dilate: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Complete a data set of posed frames: what one frame lacks comes from the others, only the rest is filled, once.

    Writes a data set in nerfstudio's layout: transforms.json, images/, depth/ (mm), hole/ (255 = filled), origin/, source/ (the
    frame each pixel comes from); and scene.npz, scene.ply, scene.glb, meta.json, and sparse/0, a COLMAP model
    of it as text. A run that was killed goes on frame by frame. A
    frame that cannot be read, comes twice or contradicts all others is warned of and left out.

    Args:
        dataset: The folder of posed frames, in any layout that `dlama evaluate` reads; or a scene.npz.
        output: Directory for the results.
        frames: Which frames: `FIRST:END:STEP`, places from 0.
        masks: A frame's name, or its place from 0 -> H x W bool, True = remove: a thing that is taken out of all frames.
        views: "frames": at the frames' own cameras; "orbit", "spiral" or "dolly": a path of 24 cameras from the middle frame; a
            JSON file with a list of cameras; or cameras by name.
        layout, scene, camera, depth_range: Of the data set, as in `dlama evaluate`; `scene` of several.
        filler, model, recipe, dilate, seed: As in `complete`.
        progress: Told after each view.
    Returns:
        What meta.json holds.
    Raises:
        InputError: what `scene` and `complete` refuse, a mask for a frame that is not there; FileError, OutputError.
    """
    started, target = time.perf_counter(), Path(output)
    names, given, damaged = read_scene_of(dataset, frames, layout, scene, camera, depth_range)
    kept = [names[number] for number in given.numbers or (0,)]
    cameras = cameras_for(views, given)
    check_memory([layer.camera for layer in (*given.measured, *given.measured)])
    numbered = masks_by_number(masks or {}, names)
    plan = plan_for(given, numbered, filler=filler, model=model, recipe=recipe, dilate=dilate, seed=seed)
    steps = steps_for(plan, kept, cameras)
    settings = {"filler": filler, "model": str(model), "recipe": recipe, "dilate": dilate, "seed": seed}
    state = SequenceState(target, settings | {"views": [step.key for step in steps]}, plan.given, __version__)
    resumed = state.begin()
    for folder in FOLDERS:
        (target / folder).mkdir(exist_ok=True)
    whole, shares, reused = plan.given, dict[str, float](), 0
    for number, step in enumerate(steps):
        added = state.of(step) if resumed else None
        earlier = added is not None
        if added is None:
            added = taken(plan, whole, step)
            if step.name is not None:
                write_view(target, step.name, added.view)
            state.keep(step, added)
        whole, reused = taken_up(whole, step, added), reused + earlier
        if step.name is not None:
            shares[step.name] = round(float(added.view.filled.mean()), 6)
        if progress is not None:
            progress(number + 1, len(steps), step.name or f"{kept[step.place or 0]} (on the way)", earlier)
    shown = {step.name: step.camera for step in steps if step.name is not None}
    ordered = {name: shown[name] for name in (kept if cameras is None else cameras)}
    meta = {
        "dlama": __version__,
        "dataset": str(dataset),
        "frames": {"names": kept, "gains": [list(gain) for gain in given.gains], "noise": list(given.noise)},
        "left_out": damaged | {name: "see warnings" for name in names if name not in kept and name not in damaged},
        "recipe": recipe,
        "filler": filler,
        "seed": seed,
        "masked_frames": sorted(masks or {}),
        "filled_share": {name: shares[name] for name in ordered},
        "views_from_earlier_run": reused,
    }
    write_transforms(target, ordered, names, {"ply_file_path": "scene.ply"})
    write_scene(target, whole, ordered)
    meta["seconds"] = round(time.perf_counter() - started, 3)
    with new_file(target / "meta.json") as draft:
        draft.write_text(as_json(meta), encoding="utf-8")
    state.end()
    return meta


def read_scene_of(
    dataset: PathLike,
    which: str | None = None,
    layout: str | None = None,
    scene: str | None = None,
    camera: CameraOption = None,
    depth_range: float | None = None,
) -> tuple[list[str], Scene, dict[str, str]]:
    """The names of the frames, the scene of them, and those that could not be read with why. A scene.npz is one already."""
    if Path(dataset).suffix.lower() == ".npz":
        if which is not None:
            raise InputError(f"frames is {which}, and {dataset} is a scene; its frames cannot be chosen any more")
        found = read_scene(dataset)
        return [f"frame-{number:04d}" for number in range(max(found.numbers, default=0) + 1)], found, {}
    chosen = sliced(open_frames(dataset, layout, camera=camera, depth_range=depth_range, scene=scene), which)
    loaded, damaged = load_frames(chosen)
    if not loaded:
        raise FileError(
            f"{dataset}: not one of its {len(chosen)} frames can be read; the first: {next(iter(damaged.values()))}"
        )
    names = list(loaded)
    return names, scene_of(list(loaded.values()), names=names), damaged


def load_frames(frames: Sequence[Frame]) -> tuple[dict[str, RGBD], dict[str, str]]:
    """Name -> picture with depth, and name -> why not; each damaged frame is warned of."""
    loaded, damaged = dict[str, RGBD](), dict[str, str]()
    for frame in frames:
        try:
            rgbd = frame.load()
            if not (rgbd.valid | rgbd.far).any():
                raise FileError("has no depth at all")
            loaded[frame.name] = rgbd
        except DlamaError as error:
            damaged[frame.name] = first_line(error)
            warnings.warn(f"frame {frame.name} is left out: {first_line(error)}", UserWarning, stacklevel=3)
    return loaded, damaged


def masks_by_number(masks: Mapping[str, BoolArray], names: Sequence[str]) -> dict[int, BoolArray]:
    """Number of a frame -> mask, of frames by name or by place. Raises InputError: no such frame."""
    found: dict[int, BoolArray] = {}
    for name, mask in masks.items():
        if name in names:
            number = list(names).index(name)
        elif re.fullmatch(r"\d+", name) and int(name) < len(names):
            number = int(name)
        else:
            few = ", ".join(names[:3]) + (f", ... {names[-1]}" if len(names) > 3 else "")
            raise InputError(
                f"mask is for frame {name}, which is not there; a name ({few}) or a place, 0 to {len(names) - 1}, is wanted"
            )
        if number in found:
            raise InputError(f"mask: frame {names[number]} has two; one mask a frame is wanted")
        found[number] = mask
    return found


def write_scene(folder: Path, whole: Scene, cameras: Mapping[str, Camera]) -> None:
    """scene.npz without loss; scene.ply and scene.glb with every surface once, without removed things; sparse/0, a COLMAP model
    of the views with some of the points, for trainers of splats. Raises OutputError."""
    LOG.info("write scene")
    write_npz(folder / "scene.npz", whole.layers[0], whole)
    once = thinned(whole)
    cloud = scene_cloud(once, objects=False)
    write_ply(folder / "scene.ply", cloud)
    write_textured_glb(folder / "scene.glb", once)
    (folder / "sparse" / "0").mkdir(parents=True, exist_ok=True)
    write_model(folder / "sparse" / "0", {f"{name}.png": camera for name, camera in cameras.items()}, some_of(cloud))


def some_of(cloud: PointCloud, most: int = COLMAP_POINTS) -> PointCloud:
    """Evenly chosen points of a cloud, `most` at most."""
    step = max(1, math.ceil(len(cloud) / most))
    return PointCloud(cloud.points[::step], cloud.color[::step], cloud.origin[::step], cloud.confidence[::step])
