"""A picture with depth and clicks or a box in; the mask of the object meant out.

Where depth is measured its pieces are candidates (`rgbd`), where it is estimated what is salient in the picture (`photo`). Of the
masks found a network chooses at a click, or gives its own (`click_network`); in a box that of corrections does. Further clicks
correct the mask (`corrections`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from dlama.errors import MaskError
from dlama.geometry.holes import dilate_mask, erode_mask, innermost_pixel
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.borders import decide_by_color
from dlama.perception.masks.click_network import object_probability
from dlama.perception.masks.corrections import correct_at_click, correct_mask, probability_in_box
from dlama.perception.masks.photo import PhotoMasker, name_masks
from dlama.perception.masks.prompt import NothingThereError, Pixel, Point, Pointed, Prompt
from dlama.perception.masks.rgbd import Measured, rgbd_candidates
from dlama.perception.masks.salient import WindowSaliency
from dlama.perception.masks.small import SmallPicture

ROUGH = "found in estimated depth, which is rough: look at the mask, or give depth"
AGREES, AGREES_ESTIMATED, AGREES_CAMERA = 0.4, 0.65, 0.8
"""Agreement of a mask with the network, over that of the network's own mask, from which it is taken: masks of depth that fits the
picture, of the photo alone, and of a depth camera's."""


def rgbd_masker(rgbd: RGBD, model: None) -> Pointed:
    """The masker of one picture; its planes are found once, of a large one in a smaller one. With estimated depth the picture
    leads."""
    if rgbd.estimate is not None:
        photo = PhotoMasker(rgbd)
        rough = Masker(rgbd, photo.candidates, AGREES_ESTIMATED, photo.seen)
        return lambda prompt: (rough.masks(prompt), (ROUGH,))
    if small := SmallPicture.of(rgbd):
        return small.find_with(rgbd_masker(small.rgbd, model))
    measured = Measured.of(rgbd)
    agrees = AGREES_CAMERA if measured.edge_offset else AGREES
    masker = Masker(rgbd, partial(rgbd_candidates, measured), agrees)
    return lambda prompt: (masker.masks(prompt), ())


@dataclass(frozen=True, eq=False)
class Masker:
    """A picture, and how objects are found in it."""

    rgbd: RGBD
    find: Callable[[Prompt], list[BoolArray]]
    """Masks (H x W) of one click, or of a box."""
    agrees: float
    """As AGREES."""
    seen: WindowSaliency | None = None
    """The picture's saliency where depth is estimated."""

    def masks(self, prompt: Prompt) -> dict[str, BoolArray]:
        """The masks of the box, or of the first click on an object, corrected at the other clicks. MaskError: the box holds
        nothing, or no click is on an object."""
        if prompt.box is not None:
            return self.correct(self.masks_in_box(prompt), prompt, prompt.clicks)
        refused = None
        for click in prompt.clicks:
            try:
                found = self.masks_of_click(Prompt(prompt.hw, (click,)))
            except NothingThereError as error:
                refused = refused or error
                continue
            return self.correct(found, prompt, [other for other in prompt.clicks if other != click])
        assert refused is not None
        raise refused

    def masks_in_box(self, prompt: Prompt) -> dict[str, BoolArray]:
        """The masks of a box. Objects of negative clicks are none of it, unless nothing else is in it. MaskError: it holds
        nothing."""
        network, others = NetworkMask.in_box(self.rgbd, prompt), np.zeros(prompt.hw, np.bool_)
        for click in prompt.not_clicks:
            others |= self.object_alone(Prompt(prompt.hw, (click,)))
        found = self.masks_apart_from(others, network, prompt)
        if not found and others.any():
            found = self.masks_apart_from(np.zeros_like(others), network, prompt)
        elif others.any():
            apart = ~dilate_mask(others, 2 * network.reach)
            if not any((mask & apart).any() for mask in found.values()):  # a rim of theirs
                raise MaskError(
                    "nothing is left in `box` but what `not_clicks` are on; another box is expected, or fewer of them"
                )
        if not found:
            raise MaskError("box holds nothing that stands apart; a box round an object is expected, or clicks on it")
        return found

    def masks_apart_from(self, others: BoolArray, network: NetworkMask, prompt: Prompt) -> dict[str, BoolArray]:
        """What is found in the box without `others` (H x W), and at the prompt's first click or amid the network's mask, or amid
        all that is left: the mask that the network agrees with most, or its own, as `object`, and the others; none where there is
        neither."""
        free = prompt.inside & ~others
        network = NetworkMask(np.where(free, network.probability, np.float32(0)), network.reach)
        amid, prompts = network.own if network.own.any() else free, [Prompt(prompt.hw, box=prompt.box)]
        if network.own.any() or (others.any() and free.any()):
            prompts.append(Prompt(prompt.hw, (*prompt.clicks, innermost_pixel(amid)[::-1])[:1]))
        found = list[BoolArray]()
        for one in prompts:
            with contextlib.suppress(MaskError):
                found += [mask & free for mask in self.find(one)]
            rated = network.rate(found)
            if rated and rated[0][0] >= 0.9 * network.own_iou:  # a click amid it takes time
                break
        return self.choose(rated, network, prompt) if found or network.own.any() else {}

    def choose(
        self, rated: list[tuple[float, BoolArray]], network: NetworkMask, prompt: Prompt
    ) -> dict[str, BoolArray]:
        """The first of the rated masks as `object` where it agrees with the network, else the network's own; and the others."""
        masks = [mask for _, mask in rated]
        if rated and rated[0][0] >= self.agrees * network.own_iou:
            return name_masks(masks[0], masks[1:])
        return name_masks(network.fit(self.rgbd, prompt), masks)

    def correct(self, found: dict[str, BoolArray], prompt: Prompt, clicks: Sequence[Point]) -> dict[str, BoolArray]:
        """The masks corrected at `clicks` of the prompt and at its negative ones."""
        if not (clicks or prompt.not_clicks):
            return found
        alone = dict[Pixel, BoolArray]()
        for one in (Prompt(prompt.hw, (click,)) for click in clicks):
            if not all(mask[one.on[0]] for mask in found.values()):
                alone[one.on[0]] = self.object_alone(one)
        first, *others = [correct_mask(self.rgbd, mask, prompt, alone) for mask in found.values()]
        return name_masks(first, others)

    def object_alone(self, prompt: Prompt) -> BoolArray:
        """H x W, the object of one click; empty where none is found."""
        try:
            return self.masks_of_click(prompt)["object"]
        except MaskError:
            return np.zeros(prompt.hw, np.bool_)

    def masks_of_click(self, prompt: Prompt) -> dict[str, BoolArray]:
        """The mask of `find` that the network agrees with most, as `object`, and the others.

        The network's own where it agrees with none, where `find` has none, or fails where depth is missing at the click.
        MaskError: as `find`, and where the click is on no object and no box is given.
        """
        network = NetworkMask.of(self.rgbd, prompt, self.seen)
        rated = self.rate_masks(prompt, network)
        if network.there < 0.2 or not (rated or network.own.any()):
            where = "where nothing stands apart: that is ground, a wall or the sky"
            raise NothingThereError(prompt.on[0], where, "amid an object")
        return self.choose(rated, network, prompt)

    def rate_masks(self, prompt: Prompt, network: NetworkMask) -> list[tuple[float, BoolArray]]:
        """The masks of `find` with their agreement with the network, the best first; none where `find` fails and depth is missing
        at the click. MaskError: as `find`, elsewhere."""
        try:
            return network.rate(self.find(prompt))
        except MaskError:
            if not (network.own.any() and self.rgbd.missing[prompt.on[0]]):
                raise
            return []


@dataclass(frozen=True, eq=False)
class NetworkMask:
    """What the network says of a click."""

    probability: Float32Array
    """H x W, of belonging to the object, in the box of the prompt."""
    reach: int
    """By how many pixels its mask may be off."""
    there: float = 1.0
    """Probability that an object is at the click."""

    @classmethod
    def of(cls, rgbd: RGBD, prompt: Prompt, seen: WindowSaliency | None) -> NetworkMask:
        """Of a prompt with one click. seen: the picture's saliency where depth is estimated."""
        probability, px, there = object_probability(rgbd, prompt.on[0], seen)
        return cls(probability, 1 + px, there)

    @classmethod
    def in_box(cls, rgbd: RGBD, prompt: Prompt) -> NetworkMask:
        """Of a prompt with a box."""
        probability, px = probability_in_box(rgbd, prompt)
        return cls(np.where(prompt.inside, probability, np.float32(0)), 1 + px)

    @cached_property
    def own(self) -> BoolArray:
        """H x W, its mask."""
        return self.probability > 0.5

    @cached_property
    def own_iou(self) -> float:
        """Expected intersection over union of its mask and the object."""
        return expected_iou(self.probability, self.own)

    def rate(self, masks: list[BoolArray]) -> list[tuple[float, BoolArray]]:
        """Masks with their expected intersection over union, the best first."""
        return sorted(((expected_iou(self.probability, mask), mask) for mask in masks), key=lambda each: -each[0])

    def fit(self, rgbd: RGBD, prompt: Prompt) -> BoolArray:
        """Its mask, along the picture's colours, with the prompt's first click."""
        band = dilate_mask(self.own, self.reach) & ~erode_mask(self.own, self.reach) & prompt.inside
        mask = decide_by_color(rgbd, self.own, band)
        missed = [pixel for pixel in prompt.on[:1] if not mask[pixel]]
        return correct_at_click(rgbd, mask, missed[0], prompt) if missed else mask


def expected_iou(probability: Float32Array, mask: BoolArray) -> float:
    """Intersection over union of a mask (H x W) and an object of which each pixel's probability is known."""
    both = float(probability[mask].sum())
    return both / max(float(probability.sum()) + float(mask.sum()) - both, 1e-6)
