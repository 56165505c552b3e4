"""Rim kernels: a picture and its surfaces in; the local mean of known pixels of the same surface out (numba)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.kernels.jit import Whole, kernel
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

APART = 0.08
"""Largest relative difference of inverse depth within one surface: no plane is many objects."""


class Picture(NamedTuple):
    """Colours and surfaces, H x W (x 3)."""

    color: UInt8Array
    known: NDArray[np.int8]
    """Label of pixels that count, any other number elsewhere (and at the places that are looked at)."""
    label: NDArray[np.int8]
    """Of all, and their inverse depth."""
    w: Float32Array


@kernel
def mean_known(
    first: Whole,
    last: Whole,
    picture: Picture,
    places: NDArray[np.int32],
    reach: Whole,
    out: Float32Array,
    found: BoolArray,
) -> None:
    """N x 3 mean of the known pixels of the same surface within `reach` px, by the inverse fourth power of distance, at the flat
    `places` first..last of N (out); and N, True where there are any (found)."""
    color, known, label, w = picture
    height, width = w.shape
    for n in range(first, last):
        y, x = places[n] // width, places[n] % width
        total, red, green, blue = 0.0, 0.0, 0.0, 0.0
        for j in range(max(0, y - reach), min(height, y + reach + 1)):
            for i in range(max(0, x - reach), min(width, x + reach + 1)):
                square = (j - y) * (j - y) + (i - x) * (i - x)
                if square > reach * reach or known[j, i] != label[y, x]:
                    continue
                if abs(w[j, i] - w[y, x]) > APART * w[y, x]:
                    continue
                share = 1.0 / (square * square)
                total += share
                red += share * color[j, i, 0]
                green += share * color[j, i, 1]
                blue += share * color[j, i, 2]
        found[n] = total > 0
        if total > 0:
            out[n, 0], out[n, 1], out[n, 2] = red / total, green / total, blue / total
