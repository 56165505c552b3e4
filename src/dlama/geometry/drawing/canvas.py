"""What was drawn of several layers, the nearest of them in each pixel."""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.codes import DEPTH_FROM_OTHERS, LARGEST_CONFIDENCE, Origin, from_source, has_code
from dlama.geometry.kernels.drawing.shading import Planes
from dlama.geometry.rgbd import BoolArray, brighten, paste
from dlama.geometry.view import View


class Canvas(Planes):
    """Pixels drawn so far; depth 0 = empty."""

    @classmethod
    def empty(cls, camera: Camera, errors: bool = False) -> Canvas:
        """A canvas of the camera's size on which nothing is drawn; `errors`: expected errors are drawn, too."""
        hw = camera.hw
        return cls(
            np.zeros((*hw, 3), np.uint8),
            np.zeros(hw, np.float32),
            np.zeros(hw, np.uint8),
            np.zeros(hw, np.float32),
            np.zeros((*hw, 2) if errors else (0, 0, 2), np.float32),
        )

    def cropped(self, rows: slice, columns: slice) -> Canvas:
        """A part of it: what is drawn there is drawn here."""
        return Canvas._make(plane[rows, columns] for plane in self)

    def put(self, other: Canvas, over_measured: bool, at_home: bool) -> None:
        """Draw another canvas over this one where this is empty or behind by more than 0.5 % of the depth.

        over_measured: False keeps measured pixels in their own camera (fills must not cover them). at_home: it is the first
        layer's camera; its sensor holes keep their measured colours.
        """
        wins = (other.depth > 0) & ((self.depth == 0) | (other.depth < self.depth * 0.995))
        if not over_measured:
            wins &= ~from_source(self.origin) | (self.depth == 0)
            if at_home:
                wins &= (self.origin != Origin.DEPTH_FILLED.value) | (self.depth == 0)
        self.copy_where(other, wins)

    def copy_where(self, other: Canvas | View, where: BoolArray) -> None:
        """The chosen pixels (H x W) of a canvas, or of a view of the same camera, onto this one, as they are."""
        paste(other.color, where, self.color)
        paste(other.depth, where, self.depth)
        paste(other.origin, where, self.origin)
        paste(other.confidence, where, self.confidence)
        if len(self.errors) and other.errors is not None and len(other.errors):
            paste(other.errors, where, self.errors)

    def keep_colors(self, own: View) -> None:
        """The colours of a frame in its own camera, where fills were drawn into its sensor holes: their depth alone stays."""
        colored = own.depth_hole | (has_code(own.origin, *DEPTH_FROM_OTHERS) & ~own.hole)
        if not colored.any():
            return
        colored &= has_code(self.origin, Origin.REPROJECTED, Origin.FILLED, Origin.DEPTH_FILLED)
        paste(own.color, colored, self.color)
        self.origin[colored] = Origin.DEPTH_FILLED
        np.minimum(self.confidence, np.float32(LARGEST_CONFIDENCE), out=self.confidence, where=colored)
        if len(self.errors):
            self.errors[colored, 1] = 0

    def brighten_where(self, where: BoolArray, gain: Float64Array) -> None:
        """Multiply the colours of pixels (H x W) by a gain."""
        self.color[where] = brighten(self.color[where], gain)
