"""A picture with estimated depth and a click or a box in; masks of the object out. A salient-object network leads.

The network of `salient` runs in two windows round a click, and in the whole picture where those find nothing or cut the object
off. Round a box it runs in three windows, and its region is taken where it fills the box; elsewhere colours decide (`borders`).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import box_around, dilate_mask, disc, erode_mask, morphological_open, region_at, sides_of
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.models.network_file import make_room
from dlama.perception.masks.borders import cut_out_box, decide_by_color
from dlama.perception.masks.click_network import first_window
from dlama.perception.masks.prompt import NothingThereError, Pixel, Prompt, square_about
from dlama.perception.masks.rgbd import check_surfaces
from dlama.perception.masks.salient import SIDE, Window, WindowSaliency, window_around, window_side

WINDOWS = (0.5,)
"""Sides of the windows round a click after the first, that of `click_network`, over the root of the picture's area."""
CUT_OFF = 0.2
"""Share of a window's border that a mask crosses, from which the whole picture is used, too."""


@dataclass(frozen=True, eq=False)
class Reading:
    """A possible object under a click."""

    mask: BoolArray
    """H x W."""
    cut: float
    """Share of the window's border that the mask crosses."""
    confidence: float
    """Saliency at the click, 0..1, less `cut`."""
    window_hw: tuple[int, ...]
    """Height and width of the window."""


class PhotoMasker:
    """The masker of one picture: the network runs once for each window of each click."""

    def __init__(self, rgbd: RGBD) -> None:
        check_surfaces(rgbd)
        make_room(rgbd.depth.size)
        self.rgbd = rgbd
        self.seen = WindowSaliency(rgbd.color)
        self.known: dict[Pixel, list[Reading]] = {}

    def candidates(self, prompt: Prompt) -> list[BoolArray]:
        """H x W masks of a click or a box, the most confident first: it, a smaller and a larger reading; none where nothing is
        salient at a click.

        MaskError on the sky, and where a box holds nothing.
        """
        if prompt.box is not None:
            return self.segment_box(prompt)
        pixel = prompt.on[0]
        readings = sorted(self.readings(pixel), key=lambda one: -one.confidence - bool(one.mask[pixel]))
        if readings:
            others = [one.mask for one in readings[1:] if one.cut <= CUT_OFF]
            return list(name_masks(readings[0].mask, others).values())
        if self.rgbd.far[pixel]:
            raise NothingThereError(pixel, "which lies on the sky: nothing stands apart there")
        return []

    def segment_box(self, prompt: Prompt) -> list[BoolArray]:
        """The salient region where it fills the box, and the region that colours cut out. MaskError where there is neither."""
        filling = self.salient_in_box(prompt.box_slices)
        if filling is None:
            return [cut_out_box(self.rgbd.color, prompt)]
        try:
            others = [cut_out_box(self.rgbd.color, prompt)]
        except MaskError:
            others = []
        return list(name_masks(filling, others).values())

    def salient_in_box(self, box: Window) -> BoolArray | None:
        """H x W, the salient region of a box, mean over the windows round it; None where it fills less than .75 of the box."""
        hw = self.rgbd.depth.shape
        longest = max(sides_of(box))
        row, column = ((side.start + side.stop) // 2 for side in box)
        sides = [max(48, round(share * longest)) for share in (1.25, 1.6, 2.2)]  # px, and over the box's longer side
        windows = [window_around((row, column), side, hw) for side in sides]
        total = np.zeros(hw, np.float32)
        for window in windows:
            level = self.seen.level(window)
            if level is None:
                return None
            total[window] += level
        mask, inside = total > len(windows) / 2, np.zeros(hw, np.bool_)
        if not mask[box].any():
            return None
        part = inside[box] = refine_border(self.rgbd, mask, (longest,))[box]
        return inside if math.prod(sides_of(box_around(part, 0))) >= 0.75 * part.size else None

    def readings(self, pixel: Pixel) -> list[Reading]:
        """Possible objects under a click at (row, column); empty without a salient region there."""
        if pixel not in self.known:
            hw = self.rgbd.depth.shape
            sides = [first_window(hw), *(window_side(hw, share) for share in WINDOWS)]
            found = self.read_windows(pixel, [window_around(pixel, side, hw) for side in sides], 0)
            if not found or max(found, key=lambda one: one.confidence).cut > CUT_OFF:
                found += self.read_windows(pixel, [(slice(0, hw[0]), slice(0, hw[1]))], len(sides))
            self.known[pixel] = found
        return self.known[pixel]

    def read_windows(self, pixel: Pixel, windows: list[Window], first: int) -> list[Reading]:
        """The readings of a click in windows; those of later windows must be more confident by .05 each, since the network is
        often confident of both. first: number of the first window."""
        found = [(number, self.reading(pixel, window)) for number, window in enumerate(windows, first)]
        readings = [dataclasses.replace(one, confidence=one.confidence - 0.05 * number) for number, one in found if one]

        def refine(first: int, last: int) -> None:
            for k in range(first, last):
                mask = refine_border(self.rgbd, readings[k].mask, readings[k].window_hw)
                readings[k] = dataclasses.replace(readings[k], mask=mask)

        in_bands(refine, len(readings), band=1)
        return readings

    def reading(self, pixel: Pixel, window: Window) -> Reading | None:
        """The connected salient region at a pixel of a window, its border not yet refined; None where there is none."""
        level = self.seen.level(window)
        if level is None:
            return None
        row, column = pixel[0] - window[0].start, pixel[1] - window[1].start
        near = square_about((row, column), 3)  # px in which a click selects a region
        part = region_at(level > 0.5, near)
        if not part.any():
            return None
        mask = np.zeros(self.rgbd.depth.shape, np.bool_)
        mask[window] = part
        cut_off = rim_share(mask, window)
        return Reading(mask, cut_off, float(level[near].max()) - cut_off, part.shape)


def rim_share(mask: BoolArray, window: tuple[slice, slice]) -> float:
    """Border pixels of the window, inside the picture, that a mask crosses, over the window's longer side."""
    part, (rows, columns) = mask[window], window
    sides = (
        (rows.start > 0, part[0]),
        (rows.stop < mask.shape[0], part[-1]),
        (columns.start > 0, part[:, 0]),
        (columns.stop < mask.shape[1], part[:, -1]),
    )
    return sum(int(line.sum()) for inner, line in sides if inner) / max(part.shape)


def refine_border(rgbd: RGBD, mask: BoolArray, window_hw: tuple[int, ...]) -> BoolArray:
    """The mask with its border cut along colours, where one network pixel covers several picture pixels; thin parts stay."""
    reach = round(max(window_hw) / SIDE)
    if reach < 2:
        return mask
    box = box_around(mask, 2 * reach)
    part, band = mask[box], np.zeros_like(mask)
    core = morphological_open(part, disc(2 * reach))
    band[box] = dilate_mask(core, reach) & ~erode_mask(core, reach) & ~(part & ~dilate_mask(core, 1))
    return decide_by_color(rgbd, mask, band)


def name_masks(mask: BoolArray, others: list[BoolArray], different: float = 0.9) -> dict[str, BoolArray]:
    """The mask as `object`, and the first readings that differ from it: a smaller one as `part`, a larger one as `group`.

    different: the largest intersection over union of two masks that are different readings.
    """
    out = {"object": mask}
    for other in others:
        if (mask & other).sum() < different * (mask | other).sum():
            out.setdefault("part" if other.sum() < mask.sum() else "group", other)
    return out
