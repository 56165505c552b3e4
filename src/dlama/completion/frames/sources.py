"""What a completion is given (a picture, frames, or a scene) in; the scene it starts from, and notes about it, out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from dlama.completion.recipes import Recipe
from dlama.completion.report import depth_source
from dlama.errors import InputError
from dlama.geometry.drawing.picture_edges import taken_by_camera
from dlama.geometry.frames.gathering import FrameSource, scene
from dlama.geometry.rgbd import RGBD, clipped
from dlama.geometry.scene import Scene
from dlama.geometry.view import Origin, View
from dlama.inpainters import AUTO, Given, auto_filler


def starting_scene(given: RGBD | Scene | Sequence[FrameSource], recipe: Recipe) -> Scene:
    """The scene that a completion starts from, clipped as the recipe says. InputError: a scene cannot be clipped any more."""
    if isinstance(given, RGBD):
        return Scene((View.from_rgbd(clipped(given, recipe.clip)),))
    if not isinstance(given, Scene):
        return scene([clipped_frame(frame, recipe.clip) for frame in given])
    if recipe.clip is not None:
        raise InputError(f"clip is {recipe.clip} m: a scene cannot be clipped; give its frames instead")
    return given


def clipped_frame(frame: FrameSource, clip: float | None) -> FrameSource:
    """The frame, or what reads it, clipped."""
    if clip is None:
        return frame
    return clipped(frame, clip) if isinstance(frame, RGBD) else partial(_read_clipped, frame, clip)


def _read_clipped(read: Callable[[], RGBD], clip: float | None) -> RGBD:
    return clipped(read(), clip)


def has_estimated_depth(scene: Scene) -> bool:
    """Whether some of its depth is a network's."""
    return any(Origin.ESTIMATED in layer.origins for layer in scene.measured)


def kind_of_depth(scene: Scene) -> str:
    """For meta.json: `estimated`, or `measured`."""
    return "estimated" if has_estimated_depth(scene) else "measured"


def filler_for(start: Scene, filler: Given) -> Given | str:
    """The filler as given; for `auto` the name of the one that suits the depth of the scene."""
    if filler != AUTO:
        return filler
    misplaced = any(taken_by_camera(layer.read()) for layer in start.measured[:1])
    return auto_filler(estimated=has_estimated_depth(start), misplaced=misplaced)


def about_source(given: RGBD | Scene | Sequence[FrameSource], start: Scene) -> dict[str, Any]:
    """For meta.json: where depth comes from; of many frames their numbers, gains and noise."""
    if isinstance(given, RGBD):
        return depth_source(given)
    about: dict[str, Any] = {"depth": kind_of_depth(start)}
    if start.numbers:
        about["frames"] = {
            "numbers": list(start.numbers),
            "gains": [[round(gain, 4) for gain in gains] for gains in start.gains],
            "noise": {"metres": start.noise[0], "per_metre": start.noise[1]},
        }
    return about
