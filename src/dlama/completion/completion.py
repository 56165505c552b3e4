"""What the verbs give back: completed views, the completed scene, and the meta data of how they came about."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

from dlama.completion.meta_data import MetaData, read_only
from dlama.completion.recipes import check_confidence
from dlama.errors import InputError
from dlama.geometry.cloud import Mesh, PointCloud
from dlama.geometry.codes import from_filler
from dlama.geometry.figures.false_color import depth_limits, depth_picture, hole_picture
from dlama.geometry.figures.html import Figured, Panel
from dlama.geometry.figures.show import show_html
from dlama.geometry.frames.stored import BoxedView, Layer, StoredView
from dlama.geometry.fusion import scene_cloud, scene_mesh
from dlama.geometry.rgbd import Float32Array, select
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.perception.stereo.agreement import StereoConsistency

C = TypeVar("C", bound="Completion")
S = TypeVar("S", bound="StereoCompletion")
MOST_VIEWS = 3
"""Shown in a notebook of a completion with several views."""


@dataclass(frozen=True, eq=False, repr=False)
class Completion(Figured):
    """What a completion gives back. Views are in the order of the cameras; `view` is the last."""

    views: tuple[View, ...]
    """Completed views, no holes (unless nothing at all was visible: meta says so)."""
    warped: tuple[View, ...]
    """The same views before filling, holes typed."""
    scene: Scene
    """Everything known and filled."""
    source: View
    """The source view as given."""
    meta: MetaData
    """Recipe, filler, hole shares, law moves and violations, seconds per stage; read-only."""

    def __post_init__(self) -> None:
        vars(self)["meta"] = read_only(self.meta)

    def __repr__(self) -> str:
        sizes = sorted({f"{view.camera.width}x{view.camera.height}" for view in self.views})
        count = f"{len(self.views)} view{'' if len(self.views) == 1 else 's'}"
        shares = self.meta["hole_share"]
        unknown = f", {100 * sum(shares) / len(shares):.1f} % was unknown" if shares else ""
        named = f"filled by {self.meta['filler']!r}, recipe {self.meta['recipe']['name']!r}"
        return f"{type(self).__name__}({' of '.join([count, *sizes])}{unknown}, {named})"

    def _panels(self) -> list[Panel]:
        """Source, then before and after of every view (at most MOST_VIEWS) in colour and depth, in the same colours."""
        lo, hi = depth_limits(self.source.depth, *(view.depth for view in self.views))
        panels: list[Panel] = [("source", self.source.color)]
        for before, view in list(zip(self.warped, self.views))[:MOST_VIEWS]:
            panels += [
                ("known, holes by type", hole_picture(before.color, before.hole_type)),
                ("completed", view.color),
                ("depth known", depth_picture(before.depth, before.hole, lo, hi)),
                (f"depth completed, {lo:.2g} to {hi:.2g} m", depth_picture(view.depth, view.hole, lo, hi)),
            ]
        return panels

    def show(self) -> None:
        """Show before and after and the scene: in a notebook below its cell, else as a page in the web browser.

        The page is one file in the system's folder for temporary files; it loads nothing.
        """
        show_html(self._repr_html_() + self.scene._repr_html_())

    @property
    def view(self) -> View:
        """The (last) completed view. InputError where no camera was given, so that there is a scene and no view."""
        if not self.views:
            raise InputError(
                "the completion has no view, since cameras was empty; its scene, mesh and clouds are there"
            )
        return self.views[-1]

    def with_min_confidence(self: C, min_confidence: float) -> C:
        """The same completion with every filled pixel and point of less confidence left open (unknown), in views and scene.

        min_confidence: 0..1; 0 leaves nothing open. What was measured always stays. meta says how much was left open.
        Raises InputError.
        """
        if check_confidence(min_confidence) == 0:
            return self
        views = tuple(above_confidence(view, min_confidence) for view in self.views)
        before = self.meta.get("left_open_share", [0.0] * len(views))
        opened = [float((new.hole & ~old.hole).mean()) for new, old in zip(views, self.views)]
        meta = self.meta | {
            "min_confidence": max(min_confidence, self.meta.get("min_confidence", 0.0)),  # what is open stays open
            "left_open_share": [round(open_before + share, 6) for open_before, share in zip(before, opened)],
        }
        return replace(self, views=views, scene=scene_above(self.scene, min_confidence), meta=meta)

    @cached_property
    def completed(self) -> PointCloud:
        """c+ (eq. 10): everything, removed objects too, plus what was filled. World metres; computed once."""
        return scene_cloud(self.scene)

    @cached_property
    def background(self) -> PointCloud:
        """c- (eq. 11): removed objects hidden, the background restored. World metres; computed once."""
        return scene_cloud(self.scene, objects=False)

    @cached_property
    def mesh(self) -> Mesh:
        """The completed scene, without removed objects, as triangles. World metres; computed once."""
        return scene_mesh(self.scene)


@dataclass(frozen=True, eq=False, repr=False)
class StereoCompletion(Completion):
    """A completion whose two views are the left and the right of a pair."""

    disparity_left: Float32Array
    """H x W px of the completed left view, 0 = unknown; far is -doffs of the rig, 0 in most."""
    disparity_right: Float32Array
    """H x W px of the completed right view, far as in the left one."""
    agreement: StereoConsistency
    """How well the two completed views agree, over the whole picture, before any of it is left open."""

    def with_min_confidence(self: S, min_confidence: float) -> S:
        """As of `Completion`; what is left open has no disparity either (0)."""
        done = super().with_min_confidence(min_confidence)
        if done is self:
            return self
        left, right = (
            select(disparity, ~view.hole)
            for disparity, view in zip((done.disparity_left, done.disparity_right), done.views)
        )
        return replace(done, disparity_left=left, disparity_right=right)


def scene_above(scene: Scene, min_confidence: float) -> Scene:
    """The scene with filled pixels below that confidence left open, in frames and fills."""
    if min_confidence == 0:
        return scene
    frames, fills = (
        tuple(layer_above(layer, min_confidence) for layer in layers) for layers in (scene.frames, scene.fills)
    )
    return replace(scene, frames=frames, fills=fills)


def above_confidence(view: View, min_confidence: float) -> View:
    """The view with filled pixels below that confidence left open."""
    filled = from_filler(view.origin) & ~view.hole
    low = filled & (view.confidence < min_confidence)
    return view.reopen(low) if low.any() else view


def layer_above(layer: Layer, min_confidence: float) -> Layer:
    """The same of a layer of a scene: itself where it has no such pixel; a stored one is read when it is needed."""
    if isinstance(layer, BoxedView):
        part = layer_above(layer.part, min_confidence)
        return layer if part is layer.part else BoxedView(layer.camera, part)
    view = layer.load()
    kept = above_confidence(view, min_confidence)
    if kept is view:
        return layer
    if isinstance(layer, StoredView):
        return layer.made_by(above_confidence, min_confidence, first=kept)
    return kept
