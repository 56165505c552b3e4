"""A method and a frame in; the completion it makes, with the seconds that took, out: also for the method that fills nothing."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from dlama.completion.pipeline import Completion, complete
from dlama.completion.recipes import recipe
from dlama.evaluation.protocols.methods import NO_FILL, Measure, Method, Panel
from dlama.evaluation.protocols.scores import Answer
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill


@dataclass(frozen=True, eq=False)
class Run:
    """What a method made of a case."""

    method: Method
    completion: Completion
    seconds: float

    @property
    def fills(self) -> bool:
        """False for the baseline that leaves holes black and without depth."""
        return self.of_filler(self.method)

    @staticmethod
    def of_filler(method: Method) -> bool:
        """As `fills`, before anything has run."""
        return method.filler != NO_FILL

    def view(self, number: int = -1) -> View:
        """The completed view, or for the baseline the one before filling."""
        return self.completion.views[number] if self.fills else self.completion.warped[number]

    def open(self, number: int = -1) -> BoolArray | None:
        """H x W, True where the answer has no depth to measure; None: nowhere."""
        return None if self.fills else self.completion.warped[number].hole

    @property
    def clip_m(self) -> float | None:
        """Metres at which the recipe cuts depth; None: nowhere."""
        return recipe(self.method.recipe, **self.method.changes).clip_m

    def timing(self) -> Measure:
        """Wall-clock seconds of the completion."""
        return Measure("whole", "time", "seconds", self.seconds)

    def hole_shares(self, number: int = -1, suffix: str = "") -> list[Measure]:
        """The method's own holes in % of the picture: of colour, and of depth (a sensor hole lacks depth only)."""
        warped = self.completion.warped[number]
        open_color = warped.color_hole
        return [
            Measure("whole" + suffix, modality, "mask_ratio", 100 * float(hole.mean()))
            for modality, hole in (("rgb", open_color), ("depth", warped.hole))
        ]


def run_method(method: Method, source: RGBD, camera: Camera, mask: BoolArray | None = None, **changes: Any) -> Run:
    """One new view or removal by `dlama.completion.pipeline.complete`; `changes` go over the method's own.

    The baseline is rendered from what was measured alone, so nothing is filled in its source view either.
    Raises InputError and its kin.
    """
    how: dict[str, Any] = {**method.changes, **changes}
    if not Run.of_filler(method):
        how |= {"filler": nothing, "source_first": False}
    else:
        how |= {"filler": method.filler, "model": method.model}
    started = time.perf_counter()
    done = complete(source, [camera], mask=mask, recipe=method.recipe, seed=method.seed, **how)
    return Run(method, done, time.perf_counter() - started)


def nothing(view: View, law: Law, seed: int) -> Fill:
    """A stand-in for a filler where only what it was given is looked at: black, and far."""
    return Fill(np.zeros_like(view.color), np.full(view.depth.shape, np.inf, np.float32))


def panel(run: Run, answer: Answer, source: RGBD, truth: RGBD, number: int = -1) -> Panel:
    """The pictures of one view to look at; the method's are shown in the truth's exposure."""
    warped, view = run.completion.warped[number], run.view(number)
    return Panel(
        source=source.color,
        warped=answer.exposed(warped.color),
        filled=answer.exposed(view.color),
        truth=truth.color,
        hole=warped.hole,
        depth_source=source.depth,
        depth_warped=warped.depth,
        depth_filled=view.depth,
        depth_truth=truth.depth,
    )
