"""Posed frames that were read, and how they are completed, in; their views one by one, or all of them as a data set, out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlama import __version__
from dlama.arguments import check_arguments
from dlama.completion.completion import above_confidence, scene_above
from dlama.completion.report import describe_shadow, share
from dlama.completion.start import Plan
from dlama.completion.steps import CompletedView, complete_frame, complete_view, frames_to_fill
from dlama.datasets.posed.nerfstudio import FOLDERS, MASKS, write_transforms, write_view
from dlama.datasets.sequences.loading import LoadedScene
from dlama.datasets.sequences.results import check_results, write_whole
from dlama.datasets.sequences.state import SequenceState, Step
from dlama.errors import OutputError, format_count, system_errors, warn
from dlama.files.results.meta_json import write_json
from dlama.geometry.camera import Camera
from dlama.geometry.codes import Origin
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike, check_folder_name
from dlama.writing.drafts import lock_output

SHARES = ("filled_share", "depth_filled_share", "left_open_share")
"""Of the pixels of a step's view, and of meta.json: those that were filled in colour and depth; in depth alone, as their colours
were measured; that are open, as they were filled with too little confidence."""
SHADOW = ("remaining_shadow_px", "removed_px")
"""Of a step, for the hint of a shadow that stays."""
CLIPPED = "depth_png_clipped_pixels"
"""Of a step, and of meta.json."""
ViewProgress = Callable[[int, int, str, bool], None]
"""Called after each view: how many are done, of how many, which one, and whether an earlier run had done it."""


@dataclass
class StepResults:
    """What the steps of a sequence gave."""

    scene: Scene
    views: dict[str, dict[str, float]] = field(default_factory=dict)
    """View -> what is known of its pixels: SHARES, SHADOW and CLIPPED."""
    reused: int = 0
    """Steps that an earlier run had done."""
    shadow: str = ""
    """What is known of a removed object's shadow that stays, in the first view that shows one."""

    def count_clipped(self) -> int:
        """Pixels of all views that are too deep for their depth file; warns of any."""
        count = sum(int(shares[CLIPPED]) for shares in self.views.values())
        if count:
            warn(
                f"{format_count(count, 'pixel')} of the views beyond 65.534 m, the most that depth/ can hold, got that depth; "
                "`also=scene` writes scene.npz, which has theirs"
            )
        return count


class SequenceCompletion:
    """A data set of posed frames, read. `views` completes them one after the other, `write` makes a data set of them."""

    def __init__(
        self,
        dataset: str,
        loaded: LoadedScene,
        plan: Plan,
        scene: Scene,
        cameras: Mapping[str, Camera] | None,
        masks: Mapping[int, BoolArray],
        settings: Mapping[str, Any],
    ) -> None:
        """dataset: its folder; plan, settings: how views are completed, the latter for meta.json and for a run that resumes;
        scene: the frames without what is removed; cameras: of the views, None = of the frames; masks: of the removed object, by
        frame."""
        self.scene = scene
        self.cameras = cameras or {name: frame.camera for name, frame in zip(scene.names, scene.frames)}
        self._dataset, self._loaded, self._plan = dataset, loaded, plan
        self._masks, self._settings = masks, settings
        self._steps = steps_for(plan, scene, cameras)

    def __repr__(self) -> str:
        return f"SequenceCompletion({len(self.cameras)} views of {len(self.scene.frames)} frames)"

    def views(self) -> Iterator[tuple[str, View]]:
        """Each view's name and the view, completed as it is asked for; nothing is kept or written."""
        scene = self.scene
        for step in self._steps:
            found, scene = complete_step(self._plan, scene, step)
            if step.shown:
                yield step.name, above_confidence(found.view, self._settings["min_confidence"])

    @system_errors(OutputError)
    def write(
        self,
        output: PathLike,
        *,
        only: Sequence[str] | None = None,
        also: Sequence[str] = (),
        progress: ViewProgress | None = None,
    ) -> dict[str, Any]:
        """Complete the views and write a data set in nerfstudio's layout: transforms.json, images/, depth/ (mm), hole/ (255 =
        filled or open), origin/, source/ (the frame each pixel comes from); scene.glb, meta.json, sparse/0 (a COLMAP
        model), a video of the views; scene.npz and scene.ply where asked for. A killed run resumes at the frame it was at.

        Args:
            output: Directory for the results.
            only: What of scene, points, mesh, colmap and video is written next to the views; None: mesh, colmap and video.
            also: More of them. "scene" is the file that `dlama view` and `dlama video` read.
            progress: Called after each view: how many are done, of how many, its name, whether an earlier run did it.
        Returns:
            What meta.json holds.
        Raises:
            InputError: an unknown name. OutputError: the place cannot be written, or another run is writing there.
        """
        check_arguments(SequenceCompletion.write, locals())
        started, target, chosen = time.perf_counter(), check_folder_name(output), check_results(only, also)
        loaded, settings, least = self._loaded, self._settings, self._settings["min_confidence"]
        asked = {**settings, "views": [(step.name, step.shown) for step in self._steps]}
        state = SequenceState(target, asked, loaded.scene, self._masks, __version__)
        state.folder.mkdir(parents=True, exist_ok=True)
        with lock_output(target, target):
            done = complete_steps(self._plan, self.scene, self._steps, state, target, progress, least)
            points = {"ply_file_path": "scene.ply"} if "points" in chosen else {}
            write_transforms(target, self.cameras, loaded.names, points, least > 0)
            meta = {
                "dlama": __version__,
                "dataset": self._dataset,
                **about_frames(loaded),
                **settings,
                "decisions": loaded.decisions | {name: dict(one) for name, one in self._plan.decisions.items()},
                "masked_frames": [loaded.names[number] for number in sorted(self._masks)],
                **{kind: {name: done.views[name][kind] for name in self.cameras} for kind in SHARES},
                CLIPPED: done.count_clipped(),
                "remaining_shadow": done.shadow if self._masks else "",
                "views_from_earlier_run": done.reused,
                **write_whole(target, done.scene, self.cameras, chosen),
                "seconds": round(time.perf_counter() - started, 3),
            }
            write_json(target / "meta.json", meta)
            state.end()
        return meta


def about_frames(loaded: LoadedScene) -> dict[str, Any]:
    """For meta.json: where depth comes from, the frames that the scene is made of, why others were left out."""
    given = loaded.scene
    frames = {"names": list(given.names), "gains": list(map(list, given.gains)), "noise": list(given.noise)}
    return {
        "depth": "estimated" if given.has_estimated_depth else "measured",
        "frames": frames,
        "left_out": loaded.damaged | dict.fromkeys(loaded.contradicting, "see warnings"),
    }


def steps_for(plan: Plan, scene: Scene, cameras: Mapping[str, Camera] | None) -> list[Step]:
    """The views to complete, in order: the frames that matter, then the cameras (name -> camera; None: the frames' own)."""
    places = frames_to_fill(plan, scene, list((cameras or {}).values()))
    if cameras is None:
        places += [place for place in range(len(scene.frames)) if place not in places]
    frames = [Step(scene.names[place], scene.frames[place].camera, place, cameras is None) for place in places]
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
        earlier = state.read(number, step, done.scene) if resumed else None
        if earlier is not None:
            shares, done.scene = earlier
            done.reused += 1
        else:
            found, larger = complete_step(plan, done.scene, step)
            shown = above_confidence(found.view, min_confidence)
            clipped = write_view(target, step.name, shown, masked) if step.shown else 0
            shares = shares_of(shown) | shadow_of(found) | {CLIPPED: clipped}
            done.scene = state.keep(number, step, shares, done.scene, larger)
        done.shadow = done.shadow or describe_shadow(*(int(shares[name]) for name in SHADOW))
        if step.shown:
            done.views[step.name] = shares
        if progress is not None:
            name = step.name if step.shown else f"{step.name} (on the way)"
            progress(number + 1, len(steps), name, earlier is not None)
    done.scene = scene_above(done.scene, min_confidence)
    return done


def shares_of(view: View) -> dict[str, float]:
    """What of a completed view was filled, got a depth, is open."""
    parts = view.filled, view.origin == Origin.DEPTH_FILLED.value, view.hole
    return dict(zip(SHARES, map(share, parts)))


def shadow_of(found: CompletedView) -> dict[str, int]:
    """The pixels that look like the shadow of a removed object, and those of the object."""
    shadow = sum(one.notes.get("remaining_shadow_px", 0) for one in found.reports)
    return dict(zip(SHADOW, (shadow, int(found.before.object_hole.sum()))))


def complete_step(plan: Plan, scene: Scene, step: Step) -> tuple[CompletedView, Scene]:
    """The view of a step, completed, and the scene with what was filled for it."""
    if step.place is None:
        return complete_view(plan, scene, step.camera)
    return complete_frame(plan, scene, step.place)
