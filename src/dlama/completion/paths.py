"""A scene and a path of cameras in; one view after the other out, holes filled once, so that nothing flickers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from dlama.arguments import check_arguments
from dlama.completion.options import Options
from dlama.completion.pipeline import complete
from dlama.completion.start import choose_filler, plan_for
from dlama.completion.steps import fill, with_edge_law
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.fusion import fuse
from dlama.geometry.rendering import render
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters import AUTO, find_filler
from dlama.inpainters.filling import Inpainter

KEYS, CAMERAS_PER_KEY = 9, 5
"""Cameras of a path, evenly, for which the scene is filled before any view is made: so many at most, one in so many."""
SLIVERS = 2e-3
"""Share of a view up to which AUTO fills what is still open by Telea: between cameras that were filled first little is."""
KEPT = 2e-4
"""Share of a view: what is left open and more than this becomes part of the scene, too."""


def render_path(
    scene: Scene,
    cameras: Sequence[Camera],
    *,
    filler: str | Inpainter = AUTO,
    model: str | Path | None = None,
    seed: int = 0,
) -> Iterator[View]:
    """The views of a path, in order, each as it is asked for.

    The scene is filled for some cameras of the path first, and all views show that: a filled point looks the same in all of them.
    What is still open in a view is filled and seen by those after it.

    Args:
        scene: Of `scene`, of a completion, or of `read_scene`.
        cameras: The path, in the scene's world.
        filler, model, seed: As in `complete`.
    Raises:
        InputError: no cameras, an unknown name.
    """
    check_arguments(render_path, locals())
    if not cameras:
        raise InputError("cameras is empty; a path of one camera or more is expected")
    inpainter = find_filler(choose_filler(scene, filler, model).filler, model)
    return _views(scene, list(cameras), inpainter, find_filler("telea") if filler == AUTO else inpainter, seed)


def _views(scene: Scene, cameras: list[Camera], filler: Inpainter, of_slivers: Inpainter, seed: int) -> Iterator[View]:
    keys = min(KEYS, max(2, len(cameras) // CAMERAS_PER_KEY))
    places = sorted({round(number * (len(cameras) - 1) / (keys - 1)) for number in range(keys)})
    whole = complete(scene, [cameras[place] for place in places], filler=filler, seed=seed).scene
    plan, _, _ = plan_for(whole, Options(filler=filler, seed=seed))
    for camera in cameras:
        open_view = render(whole, camera)
        share = float(open_view.hole.mean())
        chosen = replace(plan, inpainter=of_slivers) if share <= SLIVERS else plan
        view, _ = fill(with_edge_law(chosen, whole, camera), open_view)
        if share > KEPT:
            whole = fuse(whole, view, known=~open_view.hole)
        yield view
