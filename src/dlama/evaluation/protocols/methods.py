"""A method (a recipe with a filler) and a frame in; the completion it makes and its seconds out, and what a protocol gives."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dlama.completion.completion import Completion
from dlama.completion.pipeline import complete
from dlama.completion.recipes import check_seed, find_recipe
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill

NO_FILL = "none"
"""The filler of the baseline that fills nothing: holes stay black and without depth."""


@dataclass(frozen=True)
class Method:
    """One column of a table: a recipe, a filler and the filler's network file."""

    recipe: str
    filler: str
    """A name of `dlama.inpainters`, or NO_FILL."""
    model: Path | None = None
    seed: int = 0
    """0 to 2**32 - 1; else InputError."""

    def __post_init__(self) -> None:
        check_seed(self.seed)

    @property
    def label(self) -> str:
        """`recipe/filler`, as tables name it."""
        return f"{self.recipe}/{self.filler}"

    @property
    def fills(self) -> bool:
        """False for the baseline that leaves holes black and without depth."""
        return self.filler != NO_FILL


@dataclass(frozen=True)
class ProtocolSettings:
    """How much of a protocol is run, and what decides about its numbers besides the metrics' own settings."""

    object_dilations: tuple[int, ...] = (0, 3, 9)
    """VPI, the paper's second experiment: the object mask's dilations in px, one run each; empty: it is left out."""
    mask_changes: tuple[int, ...] = (-9, -6, -3, 3, 6, 9)
    """ORI: px by which the mask is dilated (or eroded, below 0) to see what that does, one run each; empty: left out."""
    ring_px: int = 16
    """ORI: width of the ring round the mask; beyond it nothing may change."""
    matched_stereo: bool = True
    """SII without masks: one more run in which the method has to find the disparity itself."""
    smallest_region: int = 50
    """Pixels; a smaller region gets no row."""
    lpips: bool = True
    """Measure LPIPS, by far the most expensive metric."""


class Measure(NamedTuple):
    """One number of results.csv, without the columns that the case and the method give."""

    region: str
    """whole, seen, unseen, disoccluded, out-of-view, object, mask, ring, outside, shadow; with `-right` in a pair's
    right view."""
    modality: str
    """rgb, depth (8 bit, as the paper shows it), depth_m, cloud, disparity, time, memory."""
    metric: str
    """Lower case: ssim, lpips, mse, psnr, mae, absrel, delta1.05, ..."""
    value: float


def measures_of(region: str, modality: str, values: Mapping[str, float | None]) -> list[Measure]:
    """A measure of each value, by metric, but those that are not known (None, nan)."""
    known = {metric: value for metric, value in values.items() if value is not None and not np.isnan(value)}
    return [Measure(region, modality, metric, float(value)) for metric, value in known.items()]


@dataclass(frozen=True, eq=False)
class Scored:
    """One run of a method on a case, measured."""

    measures: tuple[Measure, ...]
    variant: str = ""
    """What differs from the method as named (`object,dilate=3`, `mask+3`); empty for the run itself. Joined to the recipe
    with a `+` in results.csv."""
    panel: UInt8Array | None = None
    """H x W x 3, a strip of small pictures for the report (`dlama.evaluation.protocols.strips`)."""
    view: View | None = None
    """What is scored, of the run itself; of a pair its left view."""


Score = Callable[[Any, Method, ProtocolSettings], Sequence[Scored]]
"""A case's truth in; its runs out: the first is the plain one and has the panel, the others have a variant. A module's function,
so that it travels to another process. Raises InputError and its kin."""


@dataclass(frozen=True, eq=False)
class MethodRun:
    """What a method made of a case. Views are in the order of the cameras; -1 is the last."""

    method: Method
    completion: Completion
    seconds: float
    """Wall-clock seconds of the completion."""

    def view(self, number: int = -1) -> View:
        """The completed view, or for the baseline the one before filling."""
        return self.completion.views[number] if self.method.fills else self.completion.warped[number]

    @property
    def clip_m(self) -> float | None:
        """Metres at which the recipe cuts depth; None: nowhere."""
        return find_recipe(self.method.recipe).clip

    def timing(self) -> Measure:
        """Wall-clock seconds of the completion."""
        return Measure("whole", "time", "seconds", self.seconds)

    def hole_shares(self, number: int = -1, suffix: str = "") -> list[Measure]:
        """The method's own holes in % of the picture: of colour, and of depth (a sensor hole lacks depth only)."""
        warped = self.completion.warped[number]
        return [
            Measure("whole" + suffix, modality, "mask_ratio", 100 * float(hole.mean()))
            for modality, hole in (("rgb", warped.color_hole), ("depth", warped.hole))
        ]


def run_method(
    method: Method, source: RGBD, camera: Camera, mask: BoolArray | None = None, **changes: Any
) -> MethodRun:
    """One new view or removal by `dlama.completion.pipeline.complete`.

    The baseline is rendered from what was measured alone, so nothing is filled in its source view either.

    Args:
        camera: of the new view.
        mask: H x W of the source, True = the object to remove; None: nothing is removed.
        changes: fields of the recipe that differ.
    Raises:
        InputError, FileError and all else that `complete` raises.
    """
    if not method.fills:
        changes = {**changes, "source_first": False}
    return timed_run(method, lambda **how: complete(source, [camera], mask=mask, **how), **changes)


def timed_run(method: Method, verb: Callable[..., Completion], **changes: Any) -> MethodRun:
    """What a verb makes with the recipe (and these changes of it), filler, model and seed of a method."""
    how: dict[str, Any] = {"filler": method.filler, "model": method.model} if method.fills else {"filler": no_fill}
    started = time.perf_counter()
    done = verb(recipe=find_recipe(method.recipe, **changes), seed=method.seed, **how)
    return MethodRun(method, done, time.perf_counter() - started)


def no_fill(view: View, context: FillContext, seed: int) -> Fill:
    """The baseline's filler, whose fill nobody reads: black, and far."""
    return Fill(np.zeros_like(view.color), np.full(view.depth.shape, np.inf, np.float32))
