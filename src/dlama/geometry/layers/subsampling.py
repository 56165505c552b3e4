"""A layer of a scene in; the same with one pixel in place of step x step of them out."""

from __future__ import annotations

import dataclasses
import math

import cv2
import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.holes import shrink_known
from dlama.geometry.rgbd import freeze
from dlama.geometry.scene import Scene
from dlama.geometry.view import View


def step_for(count: float, most: float) -> int:
    """The step of subsampling that leaves about `most` of `count` pixels, or fewer."""
    return max(1, math.ceil(math.sqrt(count / max(most, 1.0))))


def subsample_scene(scene: Scene, step: int) -> Scene:
    """The scene with every layer and removal subsampled; those of which nothing is left are left out."""
    if step == 1:
        return scene
    frames, removals, fills = (
        tuple(subsample(one.load(), step) for one in layers if min(one.camera.hw) >= step)
        for layers in (scene.frames, scene.removals, scene.fills)
    )
    return dataclasses.replace(scene, frames=frames, removals=removals, fills=fills)


def subsample(view: View, step: int) -> View:
    """Each pixel that is kept stands for step x step of them: it has the mean of their known colours, and the depth, origin and
    confidence of the middle one. Rows and columns that make up no whole pixel are left out. Step 1 gives the view back."""
    if step == 1:
        return view
    rows, columns = (side // step * step for side in view.camera.hw)
    middle = slice(step // 2, rows, step), slice(step // 2, columns, step)
    color, known = view.color[:rows, :columns], ~view.color_hole[:rows, :columns]
    size = columns // step, rows // step
    if known.all():
        color = np.asarray(cv2.resize(color, size, interpolation=cv2.INTER_AREA), np.uint8)
    else:
        color = np.rint(shrink_known(color, known, size)[0]).astype(np.uint8)
    color[view.color_hole[middle]] = 0
    planes = view.planes_at(middle) | {"color": freeze(color)}
    return dataclasses.replace(view, camera=subsample_camera(view.camera, step, color.shape[:2]), **planes)


def subsample_camera(camera: Camera, step: int, hw: tuple[int, int]) -> Camera:
    """The camera whose pixel centres are those of the middle pixels (`step // 2` in each step x step)."""
    shift = step // 2 + 0.5
    return dataclasses.replace(
        camera,
        width=hw[1],
        height=hw[0],
        fx=camera.fx / step,
        fy=camera.fy / step,
        cx=(camera.cx - shift) / step + 0.5,
        cy=(camera.cy - shift) / step + 0.5,
    )
