"""A picture with estimated or noisy depth and clicks or a box in; the mask of the object out. The picture leads.

Estimated depth is right in its large forms only: objects have no edges, and the ground bends; matched depth is uneven. So depth
gives the window and the first guess (as near as the click, and no ground). GrabCut then cuts along colours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import box_around, larger_box, morphological_close, morphological_open, sides_of, square
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.borders import run_grabcut
from dlama.perception.masks.prompt import NothingThereError, Pixel, Prompt, square_about
from dlama.perception.planes import ESTIMATED_NOISE, find_planes, plane_values

AS_NEAR = 0.1
"""Largest relative difference of inverse depth from the click's in the first guess."""
ON_GROUND = 0.06
"""Largest relative difference from the ground plane where depth rises a little towards the camera (SLOPE_ON),"""
ABOUT_GROUND = 0.35
"""and where it rises nearly as steeply as the plane (SLOPE_ABOUT): estimated ground bends."""
SLOPE_ON, SLOPE_ABOUT = 0.3, 0.6
COLOR_STEP = 8.0
"""Largest difference in CIELAB units (lightness: twice) of a connected region of the click's colour."""
LARGEST_COLOR = 0.1
"""Largest share of the picture of such a region; larger ones are ignored."""
SEED_PX = 3
"""Radius of a click."""
NOTHING = 8.0
"""A mask with fewer pixels than this times the clicks times SEED_PX squared holds the clicks alone."""
SMALLEST_SIDE = 0.06
"""Least side of the window, over the picture's height."""
MARGIN = 0.25
"""Margin of the window on each side of the first guess, over its longer side."""
SURROUNDINGS = 0.6
"""Margin beyond the window in which background colours are learnt."""
ROUNDS = 5
"""Of GrabCut."""
BACKGROUND = 0.5
"""Share of the picture and of its upper border from which a region is background."""

ALL_GROUND = 0.8
"""Share of ground in a mask from which it is the ground itself, if it runs along the picture's lower border."""


@dataclass(frozen=True, eq=False)
class RoughDepth:
    """A picture, its inverse depth, and where the ground is."""

    color: UInt8Array
    w: Float32Array
    """H x W inverse depth, 0 where far."""
    ground: BoolArray
    ground_w: Float32Array | None
    """H x W inverse depth of the ground plane; None: no ground was found."""
    far: BoolArray
    """H x W, True on the sky."""


def check_surfaces(rgbd: RGBD) -> None:
    """MaskError where no pixel has a depth."""
    if not rgbd.valid.any():
        raise MaskError("depth is missing or far everywhere, so no object stands apart; depth with values is expected")


def rough_depth(rgbd: RGBD) -> RoughDepth:
    """Depth made ready for GrabCut. The ground is the plane with most pixels of the lower half that rises towards the camera."""
    w, valid = inverse_depth(rgbd.depth), rgbd.valid
    check_surfaces(rgbd)
    middle = float(np.median(w[valid]))
    top = len(w) // 2
    lower, best, plane = w[top:], 0, None
    near = 0.05 * np.maximum(lower, middle / 2)
    for one in find_planes(w, valid, 0, ESTIMATED_NOISE * middle):
        value = plane_values(one[None], lower.shape, top=top)[0]
        held = int((np.abs(value - lower) < near).sum()) if one[1] > 0 else 0
        if held > best:
            best, plane = held, one
    if plane is None:
        return RoughDepth(rgbd.color, w, np.zeros(w.shape, np.bool_), None, rgbd.far)
    chosen, slope = plane_values(plane[None], w.shape)[0], float(plane[1])
    step = max(1, min(max(3, len(w) // 64), (len(w) - 1) // 2))
    smooth, rise = cv2.blur(w, (2 * step + 1, 3)), np.zeros_like(w)
    rise[step:-step] = (smooth[2 * step :] - smooth[: -2 * step]) / (2 * step)
    rise[:step], rise[-step:] = rise[step], rise[-step - 1]  # the picture's rim is as steep as what lies next to it
    away = np.abs(chosen - w) / np.maximum(w, 1e-6)
    ground = (away < ON_GROUND) & (rise > SLOPE_ON * slope) | (away < ABOUT_GROUND) & (rise > SLOPE_ABOUT * slope)
    return RoughDepth(rgbd.color, w, morphological_open(ground, square(9)), chosen, rgbd.far)


def state_before_cut(rough: RoughDepth, prompt: Prompt) -> UInt8Array:
    """H x W, cv2.GC_...: probably the object in the box and in the first guess at each click; without a box, background for
    certain beyond the windows round them."""
    state = np.full(prompt.hw, cv2.GC_BGD, np.uint8)
    if prompt.box is not None:
        state[prompt.box_slices] = cv2.GC_PR_FGD
    for pixel in prompt.on:
        guess = first_guess(rough, pixel)
        if prompt.box is None:
            inside = find_window(rough, guess, pixel)
            state[inside] = np.where(state[inside] == cv2.GC_BGD, cv2.GC_PR_BGD, state[inside])
        state[guess & prompt.inside] = cv2.GC_PR_FGD
    return state


def rough_candidates(rough: RoughDepth, prompt: Prompt) -> dict[str, BoolArray]:
    """The H x W mask as `object`. MaskError where nothing is found, or the sky is clicked."""
    if prompt.clicks and all(rough.far[pixel] for pixel in prompt.on):
        raise NothingThereError(prompt.on[0], "which lies on the sky: nothing stands apart there")
    mask = cut_along_colors(rough.color, mark_clicks(state_before_cut(rough, prompt), prompt))
    if prompt.clicks:
        mask = keep_clicked_parts(mask, prompt)
        if mask.sum() < NOTHING * len(prompt.clicks) * SEED_PX**2:
            where = "where nothing stands apart in colour or rough depth"
            raise NothingThereError(prompt.on[0], where, "amid an object")
        if prompt.box is None:
            refuse_background(mask, prompt)
            refuse_ground(rough, mask, prompt)
    if not mask.any():
        raise MaskError(
            "box holds nothing that stands apart in colour; a box round an object is expected, or clicks on it"
        )
    return {"object": mask}


def mark_clicks(state: UInt8Array, prompt: Prompt) -> UInt8Array:
    """GrabCut's codes (H x W, changed in place) with the clicks marked."""
    for pixels, kind in ((prompt.on, cv2.GC_FGD), (prompt.away, cv2.GC_BGD)):
        for pixel in pixels:
            cv2.circle(state, pixel[::-1], SEED_PX, int(kind), -1)
    return state


def refuse_background(mask: BoolArray, prompt: Prompt) -> None:
    """MaskError where the region covers half of the picture and of its upper border."""
    if mask.mean() > BACKGROUND and mask[0].mean() > BACKGROUND:
        where = "where more than half of the picture and of its upper rim are connected: that is background (sky, wall)"
        raise NothingThereError(prompt.on[0], where)


def refuse_ground(rough: RoughDepth, mask: BoolArray, prompt: Prompt) -> None:
    """MaskError where the region is ground and runs along most of the picture's lower border."""
    if rough.ground[mask].mean() > ALL_GROUND and mask[-1].mean() > BACKGROUND:
        raise NothingThereError(prompt.on[0], "which lies on the ground: nothing stands apart there")


def first_guess(rough: RoughDepth, pixel: Pixel) -> BoolArray:
    """H x W, True on the region connected with a click at (row, column) that has its depth, or its colour."""
    here = float(np.median(rough.w[square_about(pixel, 2)]))
    near = (np.abs(rough.w - here) < AS_NEAR * here) & ~rough.ground
    clicked = near.astype(np.uint8)
    cv2.circle(clicked, pixel[::-1], SEED_PX, 1, -1)
    _, labels = cv2.connectedComponents(clicked, connectivity=8)
    guess = labels == labels[pixel]
    same = color_region(rough.color, pixel)
    return np.asarray(guess | same if same.mean() < LARGEST_COLOR else guess)


def color_region(color: UInt8Array, pixel: Pixel) -> BoolArray:
    """H x W, True on the region connected with a pixel (row, column) that has its colour."""
    lab = cv2.cvtColor(cv2.GaussianBlur(color, (0, 0), 1.0), cv2.COLOR_RGB2LAB)
    found = np.zeros((color.shape[0] + 2, color.shape[1] + 2), np.uint8)
    allowed = (2 * COLOR_STEP, COLOR_STEP, COLOR_STEP)
    how = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (1 << 8)
    cv2.floodFill(lab, found, (pixel[1], pixel[0]), 0, allowed, allowed, how)
    return np.asarray(found[1:-1, 1:-1] > 0)


def find_window(rough: RoughDepth, guess: BoolArray, pixel: Pixel) -> tuple[slice, slice]:
    """Rows and columns of the object's window: the guess, down to where the ground is as near as the click, and a margin."""
    rows, columns = box_around(guess, 0)
    height = guess.shape[0]
    if rough.ground_w is not None:
        below = np.flatnonzero(rough.ground_w[:, pixel[1]] >= rough.w[pixel])
        rows = slice(rows.start, max(rows.stop, int(below[0]) + 1 if len(below) else height))
    side = max(*sides_of((rows, columns)), int(SMALLEST_SIDE * height) + 1)
    return larger_box((rows, columns), int(MARGIN * side) + 4, guess.shape)


def cut_along_colors(color: UInt8Array, state: UInt8Array) -> BoolArray:
    """H x W, True on the object, by GrabCut from its codes (state, uint8 H x W); colours are learnt in the surroundings only."""
    asked = state != cv2.GC_BGD
    tight = box_around(asked, 0)
    box = larger_box(tight, int(SURROUNDINGS * (max(sides_of(tight)) - 1)) + 10, asked.shape)
    out = np.zeros(state.shape, np.bool_)
    out[box] = run_grabcut(np.ascontiguousarray(color[box]), np.ascontiguousarray(state[box]), ROUNDS)
    return out


def keep_clicked_parts(mask: BoolArray, prompt: Prompt) -> BoolArray:
    """The pieces of the mask that contain a click, with gaps of a pixel closed; without negative clicks."""
    _, labels = cv2.connectedComponents(morphological_close(mask, square(3)).astype(np.uint8), connectivity=8)
    numbers = {int(labels[pixel]) for pixel in prompt.on} - {0}
    out = np.isin(labels, list(numbers))
    for pixel in prompt.away:
        out[pixel] = False
    return np.asarray(out)
