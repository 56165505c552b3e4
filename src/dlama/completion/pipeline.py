"""The method on one screen: RGB-D and cameras in; completed views and a completed scene out (paper, fig. 2).

reposition (eq. 1) -> render, mask (eq. 2-4) -> fill (sec. 3.3) -> fuse (eq. 10, 11)
Of a path of cameras, holes are filled once, so that nothing flickers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from dlama.arguments import check_arguments
from dlama.completion.completion import Completion
from dlama.completion.options import OptionKeywords, Options, Unpack, options_of, take_options
from dlama.completion.recipes import check_seed
from dlama.completion.report import (
    Clock,
    expected_errors,
    meta_data,
    warn_of_nothing,
    warn_of_scale,
    warn_of_unknown,
)
from dlama.completion.start import choose_filler, plan_for
from dlama.completion.steps import complete_views
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.frames.gathering import FrameSource
from dlama.geometry.fusion import fuse
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters import AUTO, find_filler
from dlama.inpainters.filling import Inpainter, inpaint
from dlama.models.network_file import make_room
from dlama.progress import Progress, take_progress


@take_options
@take_progress
def complete(
    rgbd: RGBD | Scene | Sequence[FrameSource],
    cameras: Sequence[Camera],
    *,
    mask: BoolArray | Mapping[int, BoolArray] | None = None,
    progress: Progress | None = None,
    **options: Unpack[OptionKeywords],
) -> Completion:
    """Complete the scene of one RGB-D picture, or of many frames, from several cameras, one after the other, into one Scene.

    Each camera sees what the earlier ones filled, so that views agree. Of many frames only what none of them saw is filled.

    Args:
        rgbd: The picture with metric depth; posed frames of one scene (or functions that read them); or a scene: of `scene`, of a
            completion, which is gone on from, or of `read_scene`.
        cameras: Where to look from, in the world of the picture's camera.
        mask: H x W bool, True = remove, or number of a frame -> its mask: as of `Scene.without`, which it stands for.
        progress: Called with the name of each stage as it begins; what it raises ends the work.
        options: How the scene is completed (`Options`). meta says what `auto` and `dilate` chose, and why.

    Raises:
        InputError: no camera, an unknown name, options in contradiction, too large views, a mask of no use (MaskError).
    """
    check_arguments(complete, locals())
    chosen = options_of(options)
    if not cameras and mask is None:
        raise InputError("cameras is empty; one camera or more is expected (rgbd.camera is the picture's own)")
    if isinstance(rgbd, Scene) and (clip := chosen.settings.clip) is not None:
        raise InputError(f"`clip` is {clip} m: a scene cannot be clipped; give its frames instead")
    clock = Clock()
    with clock("prepare"):
        start = plan_for(rgbd, chosen, mask, cameras)
    source = start.given.frames[0].load()
    warn_of_scale(source.depth)
    make_room(source.camera.width * source.camera.height)
    completed, fills, scene = complete_views(start.plan, start.scene, cameras, clock)
    make_room(source.camera.width * source.camera.height)
    views, warped = tuple(one.view for one in completed), tuple(one.before for one in completed)
    grown, first = [one.grown for one in completed], scene.frames[0].load()
    warn_of_nothing(source.depth, views, grown, scene)
    if mask is None:
        warn_of_unknown(source.camera, source.depth, warped)
    meta = meta_data(start.plan, first, warped, fills, clock.seconds, start.mask, grown)
    meta = start.about | meta | expected_errors(views)
    return Completion(views, warped, scene, source, meta).with_min_confidence(chosen.min_confidence)


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
    check_seed(seed)
    inpainter = choose_filler(scene.has_estimated_depth, filler, model).inpainter
    return _views(scene, list(cameras), inpainter, find_filler("telea") if filler == AUTO else inpainter, seed)


def _views(scene: Scene, cameras: list[Camera], filler: Inpainter, of_slivers: Inpainter, seed: int) -> Iterator[View]:
    keys = min(KEYS, max(2, len(cameras) // CAMERAS_PER_KEY))
    places = sorted({round(number * (len(cameras) - 1) / (keys - 1)) for number in range(keys)})
    whole = complete(scene, [cameras[place] for place in places], filler=filler, seed=seed).scene
    plan = plan_for(whole, Options(filler=filler, seed=seed)).plan
    for camera in cameras:
        open_view = render(whole, camera)
        share = float(open_view.hole.mean())
        context = plan.context.near(camera)
        law = context.law.with_aligned_edges(whole)
        view, _ = inpaint(
            open_view, of_slivers if share <= SLIVERS else plan.inpainter, replace(context, law=law), seed
        )
        if share > KEPT:
            whole = fuse(whole, view, known=~open_view.hole)
        yield view
