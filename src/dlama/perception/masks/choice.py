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
from dlama.perception.masks.prompt import Prompt, nothing_at
from dlama.perception.masks.rgbd import correct_at_clicks, rgbd_candidates
from dlama.perception.masks.rough import rough_candidates, rough_depth
from dlama.perception.masks.salient import WindowSaliency
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.planes import noise_level

ROUGH = "found in estimated depth, which is rough: look at the mask, or give depth"
NOISY = "found in noisy depth: look at the mask"
MOST_NOISE = 0.02
"""Relative noise of inverse depth from which the picture leads, not depth."""
AGREES, AGREES_ESTIMATED, AGREES_CAMERA = 0.4, 0.65, 0.8
"""Agreement of a mask with the network, over that of the network's own mask, from which it is taken: masks of depth that fits the
picture, of the photo alone, and of a depth camera's."""
LEAST, CONFIDENT = 0.2, 0.85
"""Probability of an object at a click, below which the click is on the background; and in estimated depth agreement of the
network with its own mask, above which it decides where nothing else is found."""


def rgbd_masker(rgbd: RGBD, model: None) -> Callable[[Prompt], tuple[dict[str, BoolArray], tuple[str, ...]]]:
    """The masker of one picture; its planes are found once. With estimated or noisy depth the picture leads."""
    agrees, notes = AGREES_CAMERA, tuple[str, ...]()
    find: Callable[[Prompt], dict[str, BoolArray]]
    seen = None
    if rgbd.estimate is not None:
        photo = PhotoMasker(rgbd)
        find, seen, agrees, notes = photo.candidates, photo.seen, AGREES_ESTIMATED, (ROUGH,)
    elif is_noisy(rgbd):
        rough = rough_depth(rgbd)
        find, notes = (lambda prompt: rough_candidates(rough, prompt)), (NOISY,)
    else:
        found = find_planes_of_picture(rgbd)
        misaligned = edge_misalignment(rgbd.color, rgbd.depth, rgbd.valid, rgbd.far)
        edge_offset = misaligned if misaligned >= CLEARLY else 0
        agrees = AGREES_CAMERA if edge_offset else AGREES
        find = lambda prompt: rgbd_candidates(rgbd, found, prompt, edge_offset)  # noqa: E731
    return lambda prompt: (choose_mask(rgbd, prompt, find, agrees, seen) if prompt.clicks else find(prompt), notes)


def choose_mask(
    rgbd: RGBD,
    prompt: Prompt,
    find: Callable[[Prompt], dict[str, BoolArray]],
    agrees: float,
    seen: WindowSaliency | None = None,
) -> dict[str, BoolArray]:
    """The mask of `find` that the network agrees with most, as `object`, and the others.

    The network's own where it agrees with none (`agrees`, as AGREES), or `find` fails where depth is missing at the clicks or, in
    estimated depth, the network is confident. MaskError: as `find`, and where no click is on an object and no box is given.

    seen: the picture's saliency where depth is estimated, None elsewhere.
    """
    clicks = prompt.on
    found = [object_probability(rgbd, pixel, seen) for pixel in clicks]
    probability = np.where(prompt.inside, np.maximum.reduce([each for each, *_ in found]), np.float32(0))
    own, reach = probability > 0.5, 1 + max(px for _, px, _ in found)
    try:
        rated = [(expected_iou(probability, mask), mask) for mask in find(prompt).values()]
    except MaskError:
        confident = (
            seen is not None
            and expected_iou(probability, own) > CONFIDENT
            and not any(rgbd.far[pixel] for pixel in clicks)
        )
        if not own.any() or not (confident or all(rgbd.missing[pixel] for pixel in clicks)):
            raise
        rated = []
    if prompt.box is None and max(there for *_, there in found) < LEAST:
        where = "where nothing stands apart: that is ground, a wall or the sky"
        raise nothing_at(clicks[0], where, "amid an object")
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
