"""A data set's frames with and without a thing in -> samples of kinds `removal` and `stereo`, out.

The hole is the thing's mask, grown as it is before a thing leaves the cloud (and kept to where both show one background).
Known pixels are those of the frame with the thing, so a shadow that it casts outside the mask stays; in the hole the truth is
the frame without it. Nothing is done to depth: a real sensor's faults are in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dlama.datasets.frames import RemovalTruth
from dlama.errors import MaskError
from dlama.evaluation.metrics.pictures import channel_gain, with_gain
from dlama.geometry.holes import dilated
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.perception.stereo_matching import carry_mask
from dlama.training.data.augment import mirrored, relit
from dlama.training.data.cases import StereoPair, Take
from dlama.training.data.crops import Window, drawn
from dlama.training.data.masks import random_mask
from dlama.training.data.view_samples import Question, fits, pair_sample
from dlama.training.data.world_samples import MOST_GROWN, finished, masked
from dlama.training.settings import NetworkSettings

MOST_DRAWS = 4
"""Squares of a frame that are tried; where the mask is next to nothing or everything in all of them, a random mask is taken."""


class CaseRemovals:
    """Kind `removal` of a data set, see `sources.SampleSource`: RemovalTruth behind each take."""

    def __init__(self, takes: tuple[Take, ...], network: NetworkSettings, size: int) -> None:
        self.takes, self.network, self.size = takes, network, size

    def __len__(self) -> int:
        return len(self.takes)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample: a random square that shows the thing."""
        return finished(self.question(index, rng), self.network, rng)

    def question(self, index: int, rng: np.random.Generator) -> Question:
        """The view that the method would meet. Where the frames do not show the same background, nothing is a hole."""
        case: RemovalTruth = self.takes[index].load()
        for _ in range(MOST_DRAWS):
            window = drawn(case.source.camera.hw, self.size, rng, case.mask)
            hole = grown([window.mask(case.mask)], rng)[0]
            if case.compare is not None:
                hole &= ~window.mask(~case.compare)
            if fits(hole):
                source, without = window.rgbd(case.source), window.rgbd(in_the_light_of_source(case))
                return masked(source, hole, pasted(source, without, hole))
        source = window.rgbd(case.source)
        return masked(source, random_mask(rng, source.camera.hw))


class CasePairs:
    """Kind `stereo` of a data set, see `sources.SampleSource`: a StereoPair behind each take."""

    def __init__(self, takes: tuple[Take, ...], network: NetworkSettings, size: int) -> None:
        self.takes, self.network, self.size = takes, network, size

    def __len__(self) -> int:
        return len(self.takes)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One pair: the same random square of both pictures."""
        return mirrored(relit(self.pair(index, rng), rng, 6), rng, 2)

    def pair(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """The pair before it is mirrored or relit: without the thing; of pairs that have none, with a random mask on the
        same surface in both pictures."""
        case: StereoPair = self.takes[index].load()
        hw = case.left.shape[0], case.left.shape[1]
        if case.masks is not None and case.without is not None:
            for _ in range(MOST_DRAWS):
                window = drawn(hw, self.size, rng, case.masks[0] | case.masks[1])
                holes = grown([window.mask(mask) for mask in case.masks], rng)
                if fits(holes[0] | holes[1]):
                    shown, without = _both(window, (case.left, case.right)), _both(window, case.without)
                    true = [np.where(hole[..., None], gone, one) for hole, gone, one in zip(holes, without, shown)]
                    return pair_sample(shown, true, holes, self.network)
        window = drawn(hw, self.size, rng)
        shown = _both(window, (case.left, case.right))
        return pair_sample(shown, shown, carried(window, case, rng), self.network)


def grown(masks: Sequence[BoolArray], rng: np.random.Generator) -> list[BoolArray]:
    """Masks of one thing grown by 1 to MOST_GROWN pixels, as before it leaves the cloud; each H x W."""
    radius = int(rng.integers(1, MOST_GROWN + 1))
    return [dilated(mask, radius) for mask in masks]


def pasted(source: RGBD, without: RGBD, hole: BoolArray) -> RGBD:
    """The frame, and in the hole (H x W) the frame without the thing."""
    color = np.where(hole[..., None], without.color, source.color)
    return RGBD(color, np.where(hole, without.depth, source.depth), source.camera)


def carried(window: Window, case: StereoPair, rng: np.random.Generator) -> list[BoolArray]:
    """A random mask of the left picture's part and where the pair's disparity has it in the right one's."""
    mask = random_mask(rng, (window.size, window.size))
    try:
        return [mask, carry_mask(mask, window.disparity(case.disparity))]
    except MaskError:  # no disparity is known anywhere in it
        return [mask, mask]


def in_the_light_of_source(case: RemovalTruth) -> RGBD:
    """The frame without the thing, at the exposure of the frame with it, by what both show."""
    if not case.exposure_varies:
        return case.without
    both = ~dilated(case.mask, MOST_GROWN)
    if case.compare is not None:
        both &= case.compare
    gain = channel_gain(case.without.color, case.source.color, both)
    return replace(case.without, color=with_gain(case.without.color, gain))


def _both(window: Window, pictures: tuple[UInt8Array, UInt8Array]) -> list[UInt8Array]:
    return [window.color(picture) for picture in pictures]
