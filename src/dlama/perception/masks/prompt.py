"""Clicks and a box of a user in; the same, checked against the picture's size, out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dlama.errors import InputError, MaskError
from dlama.geometry.rgbd import BoolArray

Point = tuple[float, float]
"""x to the right, y down, in pixels: (3, 5) is in column 3, row 5, as is (3.9, 5.9)."""
Pixel = tuple[int, int]
"""(row, column)."""
Box = tuple[float, float, float, float]
"""x and y of the upper left corner, width and height, in pixels."""


def square_about(pixel: Pixel, px: int) -> tuple[slice, slice]:
    """Rows and columns within so many px of a pixel, as an index: of the picture, which may end sooner."""
    rows, columns = (slice(max(at - px, 0), at + px + 1) for at in pixel)
    return rows, columns


def whole_pixels(start: float, length: float, most: int) -> slice:
    """The pixels of a row or column of `most` that a side of a box covers, one at least."""
    first = max(0, round(start))
    return slice(first, max(first + 1, min(most, round(start + length))))


@dataclass(frozen=True)
class Prompt:
    """Clicks and a box, numbers all, in a picture of a certain size; raises InputError for what lies outside it."""

    hw: tuple[int, int]
    """Height and width of the picture."""
    clicks: tuple[Point, ...] = ()
    """On the object."""
    not_clicks: tuple[Point, ...] = ()
    """On the background."""
    box: Box | None = None
    """Round the object."""

    def __post_init__(self) -> None:
        height, width = self.hw
        for name, points in (("clicks", self.clicks), ("not_clicks", self.not_clicks)):
            for point in points:
                x, y = point
                if not (0 <= x < width and 0 <= y < height):
                    raise InputError(
                        f"`{name}` holds {x:g},{y:g}, which lies outside the picture; x in 0..{width - 1} and "
                        f"y in 0..{height - 1} are expected"
                    )
        both = set(self.on) & set(self.away)
        if both:
            row, column = min(both)
            raise InputError(f"`clicks` and `not_clicks` both hold pixel {column},{row}; one of them is expected")
        if self.box is not None:
            self._check_box(self.box)

    def _check_box(self, box: tuple[float, float, float, float]) -> None:
        height, width = self.hw
        x, y, wide, high = box
        if not (wide >= 1 and high >= 1):
            raise InputError(f"`box` is {wide:g} x {high:g} pixels; a width and a height of 1 or more are expected")
        # larger than the picture are x,y,x,y of two corners
        if wide > width or high > height or not (-wide < x < width and -high < y < height):
            raise InputError(
                f"`box` is {x:g},{y:g},{wide:g},{high:g}, which is no part of the picture of {width}x{height}; "
                "x,y,width,height are expected"
            )
        for at, down in self.clicks:
            if not (x - 1 < at < x + wide + 1 and y - 1 < down < y + high + 1):  # boxes end between pixels
                raise InputError(
                    f"`clicks` holds {at:g},{down:g}, which lies outside `box` {x:g},{y:g},{wide:g},{high:g}; a box round "
                    "the whole object is expected"
                )

    @property
    def on(self) -> list[Pixel]:
        """(row, column) of each click on the object."""
        return [(int(y), int(x)) for x, y in self.clicks]

    @property
    def away(self) -> list[Pixel]:
        """(row, column) of each click on the background."""
        return [(int(y), int(x)) for x, y in self.not_clicks]

    @property
    def box_slices(self) -> tuple[slice, slice]:
        """Rows and columns of the box, or of the whole picture where there is none."""
        height, width = self.hw
        x, y, wide, high = self.box or (0, 0, width, height)
        return whole_pixels(y, high, height), whole_pixels(x, wide, width)

    @property
    def inside(self) -> BoolArray:
        """H x W, True in the box; everywhere where there is none."""
        out = np.zeros(self.hw, np.bool_)
        out[self.box_slices] = True
        return out


class NothingThereError(MaskError):
    """A click under which no object is found."""

    def __init__(self, pixel: Pixel, where: str, on: str = "on an object") -> None:
        super().__init__(f"`clicks` holds {pixel[1]},{pixel[0]}, {where}; click {on}, or give a box round it")
        self.pixel, self.where, self.on = pixel, where, on


Pointed = Callable[[Prompt], tuple[dict[str, BoolArray], tuple[str, ...]]]
"""A masker of one picture: prompt -> H x W masks by name (part, object, group; those that differ), and notes."""
