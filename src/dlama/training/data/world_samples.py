"""A procedural world in -> samples whose truth is exact out: another view (`world`), an object gone (`removal`), and gone from
both pictures of a pair (`stereo`).

Every sample is what the method itself would meet: a source frame, rendered or masked by the same code as at run time. What is
removed may be any thing of a world, half the time its object of interest. Behind it the truth is cast through that one thing,
so its shadow stays where it was: the known pixels show it, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilated
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import HoleType, View
from dlama.geometry.visibility import Law
from dlama.training.data.augment import mirrored, relit, with_faults
from dlama.training.data.masks import random_mask
from dlama.training.data.view_samples import Question, fits, pair_sample, view_sample
from dlama.training.data.world_views import Galleries, Gallery
from dlama.training.settings import NetworkSettings

SENSOR_SHARE = 0.08
"""How often the question is a frame's own sensor holes."""
MOST_GROWN = 4
"""An object mask grows by 1 to so many pixels, as before it leaves the cloud."""
OBJECT_SHARE = (0.005, 0.25)
"""Share of the picture that what is removed covers."""


class WorldSamples:
    """Kind `world`, see `sources.SampleSource`: the view from another camera, known where the source frame shows it."""

    def __init__(self, galleries: Galleries, network: NetworkSettings) -> None:
        self.galleries, self.network = galleries, network
        self.run = galleries.run

    def __len__(self) -> int:
        return len(self.galleries)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample; the faults of its source's depth, its light and whether it is mirrored come from `rng`."""
        return finished(self.question(index, rng), self.network, rng)

    def question(self, index: int, rng: np.random.Generator) -> Question:
        """The view that the method would meet, before it is mirrored or relit."""
        gallery = self.galleries.gallery(index)
        if rng.random() < SENSOR_SHARE:
            return still(gallery.frame(gallery.pairs[index % len(gallery.pairs)][0]), rng)
        for number in range(len(gallery.pairs)):
            source, target = gallery.pairs[(index + number) % len(gallery.pairs)]
            rgbd = with_faults(gallery.frame(source), rng)
            view = render(rgbd, gallery.cameras[target], types=False)
            if fits(view.hole):
                return Question(view, gallery.frame(target), Law.of(Scene((View.from_rgbd(rgbd),))))
        return masked(gallery.frame(0), random_mask(rng, gallery.cameras[0].hw))


class RemovalSamples(WorldSamples):
    """Kind `removal`: the source view with a thing masked and gone."""

    def question(self, index: int, rng: np.random.Generator) -> Question:
        """As WorldSamples."""
        gallery = self.galleries.gallery(index)
        number = index % len(gallery.cameras)
        frame, thing = gallery.frame(number), removable(gallery, number, rng)
        if thing is None:
            return masked(frame, random_mask(rng, frame.camera.hw))
        grown = dilated(gallery.seen(number).group == thing, int(rng.integers(1, MOST_GROWN + 1)))
        truth = seen_through(gallery, number, thing, grown)
        return masked(with_faults(frame, rng), grown, truth)


class StereoSamples:
    """Kind `stereo`, planes stereo and stereo-two-masks: both pictures of a pair with one thing masked and gone."""

    def __init__(self, galleries: Galleries, network: NetworkSettings) -> None:
        self.galleries, self.network = galleries, network
        self.run = galleries.run

    def __len__(self) -> int:
        return len(self.galleries)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One pair; see `batches.Batch`."""
        return mirrored(relit(self.pair(index, rng), rng, 6), rng, 2)

    def pair(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """The pair before it is mirrored or relit."""
        gallery = self.galleries.rig(index)
        ends = gallery.pairs[index % len(gallery.pairs)]
        thing, radius = removable(gallery, ends[0], rng), int(rng.integers(1, MOST_GROWN + 1))
        shown, holes, true = [], [], []
        drawn = random_mask(rng, gallery.cameras[0].hw) if thing is None else None
        for number in ends:
            frame = gallery.frame(number)
            hole = drawn if drawn is not None else dilated(gallery.seen(number).group == thing, radius)
            shown.append(frame.color)
            true.append(seen_through(gallery, number, thing, hole).color if thing is not None else frame.color)
            holes.append(hole)
        return pair_sample(shown, true, holes, self.network)


def finished(question: Question, network: NetworkSettings, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A question as a sample, mirrored or not, in some light."""
    return mirrored(relit(view_sample(question, network), rng, 3), rng, 1)


def still(frame: RGBD, rng: np.random.Generator) -> Question:
    """A frame whose sensor left holes, at its own camera."""
    view = View.from_rgbd(with_faults(frame, rng, sensor_holes=True))
    return Question(view, frame, Law.of(Scene((view,))))


def masked(source: RGBD, taken: BoolArray, truth: RGBD | None = None) -> Question:
    """A frame without the pixels of `taken` (H x W bool), at its own camera; the truth is the frame itself by default.

    What was taken out still tells how near its background may be at most, if it was a thing (`truth` is given).
    """
    view = View.from_rgbd(source)
    left = view.without(taken, HoleType.OBJECT)
    objects = (view.without(~taken, HoleType.NONE),) if truth is not None else ()
    return Question(left, truth if truth is not None else source, Law.of(Scene((left,), objects)))


def removable(gallery: Gallery, number: int, rng: np.random.Generator) -> int | None:
    """The group of a thing that camera `number` sees whole (but for its foot) and not too large; None if there is none."""
    group = gallery.seen(number).group
    groups, counts = np.unique(group[group > 0], return_counts=True)
    low, high = (share * group.size for share in OBJECT_SHARE)
    cut_off = np.concatenate([group[0], group[:, 0], group[:, -1]])  # such as the walls of a room
    found = np.setdiff1d(groups[(counts >= low) & (counts <= high)], cut_off)
    if not len(found):
        return None
    preferred, chosen = gallery.world.object_index, int(found[rng.integers(len(found))])
    return preferred if preferred in found and rng.random() < 0.5 else chosen


def seen_through(gallery: Gallery, number: int, thing: int, where: BoolArray) -> RGBD:
    """The frame of camera `number` with the pixels of `where` as they would be without the thing; its shadow stays."""
    frame = gallery.frame(number)
    if not where.any():  # only the other picture of the pair shows it
        return frame
    rows, columns = np.flatnonzero(where.any(1)), np.flatnonzero(where.any(0))
    corner, size = (int(columns[0]), int(rows[0])), (int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1)
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    cast = through(gallery.world, frame.camera.cropped(*corner, *size), np.where(where[box], thing, -1))
    color, depth = frame.color.copy(), frame.depth.copy()
    np.copyto(color[box], cast.color, where=where[box][..., None])
    np.copyto(depth[box], cast.depth, where=where[box])
    return RGBD(color, depth, frame.camera)


def through(world: Any, camera: Camera, things: np.ndarray) -> Any:
    """What a camera sees if each of its pixels looks through one thing (H x W group numbers, -1: none)."""
    return world.raycast(camera, through=things.astype(np.int32))
