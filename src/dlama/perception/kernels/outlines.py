"""Numba kernel of outlines: colours and known object and background pixels in; log odds of the undecided pixels out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.kernels.jit import Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array


@kernel
def color_odds(
    first: Whole,
    last: Whole,
    lab: Float32Array,
    open_: BoolArray,
    inside: BoolArray,
    outside: BoolArray,
    reach: Whole,
    spread: float,
    floor: float,
    least: Whole,
    odds: Float32Array,
) -> None:
    """Log odds that undecided pixels have the object's colours, by Parzen windows over the known pixels around each.

    lab: H x W x 3 CIELAB. open_ (undecided), inside, outside: H x W bool. reach: radius in px, every second pixel is read.
    spread: standard deviation of a colour, CIELAB units. floor: density of colours that neither side has. least: samples that a
    side needs. odds: H x W float32, set where open in rows first..last.
    """
    rows, columns = open_.shape
    scale = -0.5 / (spread * spread)
    for row in range(first, last):
        for column in range(columns):
            if not open_[row, column]:
                continue
            ours, theirs = 0.0, 0.0
            here, there = 0, 0
            for r in range(max(row - reach, 0), min(row + reach + 1, rows), 2):
                for c in range(max(column - reach, 0), min(column + reach + 1, columns), 2):
                    one, other = inside[r, c], outside[r, c]
                    if not one and not other:
                        continue
                    light = lab[r, c, 0] - lab[row, column, 0]
                    red = lab[r, c, 1] - lab[row, column, 1]
                    blue = lab[r, c, 2] - lab[row, column, 2]
                    power = scale * (light * light + red * red + blue * blue)
                    density = np.exp(power) if power > -12.5 else 0.0
                    if one:
                        ours += density
                        here += 1
                    else:
                        theirs += density
                        there += 1
            odds[row, column] = 0.0
            if here >= least and there >= least:
                odds[row, column] = np.log((ours / here + floor) / (theirs / there + floor))
