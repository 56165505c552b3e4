"""A picture with depth and clicks or a box in; the mask of the object meant out.

Where depth is measured its pieces are candidates (`rgbd`), where it is estimated what is salient in the picture (`photo`). Of the
masks found a network chooses at clicks, or gives its own (`click_network`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import dilate_mask, erode_mask
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.borders import decide_by_color
from dlama.perception.masks.click_network import object_probability
from dlama.perception.masks.photo import PhotoMasker, name_masks
from dlama.perception.masks.prompt import NothingThereError, Prompt
from dlama.perception.masks.rgbd import Measured, correct_at_clicks, rgbd_candidates
from dlama.perception.masks.salient import WindowSaliency

ROUGH = "found in estimated depth, which is rough: look at the mask, or give depth"
AGREES, AGREES_ESTIMATED, AGREES_CAMERA = 0.4, 0.65, 0.8
"""Agreement of a mask with the network, over that of the network's own mask, from which it is taken: masks of depth that fits the
picture, of the photo alone, and of a depth camera's."""
LEAST = 0.2
"""Probability of an object at a click, below which the click is on the background."""


def rgbd_masker(rgbd: RGBD, model: None) -> Callable[[Prompt], tuple[dict[str, BoolArray], tuple[str, ...]]]:
    """The masker of one picture; its planes are found once. With estimated depth the picture leads."""
    find: Callable[[Prompt], dict[str, BoolArray]]
    seen, notes = None, tuple[str, ...]()
    if rgbd.estimate is not None:
        photo = PhotoMasker(rgbd)
        find, seen, agrees, notes = photo.candidates, photo.seen, AGREES_ESTIMATED, (ROUGH,)
    else:
        measured = Measured.of(rgbd)
        agrees, find = AGREES_CAMERA if measured.edge_offset else AGREES, partial(rgbd_candidates, measured)
    return lambda prompt: (choose_mask(rgbd, prompt, find, agrees, seen) if prompt.clicks else find(prompt), notes)


def choose_mask(
    rgbd: RGBD,
    prompt: Prompt,
    find: Callable[[Prompt], dict[str, BoolArray]],
    agrees: float,
    seen: WindowSaliency | None = None,
) -> dict[str, BoolArray]:
    """The mask of `find` that the network agrees with most, as `object`, and the others.

    The network's own where it agrees with none (`agrees`, as AGREES), where `find` has none, or fails where depth is missing at
    the clicks. MaskError: as `find`, and where no click is on an object and no box is given.

    seen: the picture's saliency where depth is estimated, None elsewhere.
    """
    network = NetworkMask.of(rgbd, prompt, seen)
    rated = rate_masks(rgbd, prompt, find, network)
    if prompt.box is None and (network.there < LEAST or not (rated or network.own.any())):
        where = "where nothing stands apart: that is ground, a wall or the sky"
        raise NothingThereError(prompt.on[0], where, "amid an object")
    masks = [mask for _, mask in rated]
    if rated and rated[0][0] >= agrees * network.iou(network.own):
        return name_masks(masks[0], masks[1:])
    return name_masks(network.fit(rgbd, prompt), masks)


def rate_masks(
    rgbd: RGBD, prompt: Prompt, find: Callable[[Prompt], dict[str, BoolArray]], network: NetworkMask
) -> list[tuple[float, BoolArray]]:
    """The masks of `find` with their agreement with the network, the best first; none where `find` fails and depth is missing at
    the clicks. MaskError: as `find`, elsewhere."""
    try:
        rated = [(network.iou(mask), mask) for mask in find(prompt).values()]
    except MaskError:
        if not (network.own.any() and all(rgbd.missing[pixel] for pixel in prompt.on)):
            raise
        return []
    return sorted(rated, key=lambda each: -each[0])


@dataclass(frozen=True, eq=False)
class NetworkMask:
    """What the network says of all clicks together."""

    probability: Float32Array
    """H x W, of belonging to the object, in the box of the prompt."""
    own: BoolArray
    """H x W, its mask."""
    reach: int
    """By how many pixels that may be off."""
    there: float
    """Probability that an object is at the click where that is likeliest."""

    @classmethod
    def of(cls, rgbd: RGBD, prompt: Prompt, seen: WindowSaliency | None) -> NetworkMask:
        """Of a picture. seen: as of `choose_mask`."""
        found = [object_probability(rgbd, pixel, seen) for pixel in prompt.on]
        whole = np.maximum.reduce([each.probability for each in found])
        probability = np.where(prompt.inside, whole, np.float32(0))
        reach, there = 1 + max(each.px for each in found), max(each.there for each in found)
        return cls(probability, probability > 0.5, reach, there)

    def iou(self, mask: BoolArray) -> float:
        """Expected intersection over union of a mask and the object."""
        return expected_iou(self.probability, mask)

    def fit(self, rgbd: RGBD, prompt: Prompt) -> BoolArray:
        """Its mask, along the picture's colours, with the clicks and without the negative ones."""
        band = dilate_mask(self.own, self.reach) & ~erode_mask(self.own, self.reach) & prompt.inside
        return correct_at_clicks(rgbd, decide_by_color(rgbd, self.own, band), prompt, prompt.on)


def expected_iou(probability: Float32Array, mask: BoolArray) -> float:
    """Intersection over union of a mask (H x W) and an object of which each pixel's probability is known."""
    both = float(probability[mask].sum())
    return both / max(float(probability.sum()) + float(mask.sum()) - both, 1e-6)
