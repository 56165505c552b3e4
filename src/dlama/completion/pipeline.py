"""The method on one screen: RGB-D and cameras in; completed views and a completed scene out (paper, fig. 2).

reposition (eq. 1) -> render, mask (eq. 2-4) -> fill (sec. 3.3) -> fuse (eq. 10, 11)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from dlama.arguments import check_arguments
from dlama.completion.completion import Completion
from dlama.completion.frames.filling import fill_first
from dlama.completion.frames.removal import take_out_of, with_halo
from dlama.completion.frames.sources import about_source, filler_for, starting_scene
from dlama.completion.memory import check_memory
from dlama.completion.plausible import warn_of_scale, warn_of_unknown
from dlama.completion.recipes import DepthBy, Recipe, checked_confidence, checked_seed, find_recipe
from dlama.completion.report import Clock, Record, expected_errors, meta_data
from dlama.completion.steps import (
    CompletedView,
    Plan,
    complete_view,
    filler_of_recipe,
    law_of,
)
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.frames.gathering import FrameSource
from dlama.geometry.frames.stored import StoredView
from dlama.geometry.rendering import Mode
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters import AUTO, find_filler
from dlama.inpainters.filling import FillReport, Inpainter


def complete(
    rgbd: RGBD | Scene | Sequence[FrameSource],
    cameras: Sequence[Camera],
    *,
    mask: BoolArray | Mapping[int, BoolArray] | None = None,
    filler: str | Inpainter = AUTO,
    model: str | Path | None = None,
    recipe: str | Recipe = "dlama",
    mode: Mode | None = None,
    dilate: int | None = None,
    dilate_holes: int | None = None,
    clip: float | None = None,
    depth_by: DepthBy | None = None,
    seed: int = 0,
    min_confidence: float = 0.0,
) -> Completion:
    """Complete the scene of one RGB-D picture, or of many frames, from several cameras, one after the other, into one Scene.

    Each camera sees what the earlier ones filled, so that views agree. Of many frames only what none of them saw is filled.

    Args:
        rgbd: The picture with metric depth; or posed frames of one scene (or functions that read them), or `scene` of them.
        cameras: Where to look from, in the world of the picture's camera.
        mask: H x W bool, True = remove: takes an object out everywhere. Of many frames: number of a frame -> its mask, for one
            frame or several; the other frames' masks follow from the thing's shape.
        filler: What fills the holes: a name, or a function (view, law, seed) -> Fill. "auto": `layered`;
            `layered-patches` where a depth camera measured the depth, `patchmatch` where a network estimated it.
        model: The network file of a filler that runs one.
        recipe: `dlama`, `paper` or a Recipe. The next five replace single settings of it; None leaves them.
        mode: "surface" (the pixel grid as triangles, cut at depth edges) or "points" (each pixel to the nearest one).
        dilate: px by which the mask grows. None: the recipe's; `dlama` adds 3 px to it where depth edges lie beside those of
            a masked picture, as a depth camera's do: compression and blur spread colours. meta.json has the sum.
        dilate_holes: px by which the holes of the new views grow.
        clip: metres; everything at or beyond, sky too, is put there.
        depth_by: "surfaces" or "filler": what fills depth beside a filler of pictures.
        seed: Fillers draw their random numbers from it; the same seed gives the same bits.
        min_confidence: 0..1; what is filled and less sure stays open at the end, in views and scene.

    Raises:
        InputError: no camera, an unknown name, options in contradiction, too large views, a mask of no use (MaskError).
    """
    check_arguments(complete, locals())
    chosen = find_recipe(recipe, mode=mode, dilate=dilate, dilate_holes=dilate_holes, clip=clip, depth_by=depth_by)
    checked_seed(seed)
    checked_confidence(min_confidence)
    if not cameras and mask is None:
        raise InputError("cameras is empty; one camera or more is wanted (rgbd.camera is the picture's own)")
    start = starting_scene(rgbd, chosen)
    source = start.layers[0]
    check_memory((*(one.camera for one in start.measured if not isinstance(one, StoredView)), *cameras))
    warn_of_scale(source)
    filler = filler_for(start, filler)
    inpainter = filler_of_recipe(find_filler(filler, model), chosen)
    if dilate is None and recipe == "dlama":
        chosen = with_halo(chosen, start, mask)
    given, grown_mask = take_out_of(start, mask, chosen.dilate)
    plan = Plan(chosen, inpainter, seed, given, law_of(given, chosen))
    clock = Clock()
    with clock("fill"):
        scene, source_fills = fill_first(plan, start, cameras)
    completed: list[CompletedView] = []
    for camera in cameras:
        found, scene = complete_view(plan, scene, camera, clock)
        completed.append(found)
    views, warped = tuple(one.view for one in completed), tuple(one.before for one in completed)
    if mask is None:
        warn_of_unknown(source, warped)
    fills = [*source_fills, *(report for one in completed for report in one.reports)]
    record = Record(fills, clock.seconds, grown_mask, [one.grown for one in completed])
    meta = about_source(rgbd, start) | meta_data(plan, filler, source, warped, record) | expected_errors(views)
    choices = tuple(choice_of(one, source, source_fills) for one in completed)
    return Completion(views, warped, scene, source, meta, choices=choices).with_min_confidence(min_confidence)


def choice_of(completed: CompletedView, source: View, source_fills: Sequence[FillReport]) -> UInt8Array | None:
    """H x W: the number of the guess that counts most in each pixel (`Fill.choice`), of a filler that chooses; else None.

    At the source's own camera that of the source's fill, where nothing was left to fill.
    """
    own = source_fills if completed.view.camera.same_view_as(source.camera) else ()
    return next((one.choice for one in (completed.reports[1], *own) if one.choice is not None), None)
