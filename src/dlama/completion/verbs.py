"""The two jobs on one picture: an RGB-D picture and where to look from (and what to take out) in; the completed scene out."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from dlama.completion.pipeline import Completion, complete
from dlama.completion.recipes import Recipe
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.trajectories import PIVOT_M, median_pivot, orbit
from dlama.geometry.trajectories import dolly as dollied
from dlama.inpainters.filling import Inpainter


def target_camera(
    rgbd: RGBD,
    camera: Camera | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    pivot: float | Literal["auto"] = PIVOT_M,
    dolly: float = 0.0,
) -> Camera:
    """The camera to go to: `camera` itself, or the source camera orbited (degrees) about `pivot` (m) and dollied (m).

    Positive yaw moves the camera to its right around the pivot, positive pitch up; a positive dolly moves it forward.
    """
    if camera is not None:
        if yaw or pitch or dolly:
            raise InputError("a target camera and an orbit or dolly were both given; one of them is wanted")
        return camera
    distance = median_pivot(rgbd.depth) if pivot == "auto" else float(pivot)
    return dollied(orbit(rgbd.camera, yaw, pitch, distance), dolly)


def view(
    rgbd: RGBD,
    camera: Camera | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    pivot: float | Literal["auto"] = PIVOT_M,
    dolly: float = 0.0,
    filler: str | Inpainter = "layered",
    model: str | Path | None = None,
    recipe: str | Recipe = "dlama",
    seed: int = 0,
    **changes: Any,
) -> Completion:
    """The scene from another viewpoint, holes filled in colour and depth. Arguments as `target_camera` and `complete`."""
    target = target_camera(rgbd, camera, yaw=yaw, pitch=pitch, pivot=pivot, dolly=dolly)
    return complete(rgbd, [target], filler=filler, model=model, recipe=recipe, seed=seed, **changes)


def remove(
    rgbd: RGBD,
    mask: BoolArray,
    camera: Camera | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    pivot: float | Literal["auto"] = PIVOT_M,
    dolly: float = 0.0,
    filler: str | Inpainter = "layered",
    model: str | Path | None = None,
    recipe: str | Recipe = "dlama",
    seed: int = 0,
    **changes: Any,
) -> Completion:
    """The scene without the object under `mask` (H x W bool), from the source camera or from elsewhere."""
    target = target_camera(rgbd, camera, yaw=yaw, pitch=pitch, pivot=pivot, dolly=dolly)
    return complete(rgbd, [target], mask=mask, filler=filler, model=model, recipe=recipe, seed=seed, **changes)
