"""The method on one screen: RGB-D and cameras in; completed views and a completed scene out (paper, fig. 2).

reposition (eq. 1) -> render, mask (eq. 2-4) -> fill (sec. 3.3) -> fuse (eq. 10, 11)
"""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dlama.completion.recipes import Recipe, find_recipe
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud
from dlama.geometry.fusion import fuse, scene_cloud, scene_mesh
from dlama.geometry.holes import checked_mask, dilated, grown, hole_shares
from dlama.geometry.mesh import Mesh
from dlama.geometry.rendering import flying, render
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, Origin, View
from dlama.geometry.visibility import Law
from dlama.inpainters import find_filler
from dlama.inpainters.filling import FillReport, Inpainter, inpaint
from dlama.inpainters.grey_depth import with_grey_depth
from dlama.inpainters.layered.depth_first import depth_first

LOG = logging.getLogger("dlama")


@dataclass(frozen=True, eq=False)
class Completion:
    """What a completion gives back. Views are in the order of the cameras; `view` is the last."""

    views: tuple[View, ...]
    """Completed views, no holes (unless nothing at all was visible: meta says so)."""
    warped: tuple[View, ...]
    """The same views before filling, holes typed."""
    scene: Scene
    """Everything known and filled."""
    source: View
    """The source view as given."""
    meta: dict[str, Any]
    """Recipe, filler, hole shares, law moves and violations, seconds per stage."""

    @property
    def view(self) -> View:
        """The (last) completed view."""
        return self.views[-1]

    @property
    def completed(self) -> PointCloud:
        """c+ (eq. 10): everything, removed objects too, plus what was filled."""
        return scene_cloud(self.scene)

    @property
    def background(self) -> PointCloud:
        """c- (eq. 11): removed objects hidden, the background restored."""
        return scene_cloud(self.scene, objects=False)

    @property
    def mesh(self) -> Mesh:
        """The completed scene, without removed objects, as triangles."""
        return scene_mesh(self.scene, objects=False)


@dataclass
class Work:
    """One completion under way: what is known so far, and the notes for meta."""

    recipe: Recipe
    inpainter: Inpainter
    seed: int
    scene: Scene
    law: Law
    given: Scene
    """The scene as measured, before anything was filled."""
    mask_pixels: tuple[int, int] = (0, 0)
    """Pixels of the object mask as given, and known pixels given up to its dilation."""
    hole_pixels: list[tuple[int, int]] = field(default_factory=list)
    """For each view, pixels of its holes before dilation, and known pixels given up to it."""
    seconds: dict[str, float] = field(default_factory=dict)
    reports: list[FillReport] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        LOG.info("%s", name)
        started = time.perf_counter()
        yield
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - started, 4)

    def fill(self, view: View) -> View:
        with self.stage("fill"):
            filled, report = inpaint(view, self.inpainter, self.law, self.seed)
        self.reports.append(report)
        return filled


def complete(
    rgbd: RGBD,
    cameras: Sequence[Camera],
    *,
    mask: BoolArray | None = None,
    filler: str | Inpainter = "layered",
    model: str | Path | None = None,
    recipe: str | Recipe = "dlama",
    seed: int = 0,
    **changes: Any,
) -> Completion:
    """Complete the scene of one RGB-D picture from several cameras, one after the other, into one Scene.

    Each camera sees what the earlier ones filled, so views re-rendered from the Scene agree. mask (H x W bool, True = remove)
    takes an object out everywhere. `model` is the network file of fillers that run one. `changes` override single fields of
    the recipe (mode, dilate, dilate_holes, clip_m). Raises InputError and its kin.
    """
    chosen = find_recipe(recipe, changes)
    source = View.from_rgbd(clipped(rgbd, chosen.clip_m))
    work = start(source, mask, find_filler(filler, model), chosen, seed)
    views, warped = [], []
    for camera in cameras:
        before = warp(work, camera)
        view = complete_view(work, before, camera)
        warped.append(before)
        views.append(view)
    meta = report(work, source, warped, filler)
    return Completion(tuple(views), tuple(warped), work.scene, source, meta)


def clipped(rgbd: RGBD, clip_m: float | None) -> RGBD:
    """The paper's 10 m clip: everything at or beyond it, sky too, stands at it."""
    if clip_m is None:
        return rgbd
    return RGBD(rgbd.color, np.minimum(rgbd.depth, np.float32(clip_m)), rgbd.camera)


def as_recipe(fill: Inpainter, chosen: Recipe) -> Inpainter:
    """The filler with the recipe's way with depth."""
    if chosen.depth_by == "surfaces":
        return depth_first(fill)
    return fill if chosen.clip_m is None or not chosen.eight_bit_depth else with_grey_depth(fill, chosen.clip_m)


def start(
    source: View,
    mask: BoolArray | None,
    filler: str | Inpainter,
    chosen: Recipe,
    seed: int,
    law_depth: Float32Array | None = None,
) -> Work:
    """The scene before any camera moves: object out, sensor holes and (source first) the object's background filled.

    law_depth: H x W, the object's depth as the visibility law is to see it; None: as measured.
    """
    fill = as_recipe(find_filler(filler), chosen)
    scene, mask_pixels = Scene((source,)), (0, 0)
    if mask is not None:
        taken = dilated(checked_mask(mask, source.camera.hw), chosen.dilate)
        checked_mask(taken, source.camera.hw)
        mask_pixels = int(mask.sum()), int(taken.sum()) - int(mask.sum())
        taken_out = source.without(~taken, HoleType.NONE)
        scene = Scene((source.without(taken, HoleType.OBJECT),), (taken_out,))
    law = law_of(scene, chosen) if law_depth is None else law_of(measured_as(scene, law_depth), chosen)
    work = Work(chosen, fill, seed, scene, law, scene, mask_pixels)
    if chosen.source_first and scene.layers[0].hole.any():
        filled = work.fill(scene.layers[0])
        background = filled.without(filled.filled, HoleType.OBJECT)
        work.scene = fuse(dataclasses.replace(scene, layers=(background,)), filled)
    return work


def measured_as(scene: Scene, depth: Float32Array) -> Scene:
    """The scene with another depth (H x W, metres) for the pixels of its removed object, as the law is to see them."""
    eased = tuple(dataclasses.replace(one, depth=np.where(one.hole, one.depth, depth)) for one in scene.objects)
    return dataclasses.replace(scene, objects=eased)


def law_of(scene: Scene, chosen: Recipe) -> Law:
    """What the measurements forbid; nothing, where the recipe knows no law."""
    return Law.of(scene) if chosen.law else Law(())


def warp(work: Work, camera: Camera) -> View:
    """What the measurements alone show from `camera`: I', lambda' and M (eq. 2-4). Away from the source camera the depth of
    sensor holes, filled there, counts as measured."""
    home = camera.same_view_as(work.given.layers[0].camera)
    first = work.given.layers[0] if home else work.scene.layers[0]
    with work.stage("render"):
        view = render(Scene((first,), work.given.objects), camera, work.recipe.mode)
        if work.recipe.footprint and work.given.objects:
            object_seen = render(Scene(work.given.objects), camera, work.recipe.mode, types=False)
            view = view.without(~object_seen.hole & ~view.hole, HoleType.OBJECT)
        larger = grown(view, work.recipe.dilate_holes)
    work.hole_pixels.append((int(view.hole.sum()), int((larger.hole & ~view.hole).sum())))
    return larger


def complete_view(work: Work, before: View, camera: Camera) -> View:
    """Fill what the measurements leave open: first from what was filled earlier, then anew, and fuse that."""
    view = before
    if work.scene is not work.given and before.hole.any():
        with work.stage("render"):
            earlier = render(work.scene, camera, work.recipe.mode, types=False)
        view = adopt(work, before, earlier)
    filled = work.fill(view)
    with work.stage("fuse"):
        work.scene = fuse(work.scene, filled.without(before.hole & ~view.hole, HoleType.NONE))
    return filled


def adopt(work: Work, view: View, earlier: View) -> View:
    """The holes of a view closed with another rendering of the same camera, where that knows more.

    Surfaces are drawn between lawful pixel centres, so what is adopted is put to the law once more.
    """
    better = view.hole & ~earlier.hole
    depth, moved = work.law.project(view.camera, np.where(better, earlier.depth, view.depth), better)
    work.reports.append(FillReport(0, int(moved.sum()), 0, {}))
    return dataclasses.replace(
        view,
        color=np.where(better[..., None], earlier.color, view.color),
        depth=depth,
        hole=view.hole & ~better,
        origin=np.where(
            better, np.where(earlier.origin == Origin.REPROJECTED, np.uint8(Origin.FILLED), earlier.origin), view.origin
        ),
        confidence=np.where(better, earlier.confidence, view.confidence),
    )


def report(work: Work, source: View, warped: Sequence[View], filler: str | Inpainter) -> dict[str, Any]:
    """The meta data of a completion, JSON-ready."""
    moved = any(not view.camera.same_view_as(source.camera) for view in warped)
    notes: dict[str, Any] = {}
    for one in work.reports:
        notes.update(one.notes)
    return {
        "recipe": dataclasses.asdict(work.recipe),
        "filler": filler if isinstance(filler, str) else getattr(filler, "__name__", type(filler).__name__),
        "seed": work.seed,
        "hole_share": [round(float((view.hole_type > 0).mean()), 6) for view in warped],
        "hole_share_by_type": [hole_shares(view) for view in warped],
        "dilation": {
            "kernel": "disc of the radius given in the recipe",
            "mask_pixels": work.mask_pixels[0],
            "mask_known_pixels_given_up": work.mask_pixels[1],
            "hole_pixels_before": [before for before, _ in work.hole_pixels],
            "hole_known_pixels_given_up": [lost for _, lost in work.hole_pixels],
        },
        "flying_pixels_rejected": int(flying(source).sum()) if moved else 0,
        "filled_pixels": sum(one.hole_pixels for one in work.reports),
        "law_moves": sum(one.law_moves for one in work.reports),
        "law_violations": sum(one.law_violations for one in work.reports),
        "nothing_visible": any(one.notes.get("nothing_visible") for one in work.reports),
        "seconds": work.seconds,
        "notes": notes,
    }
