"""What the steps of a completion did, and how long they took, in; its meta data, JSON-ready, out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from dlama.completion.start import NO_DILATION, Dilation, Plan
from dlama.geometry.codes import HoleType, from_filler
from dlama.geometry.rendering import find_flying_pixels
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport
from dlama.progress import begin_stage


class Clock:
    """Seconds by stage. `with clock("fill"):` reports the stage as it begins and adds what it took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        begin_stage(stage)
        started = time.perf_counter()
        yield
        self.seconds[stage] = round(self.seconds.get(stage, 0.0) + time.perf_counter() - started, 4)


@dataclass(frozen=True)
class Record:
    """What the steps of one completion reported, in their order."""

    fills: Sequence[FillReport]
    seconds: dict[str, float]
    mask: Dilation = NO_DILATION
    """How the object mask grew."""
    holes: Sequence[Dilation] = ()
    """How the hole of each view grew."""

    @property
    def notes(self) -> dict[str, Any]:
        """What the fillers add; the last one's counts."""
        return {name: note for one in self.fills for name, note in one.notes.items()}

    def total(self, name: str) -> int:
        """Of all fills: the pixels in that field of `FillReport`."""
        return sum(getattr(one, name) for one in self.fills)


def meta_data(plan: Plan, source: View, warped: Sequence[View], record: Record) -> dict[str, Any]:
    """The meta data of a completion, JSON-ready (fields: docs/reference/formats.md). source: the first frame, as it was drawn;
    warped: the views before filling."""
    moved = any(not view.camera.same_view_as(source.camera) for view in warped)
    return {
        "recipe": dataclasses.asdict(plan.recipe),
        "filler": plan.filler,
        "decisions": {name: dict(decision) for name, decision in plan.decisions.items()},
        "seed": plan.seed,
        "hole_share": [share(view.color_hole) for view in warped],
        "depth_only_share": [share(view.depth_hole) for view in warped],
        "hole_share_by_type": [hole_shares(view) for view in warped],
        "dilation": {
            "kernel": "disc of the radius given in the recipe",
            "mask_pixels": record.mask.pixels,
            "mask_known_pixels_given_up": record.mask.known_pixels_given_up,
            "hole_pixels_before": [hole.pixels for hole in record.holes],
            "hole_known_pixels_given_up": [hole.known_pixels_given_up for hole in record.holes],
        },
        "flying_pixels_rejected": int(find_flying_pixels(source).sum()) if moved else 0,
        "filled_pixels": record.total("hole_pixels"),
        "law_moves": record.total("law_moves"),
        "law_violations": record.total("law_violations"),
        "nothing_visible": any(one.notes.get("nothing_visible") for one in record.fills),
        "seconds": record.seconds,
        "notes": record.notes,
    }


def hole_shares(view: View) -> dict[str, float]:
    """Share of the picture (0..1) by hole type, holes filled or not."""
    counts = np.bincount(view.hole_type[view.hole_type > 0], minlength=len(HoleType))
    return {kind.name.lower(): float(counts[kind]) / view.hole_type.size for kind in HoleType if kind}


def depth_source(rgbd: RGBD) -> dict[str, Any]:
    """Where the depth of the source comes from, for meta.json: `depth`, measured or estimated; `depth_estimate`, how."""
    if rgbd.estimate is None:
        return {"depth": "measured"}
    return {"depth": "estimated", "depth_estimate": dict(rgbd.estimate)}


def about_depth(rgbd: object, scene: Scene) -> dict[str, Any]:
    """For meta.json: where the depth of a scene, made of `rgbd`, comes from; of many frames their numbers, gains and
    noise."""
    if isinstance(rgbd, RGBD):
        return depth_source(rgbd)
    about: dict[str, Any] = {"depth": "estimated" if scene.has_estimated_depth else "measured"}
    if len(scene.frames) > 1:
        about["frames"] = {
            "numbers": list(scene.numbers),
            "gains": [[round(gain, 4) for gain in gains] for gains in scene.gains],
            "noise": {"metres": scene.noise[0], "per_metre": scene.noise[1]},
        }
    return about


def expected_errors(views: Sequence[View]) -> dict[str, Any]:
    """`expected_error` of meta.json: means over what was filled in each view, of depth in metres (where that is finite) and of
    colour in levels; None where nothing was."""
    depths, colors = [], []
    for view in views:
        painted, filled = view.filled, from_filler(view.origin) & ~view.hole
        metres = view.depth_error[filled & np.isfinite(view.depth_error)]
        depths.append(round(float(metres.mean(dtype=np.float64)), 5) if metres.size else None)
        colors.append(round(float(view.color_error[painted].mean(dtype=np.float64)), 3) if painted.any() else None)
    return {"expected_error": {"depth_m": depths, "color_levels": colors}}


def share(where: np.ndarray) -> float:
    """Share of a bool picture that is True, 0..1."""
    return round(float(where.mean()), 6)
