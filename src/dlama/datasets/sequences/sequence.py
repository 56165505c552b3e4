"""A data set of posed frames in; the same completed, frame by frame or along a path of cameras, as a data set out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from dlama import __version__
from dlama.arguments import check_arguments
from dlama.completion.completion import above_confidence, scene_above
from dlama.completion.memory import check_memory
from dlama.completion.options import OptionKeywords, Options, Unpack, options_of, take_options
from dlama.completion.report import describe_shadow, share, warn_of_scale
from dlama.completion.start import Plan, plan_for
from dlama.completion.steps import CompletedView, complete_frame, complete_view, frames_to_fill
from dlama.datasets.posed.lenses import CameraOption
from dlama.datasets.posed.nerfstudio import FOLDERS, MASKS, write_transforms, write_view
from dlama.datasets.sequences.camera_paths import cameras_for
from dlama.datasets.sequences.loading import masks_of_frames, read_scene_of
from dlama.datasets.sequences.results import check_results, write_views_video, write_whole
from dlama.datasets.sequences.state import SequenceState, Step, StepChange
from dlama.errors import InputError, OutputError, system_errors
from dlama.files.results.meta_json import write_json
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.frames.choosing import MOST_FRAMES
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike, check_folder_name

SHADOW = ("remaining_shadow_px", "removed_px")
"""Of a step, for the hint of a shadow that stays."""
ViewProgress = Callable[[int, int, str, bool], None]
"""Called after each view: how many are done, of how many, which one, and whether an earlier run had done it."""


@dataclass
class StepResults:
    """What the steps of a sequence gave."""

    scene: Scene
    views: dict[str, dict[str, float]] = field(default_factory=dict)
    """View -> shares of its pixels: that were filled in colour and depth; in depth alone, as their colours were measured; that
    are open, as they were filled with too little confidence."""
    reused: int = 0
    """Steps that an earlier run had done."""
    shadow: str = ""
    """What is known of a removed object's shadow that stays, in the first view that shows one."""

    def shares(self, names: Iterable[str]) -> dict[str, dict[str, float]]:
        """Of the views with these names, share by share, for meta.json."""
        kinds = "filled_share", "depth_filled_share", "left_open_share"
        order = list(names)
        return {kind: {name: self.views[name][kind] for name in order} for kind in kinds}


@take_options
@system_errors(OutputError)
def sequence(
    dataset: PathLike,
    output: PathLike,
    *,
    frames: str | None = None,
    masks: Mapping[str, BoolArray] | None = None,
    with_shadow: bool = False,
    views: str | Mapping[str, Camera] = "frames",
    layout: str | None = None,
    scene: str | None = None,
    camera: CameraOption = None,
    depth_range: float | None = None,
    depth_scale: float | None = None,
    max_depth: float | None = None,
    resize_depth: Literal["guided", "nearest"] | None = None,
    only: Sequence[str] | None = None,
    also: Sequence[str] = (),
    keep_poses: bool = False,
    progress: ViewProgress | None = None,
    **options: Unpack[OptionKeywords],
) -> dict[str, Any]:
    """Complete a data set of posed frames: what one frame lacks comes from the others, only the rest is filled, once.

    Writes a data set in nerfstudio's layout: transforms.json, images/, depth/ (mm), hole/ (255 = filled or open), origin/,
    source/ (the frame each pixel comes from); scene.glb, meta.json, sparse/0 (a COLMAP model as text), a video of the views;
    scene.npz and scene.ply where asked for. A killed run resumes at the frame it was at. A frame that cannot be read, comes
    twice or contradicts all others is warned of and left out. Memory hardly grows with the number of frames.

    Args:
        dataset: The folder of posed frames, in any layout that `dlama evaluate` reads; or a scene.npz.
        output: Directory for the results.
        frames: Which frames: `FIRST:END:STEP`, places from 0.
        masks: A frame's name, or its place from 0 of those in `frames` -> H x W bool, True = remove: an object that is removed
            from all frames. Those of larger pictures are shrunk, as the frames are, empty ones and those of frames that are not
            chosen passed over.
        with_shadow: Remove the shadow that the object casts in each frame, too.
        views: "frames": at the frames' own cameras; "orbit", "spiral" or "dolly": a path of 24 cameras from the middle frame; a
            JSON file with a list of cameras; or cameras by name.
        layout, scene, camera, depth_range, depth_scale: Of the data set, as in `dlama evaluate`; `scene` of several.
        max_depth: Metres beyond which depth is missing; None: 5 in recordings of a phone's LIDAR, which guesses beyond.
        resize_depth: Depth smaller than the pictures is enlarged to their size, as in `read_rgbd`; None: pictures are shrunk to
            its size, or, in recordings of phones and depth cameras, to up to four times that.
        only: What of scene, points, mesh, colmap and video is written next to the views; None: mesh, colmap and video.
        also: More of them. "scene" is the file that `dlama view` and `dlama video` read.
        keep_poses: Else poses are made to agree with the pictures first, where they are off by a pixel or more, as those of
            hand-held cameras are (`align_frames`); the results then have the new poses.
        progress: Called after each view: how many are done, of how many, its name, whether an earlier run did it.
        options: How the scene is completed (`Options`).
    Returns:
        What meta.json holds.
    Raises:
        InputError: what `scene` and `complete` refuse, a mask for a frame that is not there; FileError, OutputError.
    """
    check_arguments(sequence, locals())
    started, target, chosen = time.perf_counter(), check_folder_name(output), check_results(only, also)
    method = options_of(options)
    reading: dict[str, Any] = {"layout": layout, "scene": scene, "camera": camera, "resize_depth": resize_depth}
    reading |= {"depth_range": depth_range, "depth_scale": depth_scale, "max_depth": max_depth}
    loaded = read_scene_of(dataset, frames, clip=method.settings.clip, keep_poses=keep_poses, **reading)
    names, kept, given = loaded.names, loaded.kept, loaded.scene
    cameras = cameras_for(views, given)
    check_first_frame(given)
    numbered = masks_of_frames(masks or {}, loaded, frames)
    if with_shadow and not numbered:
        raise InputError("`with_shadow` is for a removed object; give its `masks`")
    plan, _, start, *_ = plan_for(given, method, numbered or None, with_shadow=with_shadow)
    steps, settings = steps_for(plan, start, kept, cameras), settings_of(plan, method) | {"with_shadow": with_shadow}
    asked = settings | {"views": [(step.name, step.shown) for step in steps]}
    state = SequenceState(target, asked, given, numbered, __version__)
    done = complete_steps(plan, start, steps, state, target, progress, method.min_confidence)
    ordered = cameras or {name: frame.camera for name, frame in zip(kept, given.frames)}
    meta = {
        "dlama": __version__,
        "dataset": str(dataset),
        **about_frames(names, kept, given, loaded.damaged),
        **settings,
        "decisions": loaded.decisions | {name: dict(decision) for name, decision in plan.decisions.items()},
        "masked_frames": [names[number] for number in sorted(numbered)],
        **done.shares(ordered),
        "remaining_shadow": done.shadow,
        "views_from_earlier_run": done.reused,
        **write_views(target, done.scene, ordered, names, chosen, method.min_confidence > 0),
        "seconds": round(time.perf_counter() - started, 3),
    }
    write_json(target / "meta.json", meta)
    state.end()
    return meta


def check_first_frame(scene: Scene) -> None:
    """InputError where frames of its size are too large for the memory; warns of depth that can hardly be metres."""
    check_memory([scene.frames[0].camera] * (2 * MOST_FRAMES))
    if (depth := scene.frames[0].load().depth).any():
        warn_of_scale(depth)


def settings_of(plan: Plan, options: Options) -> dict[str, Any]:
    """What views are completed by, for meta.json and for a run that resumes."""
    return {
        "filler": plan.filler,
        "model": None if options.model is None else str(options.model),
        "recipe": dataclasses.asdict(plan.recipe),
        "seed": options.seed,
        "min_confidence": options.min_confidence,
    }


def about_frames(names: Sequence[str], kept: Sequence[str], given: Scene, damaged: Mapping[str, str]) -> dict[str, Any]:
    """For meta.json: where depth comes from, the frames that the scene is made of (`kept` of those with `names`), why others were
    left out."""
    contradict = [name for name in names if name not in kept and name not in damaged]
    return {
        "depth": "estimated" if given.has_estimated_depth else "measured",
        "frames": {"names": list(kept), "gains": [list(gain) for gain in given.gains], "noise": list(given.noise)},
        "left_out": dict(damaged) | dict.fromkeys(contradict, "see warnings"),
    }


def write_views(
    target: Path, scene: Scene, cameras: Mapping[str, Camera], names: Sequence[str], chosen: Sequence[str], masked: bool
) -> dict[str, Any]:
    """What is made of all views, written: transforms.json and those of RESULTS in `chosen`; for meta.json: what was left out.

    cameras: of the views, by name; names: of the frames; masked: whether views have masks. Raises OutputError.
    """
    points = {"ply_file_path": "scene.ply"} if "points" in chosen else {}
    write_transforms(target, cameras, names, points, masked)
    about = write_whole(target, scene, cameras, chosen)
    if "video" in chosen:
        about["video"] = write_views_video(target, list(cameras))
    return about


def steps_for(plan: Plan, scene: Scene, names: Sequence[str], cameras: Mapping[str, Camera] | None) -> list[Step]:
    """The views to complete, in order: the frames that matter, then the cameras (name -> camera; None: the frames' own).

    names: of the frames.
    """
    places = frames_to_fill(plan, scene, list((cameras or {}).values()))
    if cameras is None:
        places += [place for place in range(len(scene.frames)) if place not in places]
    frames = [Step(names[place], scene.frames[place].camera, place, cameras is None) for place in places]
    return [*frames, *(Step(name, camera, None, True) for name, camera in (cameras or {}).items())]


def complete_steps(
    plan: Plan,
    scene: Scene,
    steps: Sequence[Step],
    state: SequenceState,
    target: Path,
    progress: ViewProgress | None,
    min_confidence: float,
) -> StepResults:
    """The steps one after the other, each kept as soon as it is done, and its view written into `target`. Raises OutputError.

    Fills below `min_confidence` are left out of what is written and of the scene; while the steps last they are in it, so
    that every surface is filled once.
    """
    resumed = state.begin()
    masked = min_confidence > 0
    for folder in (*FOLDERS, MASKS) if masked else FOLDERS:
        (target / folder).mkdir(exist_ok=True)
    done = StepResults(scene)
    for number, step in enumerate(steps):
        added = state.of(number, step.camera) if resumed else None
        earlier = added is not None
        if added is None:
            found, larger = complete_step(plan, done.scene, step)
            shown = above_confidence(found.view, min_confidence)
            if step.shown:
                write_view(target, step.name, shown, masked)
            shares = shares_of(shown) | shadow_of(found)
            added = state.keep(number, step.camera, StepChange.by(step, shares, done.scene, larger))
        done.scene, done.reused = added.to(done.scene, step), done.reused + earlier
        done.shadow = done.shadow or describe_shadow(*(int(added.shares[name]) for name in SHADOW))
        if step.shown:
            done.views[step.name] = added.shares
        if progress is not None:
            progress(number + 1, len(steps), step.name if step.shown else f"{step.name} (on the way)", earlier)
    done.scene = scene_above(done.scene, min_confidence)
    return done


def shares_of(view: View) -> dict[str, float]:
    """What of a completed view was filled, got a depth, is open."""
    return {
        "filled_share": share(view.filled),
        "depth_filled_share": share(view.origin == Origin.DEPTH_FILLED.value),
        "left_open_share": share(view.hole),
    }


def shadow_of(found: CompletedView) -> dict[str, int]:
    """The pixels that look like the shadow of a removed object, and those of the object."""
    shadow = sum(one.notes.get("remaining_shadow_px", 0) for one in found.reports)
    return dict(zip(SHADOW, (shadow, int(found.before.object_hole.sum()))))


def complete_step(plan: Plan, scene: Scene, step: Step) -> tuple[CompletedView, Scene]:
    """The view of a step, completed, and the scene with what was filled for it."""
    if step.place is None:
        return complete_view(plan, scene, step.camera)
    return complete_frame(plan, scene, step.place)
