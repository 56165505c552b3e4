"""Depth in; the standard deviation of the noise in its inverse, which it shows itself, out.

Most of a picture is planar, and planes are linear in inverse depth: what their second differences are not 0 by is noise. That of
stereo matching and of structured light is about as large at all distances there, that of a time-of-flight camera a share of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from dlama.geometry.codes import Origin
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, is_valid
from dlama.geometry.view import View

REACH, REACH_WIDTH = 4, 160
"""Distance in px of the differences, for neighbouring pixels are correlated; large pictures have so many of it on their longer
side, for noise is as smooth as they are."""
LINES, ENOUGH = 32, 1000
"""Rows and columns used; fewer differences do not distinguish noise from edges."""


def second_differences(w: Float32Array, known: BoolArray, reach: int) -> tuple[Float32Array, BoolArray]:
    """How far inverse depth (rows of pixels, 1/m) is from the mean of what lies `reach` px before and behind it, where all three
    are known; and where they are, for all pixels but the `reach` px at both ends."""
    before, here, after = slice(-2 * reach), slice(reach, -reach), slice(2 * reach, None)
    three = known[:, before] & known[:, here] & known[:, after]
    return np.abs(w[:, here] - (w[:, before] + w[:, after]) / 2)[three], three


class Noise(NamedTuple):
    """Noise of inverse depth; all 0 where too little is known to say."""

    constant: float
    """Its standard deviation (1/m), as if it were the same at all distances."""
    share: float
    """The same as a share of the inverse depth, where it rather is the same share at all distances; else 0."""
    middle: float
    """Median inverse depth (1/m)."""


def noise_of_lines(lines: Iterable[tuple[Float32Array, BoolArray]], reach: int) -> Noise:
    """By the `second_differences` of several pictures of inverse depth, where it is known.

    Of the nearer and the farther half the one with less noise counts: sensors whose noise is as large in metres at all distances
    have less in inverse depth where it is far. Which kind of noise it is, the halves say: they differ less in it.
    """
    bends, levels = [], []
    for w, known in lines:
        found, three = second_differences(w, known, reach)
        bends.append(found)
        levels.append(w[:, reach:-reach][three])
    bend, level = np.concatenate(bends), np.concatenate(levels)
    if bend.size < ENOUGH:
        return Noise(0.0, 0.0, 0.0)
    middle = np.median(level)
    halves = [half for half in (level >= middle, level < middle) if half.any()]
    constant = [deviation(bend[half]) for half in halves]
    share = [deviation(bend[half] / level[half]) for half in halves]
    is_share = max(share) * min(constant) < max(constant) * min(share)
    return Noise(min(constant), min(share) if is_share else 0.0, float(middle))


def deviation(bends: Float32Array) -> float:
    """Standard deviation of the values that these `second_differences` are of, by their median: edges do not count."""
    return float(np.median(bends)) / (0.6745 * math.sqrt(1.5))


def measured_noise(view: View) -> Noise:
    """Of what is measured of a layer."""
    reach = max(REACH, max(view.camera.hw) // REACH_WIDTH)
    lines = []
    for depth, origin in ((view.depth, view.origin), (view.depth.T, view.origin.T)):
        some = slice(None, None, max(1, len(depth) // LINES))
        measured = is_valid(depth[some]) & (origin[some] == Origin.MEASURED.value)
        lines.append((inverse_depth(depth[some]), measured))
    return noise_of_lines(lines, reach)


def noise_to_average(view: View) -> Noise:
    """The measured noise of a layer's depth; none where it is within the tolerance of the law of visibility."""
    noise = view.find_once(measured_noise)
    return noise if noise.constant > 0.001 * noise.middle else Noise(0.0, 0.0, noise.middle)
