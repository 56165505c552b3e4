"""A picture with depth, the mask of an object and clicks that the mask contradicts in; the corrected mask out.

A small U-Net sees a square about each such click, with the mask and all clicks, and says which pixels belong to the object. What
changes is the region about the click: the rest of the mask stays. It learnt on wrong masks of objects of worlds and photos, and
on boxes, in which it finds the object (`benchmarks/correction_network.py`). A mask that was carried into the picture from others
is corrected by a click amid it: pieces without depth are missing, rims are off where depth edges are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from dlama.geometry.drawing.picture_edges import CLEARLY, edge_uncertainty
from dlama.geometry.holes import (
    box_around,
    dilate_mask,
    disc,
    erode_mask,
    innermost_pixel,
    morphological_open,
    nearest_known,
    region_at,
    sides_of,
)
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.geometry.view import View
from dlama.models.network_file import shipped_network
from dlama.perception.masks.borders import decide_by_color
from dlama.perception.masks.click_network import (
    CLICK_PX,
    FOLDER,
    LARGEST_WINDOW,
    PLANES,
    SIDE,
    SMALLEST_WINDOW,
    click_planes,
    place_square,
    probability_in_window,
)
from dlama.perception.masks.prompt import Pixel, Prompt, square_about

NEAR = 1 / 16
"""Radius of what changes where the network finds no region, over the picture's longer side."""
NETWORK = FOLDER / "correction.onnx"
BAND_PX = 2
"""Half the width in px of the band along the border that colours decide where depth edges are off the picture's; parts as thin as
that stay as they are."""


def correct_mask(rgbd: RGBD, mask: BoolArray, prompt: Prompt, alone: Mapping[Pixel, BoolArray]) -> BoolArray:
    """The mask (H x W), in the prompt's box, with what clicks show that it lacks, without the regions of negative clicks.

    alone: (row, column) of the clicks to correct at -> H x W, the object that is found there alone; another one, of which
    the mask has hardly anything, is added whole.
    """
    for pixel, other in alone.items():
        if not mask[pixel]:
            apart = other[pixel] and (other & mask).sum() <= 0.1 * other.sum()
            whole = apart and not any(other[away] for away in prompt.away)
            mask = mask | other if whole else correct_at_click(rgbd, mask, pixel, prompt)
    for pixel in prompt.away:
        mask = correct_at_click(rgbd, mask, pixel, prompt) if mask[pixel] else mask
    return mask & prompt.inside


def correct_at_click(rgbd: RGBD, mask: BoolArray, pixel: Pixel, prompt: Prompt) -> BoolArray:
    """The mask with the region of a click at (row, column) that it lacks, or without it where it has it.

    Where the network finds no region, or one that holds a click of the other kind, what is near the click (`find_near`).
    """
    wrong, others = mask == mask[pixel], prompt.on if mask[pixel] else prompt.away
    radius = radius_to_see(mask, pixel)
    region, cell = find_region(rgbd, mask, pixel, prompt, radius)
    if region.any():
        # half the side of a square about the region, which it fills to two thirds
        closer = int(np.clip(1.5 * farthest(region, pixel), SMALLEST_WINDOW / 2, radius))
        region, cell = find_region(rgbd, mask, pixel, prompt, closer)
    if not region.any() or any(region[other] for other in others):
        region, cell = find_near(wrong, pixel, others), 1
    region[pixel] = True
    band = wrong & dilate_mask(region, cell) & ~erode_mask(region, cell)
    for click in (*prompt.on, *prompt.away):
        band[square_about(click, 1)] = False
    return decide_by_color(rgbd, mask ^ region, band)


def find_near(wrong: BoolArray, pixel: Pixel, others: Sequence[Pixel]) -> BoolArray:
    """H x W, the pixels of `wrong` in a disc about (row, column), to the mask's border, NEAR of the picture and half the way to a
    click of the other kind (`others`) at most."""
    border = float(nearest_known(~wrong)[0][pixel]) if not wrong.all() else math.inf
    reach = min([border, NEAR * max(wrong.shape), *(math.dist(pixel, other) / 2 for other in others)])
    v, u = np.ogrid[: wrong.shape[0], : wrong.shape[1]]
    return np.asarray(wrong & (np.hypot(v - pixel[0], u - pixel[1]) <= reach))


def radius_to_see(mask: BoolArray, pixel: Pixel) -> int:
    """Half the side in px of the square about (row, column) in which the network sees a mask (H x W), and a little more."""
    least, most = SMALLEST_WINDOW / 2, LARGEST_WINDOW * max(mask.shape) / 2
    return int(np.clip(1.1 * farthest(mask, pixel), least, most))


def farthest(where: BoolArray, pixel: Pixel) -> float:
    """Largest distance in px from (row, column) to a side of the box round `where` (H x W); 0 where that is empty."""
    if not where.any():
        return 0.0
    return max(float(abs(at - end)) for at, side in zip(pixel, box_around(where, 0)) for end in (side.start, side.stop))


def find_region(rgbd: RGBD, mask: BoolArray, pixel: Pixel, prompt: Prompt, radius: int) -> tuple[BoolArray, int]:
    """H x W, what the network finds wrong about (row, column), in a square of 2 radius + 1 px; and px of the picture for each of
    the network. Rims of the mask, as thin as that, are left out where more is wrong."""
    probability = corrected_probability(rgbd, mask, pixel, prompt, radius)
    cell, square, flip = max(1, round((2 * radius + 1) / SIDE)), square_about(pixel, radius), np.zeros_like(mask)
    inside = probability[square] > 0.5
    flip[square] = (inside != mask[square]) & (mask[square] == mask[pixel])
    near = square_about(pixel, 2 * cell)
    region = region_at(morphological_open(flip, disc(cell)), near)
    return region if region.any() else region_at(flip, near), cell


def corrected_probability(rgbd: RGBD, mask: BoolArray, pixel: Pixel, prompt: Prompt, radius: int) -> Float32Array:
    """H x W probability of each pixel of the square of 2 radius + 1 px about (row, column) belonging to the object."""
    found, _ = probability_in_window(correction_planes(rgbd, mask, pixel, prompt, radius), shipped_network(NETWORK))
    return place_square(found, pixel, radius, rgbd.depth.shape)


def correction_planes(rgbd: RGBD, mask: BoolArray, pixel: Pixel, prompt: Prompt, radius: int) -> Float32Array:
    """What the network sees of the square: the planes of a click at (row, column), the mask, clicks and negative clicks."""
    marks = [mark_clicks(mask.shape, pixels, radius) for pixels in (prompt.on, prompt.away)]
    return click_planes(rgbd, pixel, radius, [each.astype(np.float32) for each in (mask, *marks)])


def probability_in_box(rgbd: RGBD, prompt: Prompt) -> tuple[Float32Array, int]:
    """H x W probability of each pixel belonging to the object in the prompt's box, by its clicks too; and px of the picture for
    each of the network."""
    rows, columns = prompt.box_slices
    pixel = (rows.start + rows.stop) // 2, (columns.start + columns.stop) // 2
    radius = int(1.4 * max(sides_of((rows, columns))) / 2) + 2
    planes = correction_planes(rgbd, prompt.inside, pixel, prompt, radius)
    planes[PLANES.index("click")] = 0
    found, _ = probability_in_window(planes, shipped_network(NETWORK))
    return place_square(found, pixel, radius, prompt.hw), -(-(2 * radius + 1) // SIDE)


def mark_clicks(hw: tuple[int, ...], clicks: list[Pixel], radius: int) -> BoolArray:
    """H x W, True on discs about clicks, CLICK_PX of the network wide in a square of 2 radius + 1 px."""
    out, px = np.zeros(hw, np.uint8), max(1, round(CLICK_PX * (2 * radius + 1) / SIDE))
    for row, column in clicks:
        cv2.circle(out, (column, row), px, 1, -1)
    return out > 0


def correct_carried(view: View, mask: BoolArray, confirmed: BoolArray, barred: BoolArray) -> BoolArray:
    """The mask (H x W) as the picture shows it.

    confirmed: H x W, pixels of the mask that show what is amid a mask of another picture; barred: pixels that other pictures show
    outside their masks. A mask need not be of what the network knows as an object: its shadow may be part of it.
    """
    if not mask.any():
        return mask
    rgbd = RGBD(view.color, view.known_depth, view.camera)
    row, column = pixel = innermost_pixel(mask)
    prompt = Prompt(mask.shape, clicks=((column, row),))
    probability = corrected_probability(rgbd, mask, pixel, prompt, radius_to_see(mask, pixel))
    # carried pixels go where they hardly belong to the object, others come where they probably do
    found = confirmed | np.where(mask, probability > 0.1, (probability > 0.5) & ~barred)
    if view.find_once(edge_uncertainty) < CLEARLY:
        return found
    thin = found & ~dilate_mask(morphological_open(found, disc(BAND_PX)), 1)
    band = dilate_mask(found, BAND_PX) & ~erode_mask(found, BAND_PX) & ~dilate_mask(thin, BAND_PX)
    return decide_by_color(rgbd, found, band)
