"""View: colour, depth and provenance of the scene from one camera, pixel by pixel, and its holes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from dlama.arguments import check, check_arguments
from dlama.geometry.camera import Camera
from dlama.geometry.codes import (
    DEPTH_FROM_OTHERS,
    ESTIMATED_CONFIDENCE,
    HoleType,
    Origin,
    from_source,
    has_code,
)
from dlama.geometry.figures.false_color import depth_picture, hatch_holes, origin_picture
from dlama.geometry.figures.html import Figured, Panel
from dlama.geometry.frames.facts import Facts
from dlama.geometry.rgbd import (
    RGBD,
    BoolArray,
    Float32Array,
    UInt8Array,
    UInt16Array,
    check_fields,
    describe_depth_range,
    freeze,
    is_valid,
    percent,
    replace_pixels,
    sampled_pixels,
    select,
)


@dataclass(frozen=True, eq=False)
class View(Figured, Facts):
    """A picture of the scene from `camera`, with depth, provenance, and the unknown as a bool field.

    In a hole depth and confidence are 0, and so are colour and origin unless the colour is known (`depth_hole`): it was measured,
    which the origin says. After filling `hole` is False there and `hole_type` keeps the reason. Raises ShapeError.
    """

    camera: Camera
    color: UInt8Array
    """H x W x 3, RGB."""
    depth: Float32Array
    """H x W, planar z in metres; +inf = far, 0 only inside holes."""
    hole: BoolArray
    """H x W, True = depth is unknown here, and mostly colour too (`color_hole`): to be filled."""
    hole_type: UInt8Array
    """H x W, HoleType codes; non-zero where the pixel is, or was before filling, a hole."""
    origin: UInt8Array
    """H x W, Origin codes."""
    confidence: Float32Array
    """H x W in 0..1; 1 = measured."""
    frame: UInt16Array | None = None
    """H x W, 1 + the number of the frame that a pixel comes from, 0 = none; of scenes of many frames only."""
    errors: Float32Array | None = None
    """H x W x 2, expected errors of fills: depth in metres (+inf where filled as far), colour in levels of 8 bit (mean over the
    channels). 0 where measured, and in holes; None: nothing was filled."""
    noise_step: float = 0.0
    """As of `RGBD`."""

    def __post_init__(self) -> None:
        check(self.camera, Camera, "view.camera")
        hw = self.camera.hw
        fields: dict[str, tuple[tuple[int, ...], type]] = {
            "color": ((*hw, 3), np.uint8),
            "depth": (hw, np.float32),
            "hole": (hw, np.bool_),
            "hole_type": (hw, np.uint8),
            "origin": (hw, np.uint8),
            "confidence": (hw, np.float32),
        }
        if self.frame is not None:
            fields["frame"] = (hw, np.uint16)
        if self.errors is not None:
            fields["errors"] = ((*hw, 2), np.float32)
        vars(self).update(check_fields(vars(self), "view", fields, " for this camera"))

    @classmethod
    def from_rgbd(cls, rgbd: RGBD) -> View:
        """The source view, measured or with estimated depth: sensor holes lack depth alone, `RGBD.padding` is out of view."""
        check_arguments(cls.from_rgbd, locals())
        missing = rgbd.missing
        known, certainty = (Origin.MEASURED, 1.0) if rgbd.estimate is None else (Origin.ESTIMATED, ESTIMATED_CONFIDENCE)
        view = cls(
            camera=rgbd.camera,
            color=rgbd.color,
            depth=rgbd.depth,
            hole=freeze(missing),
            hole_type=freeze(missing * np.uint8(HoleType.SENSOR)),
            origin=freeze(np.where(missing, np.uint8(Origin.MEASURED), np.uint8(known))),
            confidence=freeze((~missing) * np.float32(certainty)),
            noise_step=rgbd.noise_step,
        )
        return view if rgbd.padding is None else view.without(rgbd.padding, HoleType.OUT_OF_VIEW)

    def __repr__(self) -> str:
        width, height = self.camera.wh
        hole = f"{percent(self.hole)} hole, {percent(self.filled)} filled"
        return f"View({width}x{height}, {describe_depth_range(self.depth)}, {hole})"

    def _panels(self) -> list[Panel]:
        return [
            ("picture, holes hatched", hatch_holes(self.color, self.color_hole)),
            (f"depth, {describe_depth_range(self.depth)}", depth_picture(self.depth, self.hole)),
            ("origin: measured white, reprojected blue, filled orange", origin_picture(self.origin)),
        ]

    @property
    def valid(self) -> BoolArray:
        """H x W, True where there is a surface: known, finite depth > 0."""
        return ~self.hole & is_valid(self.depth)

    @property
    def far(self) -> BoolArray:
        """H x W, True where the view is known (or filled) to be far."""
        return ~self.hole & (self.depth == np.inf)

    @property
    def color_hole(self) -> BoolArray:
        """H x W, True in holes whose colour is unknown too."""
        return self.hole & ~from_source(self.origin)

    @property
    def depth_hole(self) -> BoolArray:
        """H x W, True in holes whose colour was measured, such as a sensor's: depth alone is to be filled."""
        return self.hole & from_source(self.origin)

    @property
    def object_hole(self) -> BoolArray:
        """H x W, True in holes where an object was removed."""
        return self.hole & (self.hole_type == HoleType.OBJECT.value)

    @property
    def unseen_hole(self) -> BoolArray:
        """H x W, True in colour holes out of the source's view."""
        return self.color_hole & (self.hole_type == HoleType.OUT_OF_VIEW.value)

    @property
    def known_depth(self) -> Float32Array:
        """H x W metres, 0 in holes; +inf = far."""
        return np.where(self.hole, np.float32(0), self.depth)

    @property
    def filled(self) -> BoolArray:
        """H x W, True where a filler wrote colour and depth."""
        return self.origin == Origin.FILLED.value

    @property
    def depth_error(self) -> Float32Array:
        """H x W expected error of depth in metres (`errors`); 0 where nothing was filled."""
        return np.zeros(self.camera.hw, np.float32) if self.errors is None else self.errors[..., 0]

    @property
    def color_error(self) -> Float32Array:
        """H x W expected error of colour in levels of 8 bit (`errors`); 0 where nothing was filled."""
        return np.zeros(self.camera.hw, np.float32) if self.errors is None else self.errors[..., 1]

    def load(self) -> View:
        """Itself: its pixels are in memory (those of a `StoredView` are read)."""
        return self

    def _kept(self, keep: BoolArray) -> dict[str, np.ndarray | None]:
        """Depth, confidence, frame and errors in the pixels of `keep` (H x W bool), 0 in all others."""
        return {
            "depth": select(self.depth, keep),
            "confidence": select(self.confidence, keep),
            "frame": None if self.frame is None else self.frame * keep,
            "errors": None if self.errors is None else select(self.errors, keep),
        }

    def with_planes(self, **planes: np.ndarray | None) -> View:
        """The view with other planes by name, new and unshared: they are taken over, not copied."""
        taken = {name: plane if plane is None else freeze(plane) for name, plane in planes.items()}
        return dataclasses.replace(self, **taken)  # type: ignore[arg-type]

    def cropped(self, rows: slice, columns: slice) -> View:
        """The part of the view in these rows and columns (both ends given), as a smaller camera sees it."""
        camera = self.camera.cropped_to(rows, columns)
        return dataclasses.replace(self, camera=camera, **self.planes_at((rows, columns)))

    def planes_at(self, where: Any) -> dict[str, Any]:
        """Its planes by name in some rows and columns (slices, or as numpy takes them), new and unshared."""
        planes = {name: getattr(self, name) for name in PLANES}
        return {name: None if of is None else freeze(of[where].copy()) for name, of in planes.items()}

    def reopen(self, where: BoolArray) -> View:
        """The same view with the fills in the pixels of `where` (H x W bool) unknown again, depth 0.

        Measured colours stay; `hole_type` keeps the reason of the hole.
        """
        guessed = where & ~has_code(self.origin, *DEPTH_FROM_OTHERS)
        origin = select(self.origin, ~guessed)
        return self.with_planes(
            color=select(self.color, ~guessed) if guessed.any() else self.color,
            hole=self.hole | where,
            origin=np.where(where & ~guessed, np.uint8(Origin.MEASURED), origin),
            **self._kept(~where),
        )

    def without_filled_depth(self) -> View:
        """A frame with its sensor holes open; itself, where no depth was filled."""
        if not self.has_filled_depth:
            return self
        return self.reopen(has_code(self.origin, *DEPTH_FROM_OTHERS) & ~self.hole).with_planes(errors=None)

    def with_known_depth(self, depth: Float32Array, where: BoolArray) -> View:
        """The view with depth (H x W metres) as known in pixels of `where` (H x W bool), which lacked it alone."""
        return self.with_planes(depth=np.where(where, depth, self.depth), hole=self.hole & ~where)

    def with_pixels(self, other: View, where: BoolArray) -> View:
        """The same view with another one's pixels, of the same camera, in `where` (H x W bool); `hole_type` stays its own."""
        names = ("depth", "hole", "origin", "confidence")
        planes: dict[str, Any] = {name: np.where(where, getattr(other, name), getattr(self, name)) for name in names}
        if other.color is not self.color:
            planes["color"] = replace_pixels(self.color, where, other.color)
        return self.with_planes(errors=self.errors_with(other, where), **planes)

    def errors_with(self, other: View, where: BoolArray) -> Float32Array | None:
        """Its expected errors, in the pixels of `where` (H x W bool) those of another view of the same camera."""
        if other.errors is None:
            return self.errors
        return select(other.errors, where) if self.errors is None else replace_pixels(self.errors, where, other.errors)

    def without(self, where: BoolArray, hole_type: HoleType) -> View:
        """The same view with the pixels of `where` (H x W bool) turned into holes of one type."""
        keep = ~where
        return self.with_planes(
            color=select(self.color, keep),
            hole=self.hole | where,
            hole_type=np.where(where, np.uint8(hole_type), self.hole_type),
            origin=select(self.origin, keep),
            **self._kept(keep),
        )

    def subsample(self, step: int) -> View:
        """Every `step`-th pixel (`sampled_pixels`) as a view, whose camera differs by its size alone; itself, at 1."""
        if step == 1:
            return self
        rows, columns = sampled_pixels(self.hole.shape, step)
        camera = dataclasses.replace(self.camera, width=columns.size, height=rows.size)
        return dataclasses.replace(self, camera=camera, **self.planes_at((rows, columns)))


PLANES = tuple(one.name for one in dataclasses.fields(View) if one.name not in ("camera", "noise_step"))
"""The fields of a View that hold a value for each pixel."""
