"""A picture with depth and the mask of an object that other pictures carried into it in; the mask that this picture shows out.

What is carried has the faults of depth: pieces without depth are missing, rims are off where depth edges are. The network of
corrections (`corrections`) sees the mask with a click amid it.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.drawing.picture_edges import CLEARLY, edge_uncertainty
from dlama.geometry.holes import dilate_mask, disc, erode_mask, innermost_pixel, morphological_open
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View
from dlama.perception.masks.borders import decide_by_color
from dlama.perception.masks.corrections import corrected_probability, radius_to_see
from dlama.perception.masks.prompt import Prompt

KEPT, ADDED = 0.1, 0.5
"""Least probability of a carried pixel, and of another one, that belongs to the object."""
BAND_PX = 2
"""Half the width in px of the band along the border that colours decide where depth edges are off the picture's; parts as thin as
that stay as they are."""


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
    found = confirmed | np.where(mask, probability > KEPT, (probability > ADDED) & ~barred)
    if view.find_once(edge_uncertainty) < CLEARLY:
        return found
    thin = found & ~dilate_mask(morphological_open(found, disc(BAND_PX)), 1)
    band = dilate_mask(found, BAND_PX) & ~erode_mask(found, BAND_PX) & ~dilate_mask(thin, BAND_PX)
    return decide_by_color(rgbd, found, band) if band.any() else found
