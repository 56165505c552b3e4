"""What a completion was given, what its steps did, and how long they took, in; its meta data, JSON-ready, and one-line warnings
(UserWarning) of the likeliest mistakes out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from dlama.completion.meta_data import MetaData
from dlama.completion.start import Plan
from dlama.errors import warn
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, from_filler
from dlama.geometry.drawing.grid_mesh import find_joints
from dlama.geometry.frames.removal import NO_DILATION, Dilation
from dlama.geometry.projection import px_from_px
from dlama.geometry.rgbd import PLAUSIBLE_M, RGBD, Float32Array, UInt8Array, is_valid
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.filling import FillReport
from dlama.progress import begin_stage

MOST_UNKNOWN = 0.5
"""Share of a view: where more is unknown, depth and the camera's move do not fit together."""
BEYOND_TURN = 0.1
"""Share of a view that may be unknown beyond what the camera's turn alone shows anew (measured: right depth stays 0.05 below)."""
AXES = "`world_from_cam` is expected to be camera to world, with x right, y down, z forward"
EVERY = 4
"""Rows and columns between the pixels of which a median is taken."""
SHADOW_SHOWN = 0.02
"""Pixels of a remaining shadow, over those of the removed object, from which it is reported."""


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


def meta_data(
    plan: Plan,
    frame: View,
    warped: Sequence[View],
    fills: Sequence[FillReport],
    seconds: dict[str, float],
    mask: Dilation = NO_DILATION,
    holes: Sequence[Dilation] = (),
) -> MetaData:
    """The meta data of a completion.

    frame: the first one; warped: the views before filling; fills: what the steps reported, in their order; seconds: by stage;
    mask, holes: how the object mask and the hole of each view grew.
    """
    filled, moved, broken = (
        sum(getattr(one, name) for one in fills) for name in ("hole_pixels", "law_moves", "law_violations")
    )
    return {
        "recipe": dataclasses.asdict(plan.recipe),
        "filler": plan.filler,
        "decisions": {name: dict(decision) for name, decision in plan.decisions.items()},
        "seed": plan.seed,
        "hole_share": [share(view.color_hole) for view in warped],
        "depth_only_share": [share(view.depth_hole) for view in warped],
        "hole_share_by_type": [hole_shares(view.hole_type) for view in warped],
        "dilation": {
            "kernel": "disc of the radius given in the recipe",
            "mask_pixels": mask.pixels,
            "mask_known_pixels_given_up": mask.known_pixels_given_up,
            "hole_pixels_before": [hole.pixels for hole in holes],
            "hole_known_pixels_given_up": [hole.known_pixels_given_up for hole in holes],
        },
        "flying_pixels_rejected": flying_pixels(frame, warped),
        "filled_pixels": filled,
        "law_moves": moved,
        "law_violations": broken,
        "nothing_visible": any(one.notes.get("nothing_visible") for one in fills),
        "seconds": seconds,
        "notes": notes_of(fills),
    }


def flying_pixels(frame: View, warped: Sequence[View]) -> int:
    """Of a frame, which is drawn without them where a view is of another camera; else 0."""
    if all(view.camera.same_view_as(frame.camera) for view in warped):
        return 0
    return int(frame.find_once(find_joints).flying.sum())


def notes_of(fills: Sequence[FillReport]) -> dict[str, Any]:
    """What the fillers add; the last one's counts, but of a remaining shadow those of the frame that the object was removed from,
    which is filled first."""
    found = {name: note for one in fills for name, note in one.notes.items()}
    shadows = [one.notes["remaining_shadow_px"] for one in fills if "remaining_shadow_px" in one.notes]
    return found | {"remaining_shadow_px": shadows[0]} if shadows else found


def describe_remaining_shadow(meta: Mapping[str, Any]) -> str:
    """How many pixels look like the removed object's shadow and stay; "" where few do."""
    grown = meta["dilation"]
    removed = grown["mask_pixels"] + grown["mask_known_pixels_given_up"]
    return describe_shadow(meta["notes"].get("remaining_shadow_px", 0), removed)


def describe_shadow(pixels: int, removed: int) -> str:
    """The same, of pixels of the shadow and of the removed object."""
    few = not removed or pixels < max(1, SHADOW_SHOWN * removed)
    return "" if few else f"{pixels} pixels next to the object look like its shadow and stay"


def hole_shares(hole_type: UInt8Array) -> dict[str, float]:
    """Share of the picture (0..1) by hole type (H x W HoleType codes), holes filled or not."""
    counts = np.bincount(hole_type[hole_type > 0], minlength=len(HoleType))
    return {kind.name.lower(): float(counts[kind]) / hole_type.size for kind in HoleType if kind}


def expected_errors(views: Sequence[View]) -> MetaData:
    """`expected_error` of meta.json: means over what was filled in each view, of depth in metres (where that is finite) and of
    colour in levels; None where nothing was, or nothing expects an error."""
    depths, colors = [], []
    for view in views:
        known = view.errors is not None
        painted, filled = view.filled & known, from_filler(view.origin) & ~view.hole & known
        metres = view.depth_error[filled & np.isfinite(view.depth_error)]
        depths.append(round(float(metres.mean(dtype=np.float64)), 5) if metres.size else None)
        colors.append(round(float(view.color_error[painted].mean(dtype=np.float64)), 3) if painted.any() else None)
    return {"expected_error": {"depth_m": depths, "color_levels": colors}}


def share(where: np.ndarray) -> float:
    """Share of a bool picture that is True, 0..1."""
    return round(float(where.mean()), 6)


def warn_of_scale(depth: Float32Array) -> None:
    """Depth (H x W) that can hardly be metres, or that is missing everywhere."""
    median = median_depth(depth)
    if not (depth > 0).any():
        warn(
            "no pixel has a depth (0 and NaN are missing): nothing is known from elsewhere, and filled depth is a guess"
        )
    elif median > PLAUSIBLE_M[1]:
        warn(
            f"the median depth is {median:.4g} m: metres are expected; divide millimetres by 1000 (`depth_scale=1000` of a file)"
        )
    elif 0 < median < PLAUSIBLE_M[0]:
        warn(
            f"the median depth is {median:.4g} m: metres are expected; check the clip, the known depth of an estimate, or the "
            "baseline of a stereo pair"
        )


def warn_of_disparity(rgbd: RGBD, limit: float | None) -> None:
    """A pair of which all is as far as the sky; or most, of a disparity that was given and a `far` that was not. limit: metres of
    that default."""
    far, valid = np.count_nonzero(rgbd.far), np.count_nonzero(rgbd.valid)
    if far and not valid:
        warn(
            "all of the pair is far: its disparities are next to nothing; check their unit (`disparity_scale` of a file), the "
            "order of the pictures and the calibration"
        )
    elif limit is not None and far > valid:
        warn(
            f"{far / (far + valid):.0%} of the pair is far: from {limit:.3g} m on disparities are less than half a pixel, which "
            "counts as infinity; where they are as exact as that, give `far`"
        )


def warn_of_nothing(depth: Float32Array, views: Sequence[View], holes: Sequence[Dilation], scene: Scene) -> None:
    """Completed views that show nothing, although the depth (H x W) is none that `warn_of_scale` names. holes: how each one's
    hole grew; scene: the completed one."""
    empty = [number for number, view in enumerate(views) if view.hole.all()]
    if not empty or median_depth(depth) < PLAUSIBLE_M[0]:
        return
    which = f" {', '.join(str(number + 1) for number in empty)} of {len(views)}" if len(views) > 1 else ""
    if any(holes[number].known_pixels_given_up for number in empty):
        warn(f"`dilate_holes` leaves nothing of the view{which}, so nothing could be filled; fewer pixels are expected")
    elif all(frame.load().hole.all() for frame in scene.frames):
        warn("no pixel next to the removed object has a depth, so nothing could be filled; depth around it is expected")
    else:
        warn(f"nothing of the scene is visible from the camera{which}, so nothing could be filled; {AXES}")


def warn_of_unknown(camera: Camera, depth: Float32Array, warped: Sequence[View]) -> None:
    """A view of which hardly anything is known, removed objects aside, although the camera has hardly turned away from what the
    picture (its camera, its depth: H x W metres) shows."""
    shares = [float((view.color_hole & ~view.object_hole).mean()) for view in warped]
    odd = [
        share
        for share, view in zip(shares, warped)
        if MOST_UNKNOWN < share < 1 and share > share_out_of_view(camera, view.camera) + BEYOND_TURN
    ]
    if not odd:  # of nothing at all `warn_of_nothing` speaks
        return
    median = median_depth(depth)
    warn(
        f"{100 * max(odd):.0f} % of the view is unknown, with a median depth of {median:.3g} m: if the scene is not that "
        "near or far, its scale is wrong (see `depth_scale`: TUM 5000, KITTI 256, millimetres 1000); else move the camera less; "
        f"{AXES}"
    )


def share_out_of_view(source: Camera, target: Camera) -> float:
    """Share of the target's pixels (0..1) whose direction the source's picture does not hold: unknown by its turn alone."""
    columns, rows = np.meshgrid(np.arange(0, target.width, EVERY) + 0.5, np.arange(0, target.height, EVERY) + 0.5)
    x, y, ahead = px_from_px(source, target)[0] @ np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
    front = ahead > 0
    x, y = x[front] / ahead[front], y[front] / ahead[front]
    inside = (x >= 0) & (x < source.width) & (y >= 0) & (y < source.height)
    return 1 - float(inside.sum()) / columns.size


def median_depth(depth: Float32Array) -> float:
    """Metres, of some of the valid pixels (depth: H x W); 0 where there are none."""
    some = depth[::EVERY, ::EVERY]
    valid = some[is_valid(some)]
    return float(np.median(valid)) if valid.size else 0.0
