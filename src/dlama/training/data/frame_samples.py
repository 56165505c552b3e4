"""Pairs of posed RGB-D frames in -> samples of another view out (kind `frame`): the target frame, seen from the source frame.

Real frames differ in exposure: one gain per channel brings the target to the source's light where both show the same.
"""

from __future__ import annotations

import numpy as np

from dlama.evaluation.metrics.pictures import channel_gain, with_gain
from dlama.geometry.holes import eroded
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.training.data.cases import Take
from dlama.training.data.crops import drawn, resized
from dlama.training.data.masks import random_mask
from dlama.training.data.photo_samples import there_and_back
from dlama.training.data.view_samples import Question, fits
from dlama.training.data.world_samples import finished, masked
from dlama.training.settings import NetworkSettings

DEPTH_AGREES = 0.03


class FrameSamples:
    """Kind `frame`, see `sources.SampleSource`."""

    def __init__(self, pairs: tuple[Take, ...], network: NetworkSettings, size: int) -> None:
        self.pairs, self.network, self.size = pairs, network, size

    def __len__(self) -> int:
        return len(self.pairs)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample: a random square of the target picture, in either direction of the pair."""
        return finished(self.question(index, rng), self.network, rng)

    def question(self, index: int, rng: np.random.Generator) -> Question:
        """The view that the method would meet."""
        pair = self.pairs[index].load()
        source, target = (pair.source, pair.target) if rng.random() < 0.5 else (pair.target, pair.source)
        target = drawn(target.camera.hw, self.size, rng).rgbd(target)
        source = resized(source, target.camera.fx / source.camera.fx)
        view = render(source, target.camera, types=False)
        if fits(view.hole):
            truth = in_the_light_of(view, target) if pair.exposure_varies else target
            return Question(view, truth, Law.of(Scene((View.from_rgbd(source),))))
        return masked(target, random_mask(rng, target.camera.hw))

    def shape(self, rng: np.random.Generator, size: int) -> BoolArray:
        """What is lost of one frame of a random pair between its camera and the other's: for kind `warped-photo`."""
        pair = self.pairs[int(rng.integers(len(self.pairs)))].load()
        source, target = (drawn(each.camera.hw, size, rng).rgbd(each) for each in (pair.source, pair.target))
        return there_and_back(source, target.camera)


def in_the_light_of(view: View, truth: RGBD) -> RGBD:
    """The truth at the exposure of the view, by what both show (same depth, off the hole's rim)."""
    w, true = inverse_depth(view.depth), inverse_depth(truth.depth)
    same = eroded(~view.hole, 1) & (true > 0) & (np.abs(w - true) <= DEPTH_AGREES * true)
    gain = channel_gain(truth.color, view.color, same)
    return RGBD(with_gain(truth.color, gain), truth.depth, truth.camera)
