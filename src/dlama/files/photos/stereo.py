"""The two pictures of a stereo photo in; the disparity of the left one, without holes, out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from dlama.errors import DepthError
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.perception.stereo.matching import disparity_pair


def match_stereo_photo(file: Path, left: UInt8Array, right: UInt8Array) -> tuple[Float32Array, float]:
    """Disparity (h x w px of the shrunk picture; unmatched pixels take the nearest matched one), and the share that matched.

    left, right: H x W x 3 RGB. Raises DepthError, which names the file: sizes that differ, pictures that do not match.
    """
    one, other = _shrink(left), _shrink(right)
    if one.shape != other.shape:
        raise DepthError(f"{file}: its two pictures are of different sizes")
    disparity, _ = disparity_pair(one, other, min_disparity=-round(0.05 * one.shape[1]))  # the cameras may converge
    known = disparity != 0
    share = float(known.mean())
    if share < 0.1:
        raise DepthError(f"{file}: its two pictures do not match; is it a stereo photo?")
    return fill_with_nearest(disparity, known), share


def _shrink(color: UInt8Array) -> UInt8Array:
    width = min(1024, color.shape[1])
    height = round(color.shape[0] * width / color.shape[1])
    return np.asarray(Image.fromarray(color).resize((width, height), Image.Resampling.BOX))
