"""A picture with depth and clicks or a box in; the mask of the object meant out.

Where depth is measured its pieces are candidates (`rgbd`), where it is rough the picture leads (`photo`, `rough`). Of the masks
found a network chooses at clicks, or gives its own (`click_network`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlama.errors import MaskError
from dlama.geometry.drawing.picture_edges import CLEARLY, edge_misalignment
from dlama.geometry.holes import dilate_mask, erode_mask
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.borders import decide_by_color
from dlama.perception.masks.click_network import object_probability
from dlama.perception.masks.photo import PhotoMasker, name_masks
from dlama.perception.masks.prompt import Prompt
from dlama.perception.masks.rgbd import correct_at_clicks, rgbd_candidates
from dlama.perception.masks.rough import rough_candidates, rough_depth
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.planes import noise_level

ROUGH = "found in estimated depth, which is rough: look at the mask, or give depth"
NOISY = "found in noisy depth: look at the mask"
MOST_NOISE = 0.02
"""Relative noise of inverse depth from which the picture leads, not depth."""
AGREES, AGREES_CAMERA = 0.4, 0.8
"""Agreement of a mask with the network, over that of the network's own mask, from which it is taken: masks of depth that fits the
picture or of the photo alone, and of a depth camera's."""


def rgbd_masker(rgbd: RGBD, model: None) -> Callable[[Prompt], tuple[dict[str, BoolArray], tuple[str, ...]]]:
    """The masker of one picture; its planes are found once. With estimated or noisy depth the picture leads."""
    agrees, notes = AGREES_CAMERA, tuple[str, ...]()
    find: Callable[[Prompt], dict[str, BoolArray]]
    if rgbd.estimate is not None:
        find, agrees, notes = PhotoMasker(rgbd).candidates, AGREES, (ROUGH,)
    elif is_noisy(rgbd):
        rough = rough_depth(rgbd)
        find, notes = (lambda prompt: rough_candidates(rough, prompt)), (NOISY,)
    else:
        found = find_planes_of_picture(rgbd)
        misaligned = edge_misalignment(rgbd.color, rgbd.depth, rgbd.valid, rgbd.far)
        edge_offset = misaligned if misaligned >= CLEARLY else 0
        agrees = AGREES_CAMERA if edge_offset else AGREES
        find = lambda prompt: rgbd_candidates(rgbd, found, prompt, edge_offset)  # noqa: E731
    return lambda prompt: (choose_mask(rgbd, prompt, find, agrees) if prompt.clicks else find(prompt), notes)


def choose_mask(
    rgbd: RGBD, prompt: Prompt, find: Callable[[Prompt], dict[str, BoolArray]], agrees: float
) -> dict[str, BoolArray]:
    """The mask of `find` that the network agrees with most, as `object`, and the others.

    The network's own where it agrees with none (`agrees`, as AGREES), or where depth is missing at the clicks. MaskError: as
    `find`.
    """
    clicks = Prompt.pixels(prompt.clicks)
    found = [object_probability(rgbd, pixel) for pixel in clicks]
    probability = np.where(prompt.inside, np.maximum.reduce([each for each, _ in found]), np.float32(0))
    own, reach = probability > 0.5, 1 + max(px for _, px in found)
    try:
        rated = [(expected_iou(probability, mask), mask) for mask in find(prompt).values()]
    except MaskError:
        if not own.any() or not all(rgbd.missing[pixel] for pixel in clicks):
            raise
        rated = []
    rated.sort(key=lambda each: -each[0])
    masks = [mask for _, mask in rated]
    if rated and rated[0][0] >= agrees * expected_iou(probability, own):
        return name_masks(masks[0], masks[1:])
    band = dilate_mask(own, reach) & ~erode_mask(own, reach) & prompt.inside
    return name_masks(correct_at_clicks(rgbd, decide_by_color(rgbd, own, band), prompt, clicks), masks)


def expected_iou(probability: Float32Array, mask: BoolArray) -> float:
    """Intersection over union of a mask (H x W) and an object of which each pixel's probability is known."""
    both = float(probability[mask].sum())
    return both / max(float(probability.sum()) + float(mask.sum()) - both, 1e-6)


def is_noisy(rgbd: RGBD) -> bool:
    """True where surfaces are so uneven, as in stereo matching, that pieces are not connected."""
    if not rgbd.valid.any():
        return False
    w = inverse_depth(rgbd.depth)
    return noise_level(w, rgbd.valid) > MOST_NOISE * float(np.median(w[rgbd.valid]))
