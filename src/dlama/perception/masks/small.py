"""A large picture with depth in; a smaller one, in which masks are found, and masks at the large one's size, out.

What a mask is made of (planes, pieces, cast shapes) needs no 12 megapixels. Its outline does: there each pixel of the large
picture is decided by the pixels of the small one around that are most like it in colour and depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlama.geometry.holes import dilate_square, erode_mask, shrink_mask
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.masks.prompt import NothingThereError, Pointed, Prompt
from dlama.perception.resampling import nearest_pixels, shrink_rgbd

LARGEST, SMALL = 2_200_000, 1_000_000
"""Pixels of the largest picture in which masks are found at full size, and of the smaller one of a larger picture."""
COLOR_SIGMA, DEPTH_SIGMA, SPACE_SIGMA = 15.0, 0.02, 0.7
"""Difference of alike pixels: levels a channel, of inverse depth, relative, and of places, in the small picture's pixels."""


@dataclass(frozen=True, eq=False)
class SmallPicture:
    """A picture at a smaller size."""

    rgbd: RGBD
    large: RGBD
    """The picture itself."""

    @classmethod
    def of(cls, rgbd: RGBD) -> SmallPicture | None:
        """None where the picture is small enough."""
        height, width = rgbd.depth.shape
        if height * width <= LARGEST:
            return None
        by = np.sqrt(SMALL / (height * width))
        return cls(shrink_rgbd(rgbd, (max(1, round(by * width)), max(1, round(by * height)))), rgbd)

    def prompt(self, prompt: Prompt) -> Prompt:
        """Clicks and box of the large picture in the small one; of clicks that share a pixel there those on the object."""
        (down, across), (height, width) = self.scale, self.rgbd.depth.shape
        on, off = (
            tuple((min(x * across, width - 1), min(y * down, height - 1)) for x, y in points)
            for points in (prompt.clicks, prompt.not_clicks)
        )
        taken = {(int(y), int(x)) for x, y in on}
        off = tuple((x, y) for x, y in off if (int(y), int(x)) not in taken)
        box = prompt.box
        if box is not None:
            wide, high = min(max(box[2] * across, 1.0), width), min(max(box[3] * down, 1.0), height)  # rounding
            box = box[0] * across, box[1] * down, wide, high
        return Prompt((height, width), on, off, box)

    @property
    def scale(self) -> tuple[float, float]:
        """Pixels of the small picture in one of the large one, down and across."""
        down, across = (small / large for small, large in zip(self.rgbd.depth.shape, self.large.depth.shape))
        return down, across

    def shrink(self, mask: BoolArray) -> BoolArray:
        """A mask of the large picture at the small one's size."""
        return shrink_mask(mask, self.rgbd.camera.wh) >= 0.5

    def find_with(self, masker: Pointed) -> Pointed:
        """The masker of the large picture, by that of the small one: masks stay within the box, and all clicks are right."""

        def find(prompt: Prompt) -> tuple[dict[str, BoolArray], tuple[str, ...]]:
            smaller = self.prompt(prompt)
            try:
                found, notes = masker(smaller)
            except NothingThereError as error:
                here = dict(zip(smaller.on, prompt.on))[error.pixel]
                raise NothingThereError(here, error.where, error.on) from None
            masks = {name: self.enlarge(mask) & prompt.inside for name, mask in found.items()}
            for mask in masks.values():
                for belongs, pixels in ((True, prompt.on), (False, prompt.away)):
                    for pixel in pixels:
                        mask[pixel] = belongs
            return masks, notes

        return find

    def enlarge(self, mask: BoolArray) -> BoolArray:
        """A mask of the small picture at the large one's size."""
        out = nearest_pixels(mask, self.large.depth.shape)
        rim = dilate_square(mask, 3) & ~erode_mask(mask, 1)
        rows, columns = np.nonzero(nearest_pixels(rim, self.large.depth.shape))
        down, across = self.scale
        y, x = (rows + 0.5) * down - 0.5, (columns + 0.5) * across - 0.5
        color, w = self.large.color[rows, columns].astype(np.float32), inverse_depth(self.large.depth[rows, columns])
        small_w = inverse_depth(self.rgbd.depth)
        inside, weights = np.zeros(len(rows), np.float32), np.full(len(rows), 1e-20, np.float32)
        top, left = np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                at = (top + i).clip(0, len(mask) - 1), (left + j).clip(0, len(mask[0]) - 1)
                apart = ((self.rgbd.color[at] - color) ** 2).sum(1) / (3 * COLOR_SIGMA**2)
                apart += (np.abs(small_w[at] - w) / (DEPTH_SIGMA * np.maximum(np.maximum(small_w[at], w), 1e-6))) ** 2
                apart += ((top + i - y) ** 2 + (left + j - x) ** 2) / SPACE_SIGMA**2
                weight = np.exp(-np.minimum(apart, 60) / 2, dtype=np.float32)
                inside += weight * mask[at]
                weights += weight
        out[rows, columns] = inside > 0.5 * weights
        return out
