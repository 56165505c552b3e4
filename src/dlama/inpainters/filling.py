"""Filling: a view with holes in; the same view without holes out. The contract of a filler, and `inpaint`, which runs every
filler.

`inpaint` guarantees for every filler: pixels outside the hole stay bit-identical, filled depth keeps the visibility law, and
origin and confidence mark what was filled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dlama.arguments import as_array, check, check_arguments, check_count, function_name
from dlama.errors import DepthError, InputError, ShapeError
from dlama.geometry.codes import Origin
from dlama.geometry.fusion import paste_part
from dlama.geometry.holes import Box, box_around, larger_box, sides_of
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, replace_pixels
from dlama.geometry.view import View
from dlama.inpainters.confidence import features_of_known, judge_fill
from dlama.inpainters.context import FillContext
from dlama.models.network_file import make_room


@dataclass(frozen=True, eq=False)
class Fill:
    """A filler's proposal for a view; only its hole pixels are used."""

    color: UInt8Array = field(repr=False)
    """H x W x 3, RGB."""
    depth: Float32Array = field(repr=False)
    """H x W, metres > 0 or +inf (far)."""
    law_moves: int = 0
    """Pixels the filler itself already moved to keep the visibility law."""
    notes: dict[str, Any] = field(default_factory=dict)
    """What the filler adds to meta.json (planes found, model, provider ...)."""
    errors: Float32Array | None = field(default=None, repr=False)
    """H x W x 2 expected errors of the filler itself, see `View.errors`; None: the confidence network estimates them."""


Inpainter = Callable[[View, FillContext, int], Fill]
"""A filler: (view with holes, its context, seed) -> Fill. Deterministic for one seed. Views are read-only, the source's own holes
come first; of a large one the filler sees the part round its holes (`inpaint`)."""
Paint = Callable[[UInt8Array, BoolArray, int], UInt8Array]
"""(H x W x 3 picture, H x W hole, seed) -> H x W x 3 picture with the hole filled. Deterministic for one seed."""


@dataclass(frozen=True)
class Painter:
    """A filler made of a function that fills pictures: diffusion, and networks that fill colour.

    Depth is that of the surfaces that continue behind the hole, and colours out of view are blended with a low-frequency
    estimate. By the recipe `paper` depth is painted, too, and colours stay as painted.
    """

    paint: Paint
    """(uint8 H x W x 3 picture, bool H x W hole, seed) -> uint8 H x W x 3 picture. What lies in the hole is of no meaning."""
    fill: Inpainter | None = None
    """Fills a view by itself, colour and depth, where `depth_by` is 'filler'; None: that is refused."""
    notes: Callable[[], dict[str, Any]] = field(default=dict)
    """What ran, for meta.json."""

    def __post_init__(self) -> None:
        check(self.paint, Paint, "paint")

    def __call__(self, view: View, context: FillContext, seed: int) -> Fill:
        if self.fill is None:
            raise InputError("a Painter without `fill` fills no depth; `depth_by` 'surfaces' is expected")
        return self.fill(view, context, seed)

    def __repr__(self) -> str:
        return f"Painter({self.__name__})"

    @property
    def __name__(self) -> str:
        """Its function's name, for meta.json."""
        return function_name(self.paint)

    def fill_picture(self, picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        """What `paint` makes of a picture. ShapeError where it is no uint8 picture of that size."""
        painted = _check_plane(self.paint(picture, hole, seed), "picture", picture.shape)
        if painted.dtype != np.uint8:
            raise ShapeError(f"the filler's picture is {painted.dtype}; uint8 is expected")
        return painted


@dataclass(frozen=True)
class FillReport:
    """What filling one view did, for meta.json."""

    hole_pixels: int = 0
    """Pixels that were written."""
    law_moves: int = 0
    """Filled pixels whose proposed depth broke the visibility law and was projected onto it."""
    law_violations: int = 0
    """Filled pixels that still break it (0, or a bug)."""
    notes: dict[str, Any] = field(default_factory=dict)
    """The filler's own."""


def check_fill(fill: Fill, hole: BoolArray) -> Fill:
    """The fill, if it fits this hole (H x W); else InputError (no Fill), ShapeError or DepthError: a fault of the filler."""
    check(fill, Fill, "what the filler returned")
    check_count(fill.law_moves, "law_moves", least=0)
    check(fill.notes, dict[str, Any], "the filler's notes")
    hw = hole.shape
    color = _check_plane(fill.color, "color", (*hw, 3))
    if color.dtype != np.uint8:
        raise ShapeError(f"the filler's color is {color.dtype}; uint8 is expected")
    given = _check_plane(fill.depth, "depth", hw)
    with np.errstate(over="ignore"):  # far is what float32 cannot hold
        depth = given.astype(np.float32, copy=False) if given.dtype.kind in "iuf" else np.zeros(hw, np.float32)
    if wrong := int((~(depth[hole] > 0)).sum()):
        raise DepthError(
            f"the filler's depth is 0, NaN, negative or no number in {wrong} pixels of the hole; metres, or infinity for sky, "
            "are expected"
        )
    errors = None
    if fill.errors is not None:
        errors = _check_plane(fill.errors, "errors", (*hw, 2)).astype(np.float32, copy=False)
        if not (errors[hole] >= 0).all():
            raise ShapeError("the filler's errors are NaN or negative in pixels of the hole; numbers >= 0 are expected")
    return Fill(color, depth, fill.law_moves, fill.notes, errors)


def _check_plane(plane: ArrayLike, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """What a filler gave, as an array; ShapeError, which calls it `name`, unless it is of that shape."""
    array = as_array(plane, f"the filler's {name}")
    if array.shape != shape:
        raise ShapeError(f"the filler's {name} has shape {array.shape}; {shape} is expected for this view")
    return array


def inpaint(view: View, inpainter: Inpainter, context: FillContext, seed: int = 0) -> tuple[View, FillReport]:
    """Fill all holes of a view; the view comes back without holes, with a report.

    Holes with measured colour (origin DEPTH_FILLED: sensor holes of a source view) get depth only. A view without any
    known pixel comes back unchanged, with the note `nothing_visible`. Where its holes lie in a small part of a large view, the
    filler sees that part (`part_worth_cropping`): the work is proportional to the hole.
    Raises InputError: the filler returns no Fill, or one of another size.
    """
    check_arguments(inpaint, locals())
    hole = view.hole
    if not hole.any():
        return view, FillReport()
    if not (view.valid | view.far).any():
        return view, FillReport(notes={"nothing_visible": True})
    context = context.near(view.camera)
    box = part_worth_cropping(hole)
    if box is None:
        return _fill_whole(view, inpainter, context, seed)
    rows, columns = box
    part, report = _fill_whole(view.cropped(rows, columns), inpainter, context.cropped(view, rows, columns), seed)
    make_room(hole.size)
    return paste_part(view, part, rows, columns), report


def part_worth_cropping(hole: BoolArray) -> Box | None:
    """Rows and columns of the box round a hole (H x W, not empty) that a filler sees, with context of .4 of its longer side, .08
    of the view's and 256 px at least; None: of all, which is not much more."""
    tight = box_around(hole, 0)
    box = larger_box(tight, max(256, round(0.4 * max(sides_of(tight))), round(0.08 * max(hole.shape))), hole.shape)
    return box if np.prod(sides_of(box)) <= 0.6 * hole.size else None


def _fill_whole(view: View, inpainter: Inpainter, context: FillContext, seed: int) -> tuple[View, FillReport]:
    """`inpaint` with the filler seeing the whole view."""
    hole, known = view.hole, begin_job(features_of_known, view, context.noise)
    fill = check_fill(inpainter(view, context, seed), hole)
    depth, moved = context.law.project(view.camera, fill.depth, hole)
    color_hole = view.color_hole
    color = view.color
    if color_hole.any():
        color = replace_pixels(color, color_hole, np.ascontiguousarray(fill.color))
    filled_origin = np.where(color_hole, np.uint8(Origin.FILLED), np.uint8(Origin.DEPTH_FILLED))
    confidence, errors = judge_fill(view, color, depth, known())
    if fill.errors is not None:
        errors = np.where(hole[..., None], fill.errors, errors)
    filled = view.with_planes(
        color=color,
        depth=np.where(hole, depth, view.depth),
        hole=np.zeros_like(hole),
        origin=np.where(hole, filled_origin, view.origin),
        confidence=confidence,
        errors=errors,
    )
    left = int(context.law.violations(view.camera, filled.depth, hole).sum())
    return filled, FillReport(int(hole.sum()), fill.law_moves + int(moved.sum()), left, fill.notes)
