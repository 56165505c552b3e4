"""Many frames and the cameras asked for in; one completed view after the other out, each with what it adds to the scene.

What a step adds can be kept and given back (`taken_up`), so that a long job goes on where it was interrupted.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dlama.completion.frames.filling import completed_frame, filling_order
from dlama.completion.frames.removal import take_out_of, with_halo
from dlama.completion.recipes import checked_seed, find_recipe
from dlama.completion.steps import Plan, complete_view, filler_of_recipe, law_of
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters import find_filler
from dlama.inpainters.filling import Inpainter


@dataclass(frozen=True, eq=False)
class Step:
    """One view to be completed."""

    place: int | None
    """Of the frame in whose camera it is; None: another camera."""
    camera: Camera
    name: str | None
    """Of the camera that was asked for; None: a frame that is filled on the way."""

    @property
    def key(self) -> str:
        """Tells a step from all others."""
        return f"frame-{self.place}" if self.place is not None else f"view-{self.name}"


@dataclass(frozen=True, eq=False)
class Added:
    """What a step found."""

    view: View
    """The completed view."""
    layers: tuple[View, ...]
    """New layers of the scene: what was filled."""
    frame: View | None
    """The frame itself with depth wherever it has a colour, where it is a frame."""


def plan_for(
    scene: Scene,
    masks: Mapping[int, BoolArray] | None = None,
    *,
    filler: str | Inpainter = "layered",
    model: str | Path | None = None,
    recipe: str = "dlama",
    dilate: int | None = None,
    seed: int = 0,
) -> Plan:
    """What stays the same while the scene of many frames is completed step by step. Raises InputError, as `complete`."""
    chosen = find_recipe(recipe, dilate=dilate)
    if dilate is None and recipe == "dlama":
        chosen = with_halo(chosen, scene, masks or None)
    inpainter = filler_of_recipe(find_filler(filler, model), chosen)
    given, _ = take_out_of(scene, masks or None, chosen.dilate)
    return Plan(chosen, inpainter, checked_seed(seed), given, law_of(given, chosen))


def steps_for(plan: Plan, names: Sequence[str], cameras: Mapping[str, Camera] | None) -> list[Step]:
    """The views to complete, in order: the frames that matter, then the cameras (name -> camera; None: the frames' own).

    names: of the frames.
    """
    frames = plan.given.measured
    order = filling_order(plan, list((cameras or {}).values()))
    if cameras is None:
        order += [place for place in range(len(frames)) if place not in order]
        return [Step(place, frames[place].camera, names[place]) for place in order]
    on_the_way = [Step(place, frames[place].camera, None) for place in order]
    return [*on_the_way, *(Step(None, camera, name) for name, camera in cameras.items())]


def taken(plan: Plan, scene: Scene, step: Step) -> Added:
    """The step's view, completed, and what it adds to `scene`."""
    if step.place is not None:
        larger, view, _ = completed_frame(plan, scene, step.place)
        frame = larger.layers[step.place]
        new = frame if frame is not scene.layers[step.place] else None
        return Added(view, larger.layers[len(scene.layers) :], new)
    completed, larger = complete_view(plan, scene, step.camera)
    return Added(completed.view, larger.layers[len(scene.layers) :], None)


def taken_up(scene: Scene, step: Step, added: Added) -> Scene:
    """The scene with what a step added."""
    layers = [*scene.layers, *added.layers]
    if step.place is not None and added.frame is not None:
        layers[step.place] = added.frame
    return dataclasses.replace(scene, layers=tuple(layers))
