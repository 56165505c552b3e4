"""Pairs of posed RGB-D frames in -> samples of another view out (kind `frame`): the target frame, seen from the source frame.

Real frames differ in exposure: one gain per channel brings the target to the source's light where both show the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dlama.datasets.frames import Case, Dataset, ViewTruth
from dlama.errors import InputError
from dlama.evaluation.metrics import channel_gain, with_gain
from dlama.geometry.camera import Camera
from dlama.geometry.drawing import inverse_depth
from dlama.geometry.holes import eroded
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.training.masks import random_mask
from dlama.training.photo_samples import there_and_back
from dlama.training.photos import held_out_of
from dlama.training.settings import NetworkSettings
from dlama.training.view_samples import Question, fits
from dlama.training.world_samples import finished, masked

ARROW = "_to_"
"""Between the names of two frames in the name of a case."""
DEPTH_AGREES = 0.03
SMALLEST_CROP = 0.7
"""Of the smaller side: how much of the target picture a sample shows at least."""


@dataclass(frozen=True)
class Pair:
    """Two frames of one scene, not yet read."""

    scene: str
    """With the data set's name before it."""
    name: str
    frames: frozenset[str]
    """The names of both, as far as they are known, so that no frame is trained on and held out."""
    load: Callable[[], ViewTruth]
    """Picklable."""


def pairs_of(dataset: Dataset) -> tuple[Pair, ...]:
    """The pairs that a data set's cases of protocol `vpi` are made of."""
    return tuple(_pair(case) for case in dataset.of("vpi"))


def _pair(case: Case) -> Pair:
    return Pair(f"{case.dataset}/{case.scene}", case.frame, frozenset(case.frame.split(ARROW)), case.load)  # type: ignore[arg-type]


def split_pairs(pairs: Sequence[Pair], split: str) -> tuple[Pair, ...]:
    """The pairs of one split: by scene where there are several; else the trained ones share no frame with the held-out.

    InputError where nothing would be left to train on.
    """
    held = split == "held_out"
    scenes = {pair.scene for pair in pairs}
    if len(scenes) > 1:
        kept = held_out_of(scenes, "scenes")
        return tuple(pair for pair in pairs if (pair.scene in kept) == held)
    chosen = held_out_of({pair.name for pair in pairs}, "pairs of frames")
    first = tuple(pair for pair in pairs if pair.name in chosen)
    if held:
        return first
    taken = frozenset().union(*(pair.frames for pair in first))
    rest = tuple(pair for pair in pairs if not pair.frames & taken)
    if not rest:
        raise InputError(
            f"all {len(pairs)} pairs of frames of {next(iter(scenes))} share frames with the held-out ones; "
            "two or more scenes are wanted"
        )
    return rest


class FrameSamples:
    """Kind `frame`, see `sources.SampleSource`."""

    def __init__(self, pairs: tuple[Pair, ...], network: NetworkSettings, size: int) -> None:
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
        target = random_square(target, self.size, rng)
        source = resized(source, target.camera.fx / source.camera.fx)
        view = render(source, target.camera, types=False)
        if fits(view.hole):
            truth = in_the_light_of(view, target) if pair.exposure_varies else target
            return Question(view, truth, Law.of(Scene((View.from_rgbd(source),))))
        return masked(target, random_mask(rng, target.camera.hw))

    def shape(self, rng: np.random.Generator, size: int) -> BoolArray:
        """What is lost of one frame of a random pair between its camera and the other's: for kind `warped-photo`."""
        pair = self.pairs[int(rng.integers(len(self.pairs)))].load()
        source = random_square(pair.source, size, rng)
        return there_and_back(source, random_square(pair.target, size, rng).camera)


def random_square(rgbd: RGBD, size: int, rng: np.random.Generator) -> RGBD:
    """A square of a frame, brought to size x size pixels, and its camera with it."""
    height, width = rgbd.camera.hw
    side = round(min(height, width) * rng.uniform(SMALLEST_CROP, 1))
    top, left = int(rng.integers(0, height - side + 1)), int(rng.integers(0, width - side + 1))
    part = np.s_[top : top + side, left : left + side]
    c = rgbd.camera
    camera = Camera(side, side, c.fx, c.fy, c.cx - left, c.cy - top, c.world_from_cam)
    return resized(RGBD(rgbd.color[part], rgbd.depth[part], camera), size / side)


def resized(rgbd: RGBD, factor: float) -> RGBD:
    """A frame with `factor` times as many pixels a side (rounded): colour by area means, depth by the nearest pixel."""
    import cv2

    camera = rgbd.camera
    width, height = max(1, round(camera.width * factor)), max(1, round(camera.height * factor))
    across, down = width / camera.width, height / camera.height
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    color = np.asarray(cv2.resize(rgbd.color, (width, height), interpolation=how), np.uint8)
    rows = ((np.arange(height) + 0.5) / down).astype(np.intp)
    columns = ((np.arange(width) + 0.5) / across).astype(np.intp)
    numbers = camera.fx * across, camera.fy * down, camera.cx * across, camera.cy * down
    depth = rgbd.depth[rows[:, None], columns]
    return RGBD(color, depth, Camera(width, height, *numbers, camera.world_from_cam))


def in_the_light_of(view: View, truth: RGBD) -> RGBD:
    """The truth at the exposure of the view, by what both show (same depth, off the hole's rim)."""
    w, true = inverse_depth(view.depth), inverse_depth(truth.depth)
    same = eroded(~view.hole, 1) & (true > 0) & (np.abs(w - true) <= DEPTH_AGREES * true)
    gain = channel_gain(truth.color, view.color, same)
    return RGBD(with_gain(truth.color, gain), truth.depth, truth.camera)
