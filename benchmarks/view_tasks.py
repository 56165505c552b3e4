"""Photos and worlds as seen from another place in -> views with holes as fillers get them, with their truth, out.

Views are those of run time: `complete` itself renders them, and a filler that only looks records what it is asked to fill.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.completion.pipeline import complete
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import dolly, median_pivot, orbit
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill
from dlama.inpainters.layered.filler import layered
from dlama.perception.monocular import estimate_depth
from dlama.training.data.photos import read_photo, square_crop

SMALLEST = 256
"""Height and width of a photo's square in pixels, at least."""


@dataclass(frozen=True, eq=False)
class FillTask:
    """What a filler was asked to fill, and the truth."""

    view: View
    context: FillContext
    truth: RGBD


def pipeline_tasks(source: RGBD, camera: Camera, truths: Sequence[RGBD]) -> list[FillTask]:
    """The views that `complete` has filled, those whose truth is given."""
    found: list[FillTask] = []

    def look(view: View, context: FillContext, seed: int) -> Fill:
        found.extend(FillTask(view, context, truth) for truth in truths if truth.camera.same_view_as(view.camera))
        if view.camera.same_view_as(source.camera):
            return layered(view, context, seed)  # the camera may move from here
        return Fill(view.color, np.ones(view.hole.shape, np.float32))

    complete(source, [camera], filler=look)
    return found


def photo_task(photo: Path, size: int, rng: np.random.Generator) -> FillTask:
    """A photo as seen from another camera and back: holes are what that camera does not see, by estimated depth."""
    stored = read_photo(photo)
    size = max(SMALLEST, min(size, *stored.shape[:2]))  # not enlarged: blurred truth would teach blur
    picture = square_crop(stored, size, rng)
    frame = estimate_depth(picture, Camera.from_fov(size, size, float(rng.uniform(50, 85)))).rgbd
    pivot = median_pivot(frame.depth) * float(rng.uniform(0.7, 1.5))
    yaw, pitch = float(rng.uniform(4, 45) * rng.choice((-1, 1))), float(rng.uniform(-5, 8))
    away = dolly(orbit(frame.camera, yaw, pitch, pivot), float(rng.uniform(-0.2, 0.3)) * pivot)
    seen = render(frame, away)
    back = render(seen, frame.camera)
    color = np.where(back.hole[..., None], np.uint8(0), picture)
    view = dataclasses.replace(back, color=color)
    return FillTask(view, FillContext(Law(())), RGBD(picture, frame.depth, frame.camera))
