"""What a completion is given in; the scene that it starts from, and the plan of how it is completed, out.

What is chosen for a scene is chosen here, once, with its reason: the filler that `auto` stands for, and by how much masks grow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dlama.arguments import function_name
from dlama.completion.memory import check_memory
from dlama.completion.meta_data import MetaData
from dlama.completion.options import Options
from dlama.completion.recipes import Recipe
from dlama.errors import InputError, warn
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.frames import gathering
from dlama.geometry.frames.gathering import FrameSource
from dlama.geometry.frames.removal import NO_DILATION, Dilation
from dlama.geometry.frames.stored import Layer
from dlama.geometry.holes import looks_inverted
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import AUTO, ESTIMATED, MEASURED, find_filler
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Inpainter
from dlama.inpainters.grey_depth import with_grey_depth
from dlama.inpainters.layered.depth_first import paint_over_depth
from dlama.perception.monocular import DEFAULT
from dlama.perception.object_removal import remove_object


@dataclass(frozen=True, eq=False)
class Plan:
    """What stays the same while one scene is completed."""

    recipe: Recipe
    """With the px by which masks grew, where there are any."""
    inpainter: Inpainter
    """The filler, with the recipe's way of filling depth (`filler_of_recipe`)."""
    seed: int
    measured: Scene
    """The scene as measured, without removed objects; nothing is filled."""
    filler: str
    """The filler's name, for meta.json."""
    decisions: Mapping[str, Mapping[str, Any]]
    """For meta.json: what was chosen, and why."""
    again: bool = False
    """Whether estimated depth behind removed objects is estimated again (`second_estimate`)."""

    @cached_property
    def context(self) -> FillContext:
        """What fillers know of the measured scene besides a view; nothing, where the recipe knows no law."""
        return FillContext.of(self.measured) if self.recipe.law else FillContext(Law(()))


class Start(NamedTuple):
    """What a completion begins with."""

    plan: Plan
    given: Scene
    """The scene as it was given; of pictures clipped."""
    scene: Scene
    """The scene that is completed: without what is masked."""
    mask: Dilation
    """How the masks grew."""
    about: MetaData
    """For meta.json: where the depth comes from."""


class FillerChoice(NamedTuple):
    """A filler, its name, and why that one."""

    inpainter: Inpainter
    name: str
    decision: dict[str, dict[str, Any]]
    """For meta.json."""


def scene_of(rgbd: RGBD | Scene | Sequence[FrameSource], clip: float | None = None) -> Scene:
    """The scene that a completion starts from; of pictures clipped at `clip` metres."""
    if isinstance(rgbd, RGBD):
        return Scene((View.from_rgbd(rgbd.clip_depth(clip)),))
    if not isinstance(rgbd, Scene):
        return gathering.scene([clip_frame(frame, clip) for frame in rgbd])
    return rgbd


def may_estimate_again(rgbd: object) -> bool:
    """Whether a picture's depth may be estimated again (`second_estimate`): by the network that ships, if that estimated it (of
    a scene it is not known). A better network, or a phone, is not corrected by it."""
    estimate = rgbd.estimate if isinstance(rgbd, RGBD) else None
    return estimate is None or estimate.get("estimator") == DEFAULT


def clip_frame(frame: FrameSource, clip: float | None) -> FrameSource:
    """The frame, or what reads it, clipped; what is neither as it is: who reads the frame refuses it by name."""
    if isinstance(frame, RGBD):
        return frame.clip_depth(clip)
    return (lambda: clip_frame(frame(), clip)) if callable(frame) and clip is not None else frame  # type: ignore[return-value]


def choose_filler(estimated: bool, filler: str | Inpainter, model: str | Path | None) -> FillerChoice:
    """The filler as given; for `auto` the one that suits depth that was measured, or estimated.

    InputError: a model for `auto`, and as of `find_filler`.
    """
    reason = "as given"
    if filler == AUTO:
        if model is not None:
            raise InputError(
                f"`model` is {model} and filler 'auto', which chooses by the depth; name the filler that runs the model"
            )
        filler = ESTIMATED if estimated else MEASURED
        reason = "a network estimated the depth" if estimated else "the depth was measured"
    name = filler if isinstance(filler, str) else function_name(filler)
    return FillerChoice(find_filler(filler, model), name, {"filler": {"name": name, "reason": reason}})


def filler_of_recipe(filler: Inpainter, recipe: Recipe) -> Inpainter:
    """The filler with the recipe's way of filling depth: by surfaces, in 8-bit steps, or its own."""
    if recipe.depth_by == "surfaces":
        return paint_over_depth(filler)
    return with_grey_depth(filler, recipe.clip) if recipe.eight_bit_depth and recipe.clip is not None else filler


def describe_padding(frames: Sequence[Layer]) -> dict[str, dict[str, Any]]:
    """For meta.json: how many pixels of the frames in memory are padding round the picture (`RGBD.padding`); {} = none."""
    measured = (one for one in frames if isinstance(one, View))
    pixels = sum(int(np.count_nonzero(one.hole_type == HoleType.OUT_OF_VIEW.value)) for one in measured)
    reason = "the picture shows nothing of the scene there (a frame round it, say): filled as all that is out of view"
    return {"padding": {"pixels": pixels, "reason": reason}} if pixels else {}


def describe_depth(rgbd: RGBD | Scene) -> MetaData:
    """For meta.json: where the depth comes from; of a picture how it was estimated, of a scene of several frames their numbers,
    gains and noise, too."""
    if isinstance(rgbd, RGBD):
        estimate = rgbd.estimate
        return {"depth": "measured"} if estimate is None else {"depth": "estimated", "depth_estimate": dict(estimate)}
    about: MetaData = {"depth": "estimated" if rgbd.has_estimated_depth else "measured"}
    if len(rgbd.frames) > 1:
        about["frames"] = {
            "numbers": list(rgbd.numbers),
            "gains": [[round(gain, 4) for gain in gains] for gains in rgbd.gains],
            "noise": {"metres": rgbd.noise[0], "per_metre": rgbd.noise[1]},
        }
    return about


def warn_of_mask(mask: BoolArray | Mapping[int, BoolArray]) -> None:
    """Warn of a mask, or one of several frames, that removes most of the picture."""
    for one in map(np.asarray, mask.values() if isinstance(mask, Mapping) else (mask,)):
        if looks_inverted(one):
            warn(
                f"the mask removes {100 * float(one.mean()):.0f} % of the picture: if it marks what stays, it is inverted "
                "(`mask_polarity` turns it round)"
            )


def plan_for(
    rgbd: RGBD | Scene | Sequence[FrameSource],
    options: Options,
    mask: BoolArray | Mapping[int, BoolArray] | None = None,
    cameras: Sequence[Camera] = (),
    with_shadow: bool = False,
) -> Start:
    """How a scene is completed, for which cameras, and the scene that this begins with: without what is masked and, if asked for,
    without its shadow.

    Raises InputError, MaskError, as `complete`.
    """
    recipe, again = options.settings, may_estimate_again(rgbd)
    about = describe_depth(rgbd) if isinstance(rgbd, RGBD | Scene) else None
    given = scene = scene_of(rgbd, recipe.clip)
    check_memory((*(one.camera for one in given.frames if isinstance(one, View)), *cameras))
    choice = choose_filler(given.has_estimated_depth, options.filler, options.model)
    decisions, dilation = choice.decision, NO_DILATION
    if mask is not None:
        removal = remove_object(scene, mask, recipe.dilate, with_shadow)
        warn_of_mask(mask)
        scene, recipe = removal.scene, replace(recipe, dilate=removal.growth.px)
        decisions, dilation = decisions | {"mask_growth": removal.growth._asdict()}, removal.mask
    measured = scene.unfilled
    decisions = decisions | describe_padding(measured.frames)
    plan = Plan(
        recipe, filler_of_recipe(choice.inpainter, recipe), options.seed, measured, choice.name, decisions, again
    )
    return Start(plan, given, scene, dilation, about or describe_depth(given))
