"""A mask of measured depth, misaligned with the picture, in; the mask with its outline on the picture's edges out.

A depth camera misplaces edges by a few pixels and loses the ground contact in noise. First the whole outline is shifted to
where the picture's gradient along it is largest. Then pixels near it are classified by the colours of object and surroundings
(Parzen windows). A random walker (Grady 2006), which picture edges stop, decides where colours are alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.holes import box_around, dilate_mask, disc, erode_mask, morphological_open
from dlama.geometry.kernels.jit import in_bands
from dlama.geometry.kernels.relaxing import relax
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.perception.kernels.outlines import color_odds

MORE_PX = 2
"""Pixels added to the misalignment of depth edges: the band that colours decide."""
THIN_PX = 2
"""The same in parts narrower than the misalignment."""
SAMPLED_PX = 14
"""Radius in px, beyond the undecided pixels, in which colours are learnt."""
SPREAD = 6.0
"""Parzen bandwidth in CIELAB units: noise and compression."""
FLOOR = 0.01
"""Density of a colour that neither side has."""
LEAST_SAMPLES = 6
"""Least number of pixels from which a side's colours are learnt."""
MOST_ODDS = 3.0
"""Largest log odds of colour."""
DEPTH_ODDS = 1.0
"""Log odds of the object in its thin parts, as depth has them."""
SHOWN, SHOWN_ALONE = 0.5, 0.8
"""Weight of saliency next to colours, and its weight where depth is unknown."""
NEAR = 2
"""Saliency counts within this many band widths of the salient region's outline."""
CONTACT_MARGIN = 12
"""Pixels by which ground contact or missing depth may extend a mask."""
PULL = 0.3
"""Weight of a pixel's colour likelihood against its bond to an equal neighbour."""
CLINGS = 1e-3
"""Least bond between neighbours, across the clearest edge."""
OVER, SWEEPS, SETTLED = 1.8, 200, 2e-3
"""Of successive over-relaxation."""
GAIN, LESS = 0.15, 0.02
"""Relative gain in gradient that justifies a shift of the outline, and penalty per pixel of shift."""
STRONGEST, LEAST_STEP = 0.9, 10.0
"""Gradients are clipped at this quantile, or at so many CIELAB units."""


@dataclass(frozen=True, eq=False)
class Doubt:
    """Where depth is ambiguous about a mask."""

    reach: int
    """Misalignment of depth edges with the picture, px."""
    unknown: BoolArray
    """H x W, pixels that depth cannot classify: missing, or possible ground contact."""
    level: Float32Array | None = None
    """H x W saliency in 0..1, if a salient region shows the same object; given together with `agreed`."""
    agreed: BoolArray | None = None
    """H x W, the salient part of that object."""

    def within(self, box: tuple[slice, slice]) -> Doubt:
        """The same for a part of the picture."""
        level = None if self.level is None else self.level[box]
        return Doubt(self.reach, self.unknown[box], level, None if self.agreed is None else self.agreed[box])


def refine_outline(color: UInt8Array, target: BoolArray, doubt: Doubt) -> BoolArray:
    """The mask (H x W) with its outline on the picture's edges. color: H x W x 3."""
    about = target if doubt.agreed is None else target | doubt.agreed
    box = box_around(about, CONTACT_MARGIN + 2 * doubt.reach + SAMPLED_PX + 4)
    smooth = cv2.GaussianBlur(np.ascontiguousarray(color[box]), (0, 0), 0.7)
    lab = cv2.cvtColor(smooth.astype(np.float32) / np.float32(255), cv2.COLOR_RGB2LAB)
    out = target.copy()
    out[box] = refine_crop(np.asarray(lab, np.float32), target[box], doubt.within(box))
    return out


def refine_crop(lab: Float32Array, target: BoolArray, doubt: Doubt) -> BoolArray:
    """`refine_outline` of a part of the picture; lab: H x W x 3 CIELAB."""
    wide = doubt.reach + MORE_PX
    move = best_move(lab, target, doubt.reach)
    target, unknown = (translate(each, move) for each in (target, doubt.unknown))
    thin = thin_parts(target, wide)
    inside = (erode_mask(target, wide) & ~unknown) | (erode_mask(target, THIN_PX) & thin)
    about = dilate_mask(target, wide) | dilate_mask(unknown & ~target, MORE_PX)
    if doubt.agreed is not None:
        about |= doubt.agreed & doubt.unknown
    seen_through = erode_mask(~target, THIN_PX) & thin_parts(~target, wide) & ~unknown
    outside = ~(about | inside) | seen_through
    open_ = ~inside & ~outside
    if not inside.any() or not open_.any() or not outside.any():
        return target
    odds = color_log_odds(lab, open_, inside | thin, outside, wide + SAMPLED_PX)
    odds += np.where(thin & ~unknown, DEPTH_ODDS, 0)
    if doubt.level is not None and doubt.agreed is not None:
        shown = np.clip(np.log((doubt.level + 0.01) / (1.01 - doubt.level)), -MOST_ODDS, MOST_ODDS)
        its_outline = dilate_mask(doubt.agreed & ~erode_mask(doubt.agreed, 1), NEAR * wide)
        shown *= np.where(unknown, SHOWN_ALONE, np.where(its_outline, SHOWN, 0))
        odds += np.where(dilate_mask(thin, wide), np.maximum(shown, 0), shown)
    return random_walk(lab, open_, odds, inside) > 0.5


def color_log_odds(lab: Float32Array, open_: BoolArray, ours: BoolArray, theirs: BoolArray, reach: int) -> Float32Array:
    """H x W log odds, clipped to MOST_ODDS, that undecided pixels have the colours of `ours` near them, not of `theirs`; 0
    elsewhere."""
    odds = np.zeros(open_.shape, np.float32)
    in_bands(color_odds, len(lab), lab, open_, ours, theirs, reach, SPREAD, FLOOR, LEAST_SAMPLES, odds)
    return np.clip(odds, -MOST_ODDS, MOST_ODDS)


def thin_parts(target: BoolArray, wide: int) -> BoolArray:
    """H x W, True on parts of a mask narrower than twice `wide`."""
    return target & ~dilate_mask(morphological_open(target, disc(wide)), 1)


def random_walk(lab: Float32Array, open_: BoolArray, odds: Float32Array, inside: BoolArray) -> Float32Array:
    """H x W probability that a random walker from an undecided pixel ends on the object; 1 inside, 0 elsewhere."""
    holds = []
    steps = [(np.diff(lab, axis=axis) ** 2).sum(2) for axis in (1, 0)]
    about = open_ | inside
    both = np.concatenate([steps[0][about[:, 1:]], steps[1][about[1:]]])
    usual = 2 * max(float(both.mean()), 1e-3)
    for axis, step in zip((1, 0), steps):
        hold = np.zeros(open_.shape, np.float32)
        (hold[:, :-1] if axis else hold[:-1])[...] = np.exp(-step / usual) + CLINGS
        holds.append(hold)
    pull = (PULL * np.abs(np.tanh(odds / 2))).astype(np.float32)
    probability = (1 / (1 + np.exp(-odds))).astype(np.float32)
    level = np.where(open_, probability, inside).astype(np.float32)
    for _ in range(SWEEPS):
        if relax(holds[0], holds[1], open_, pull, probability, OVER, level) < SETTLED:
            break
    return level


def best_move(lab: Float32Array, target: BoolArray, reach: int) -> tuple[int, int]:
    """Rows and columns that shift the outline to the largest gradient; (0, 0) unless clearly better."""
    across, down = (np.zeros(target.shape, np.float32) for _ in range(2))
    across[:, 1:-1] = np.sqrt(((lab[:, 2:] - lab[:, :-2]) ** 2).sum(2))
    down[1:-1] = np.sqrt(((lab[2:] - lab[:-2]) ** 2).sum(2))
    shape = cv2.GaussianBlur(target.astype(np.float32), (0, 0), 1.5)
    rise_down, rise_across = np.gradient(shape)
    rows, columns = np.nonzero(target & ~erode_mask(target, 1))
    norm = np.hypot(rise_down, rise_across)[rows, columns] + 1e-6
    normal = np.abs(rise_down[rows, columns]) / norm, np.abs(rise_across[rows, columns]) / norm
    bound = max(float(np.quantile(np.maximum(across, down), STRONGEST)), LEAST_STEP)
    best, least, chosen = -1.0, 0.0, (0, 0)
    for r in range(-reach, reach + 1):
        for c in range(-reach, reach + 1):
            v, u = np.clip(rows + r, 0, len(lab) - 1), np.clip(columns + c, 0, lab.shape[1] - 1)
            step = np.minimum(normal[0] * down[v, u] + normal[1] * across[v, u], bound).mean()
            score = float(step) * (1 - LESS * float(np.hypot(r, c)))
            if (r, c) == (0, 0):
                least = score
            if score > best:
                best, chosen = score, (r, c)
    return chosen if best > (1 + GAIN) * least else (0, 0)


def translate(mask: BoolArray, by: tuple[int, int]) -> BoolArray:
    """A mask (H x W) moved by rows and columns."""
    shift = np.array([[1, 0, by[1]], [0, 1, by[0]]], np.float32)
    return np.asarray(cv2.warpAffine(mask.astype(np.uint8), shift, mask.shape[::-1], flags=cv2.INTER_NEAREST) > 0)
