"""Procedural worlds in -> samples with exact truth out: of another view (kind `world`), with an object removed (`removal`), with
an object removed from both pictures of a pair (`stereo`).

Source frames are rendered or masked by the same code as at run time. Any object of a world may be removed; half the time it is
the object of interest. The truth behind it is cast through that one object, so its shadow stays, as it does in the known pixels.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.codes import HoleType
from dlama.geometry.holes import box_around, dilate_mask, sides_of
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.training.data.augment import add_depth_faults, change_light, mirror_at_random
from dlama.training.data.masks import random_mask
from dlama.training.data.samples.views import ViewExample, hole_size_fits, pair_sample, view_sample
from dlama.training.data.samples.world_views import WorldSet, WorldViews
from dlama.training.settings import NetworkSettings

SENSOR_SHARE = 0.08
"""Probability of a sample whose holes are a frame's own missing depth."""
MOST_DILATION = 4
"""Pixels; object masks are dilated by 1 to so many, as before an object leaves the cloud."""
OBJECT_SHARE = (0.005, 0.25)
"""Least and largest share of the picture that a removed object covers."""


class _Worlds:
    """One sample of each view of some worlds."""

    def __init__(self, worlds: WorldSet, network: NetworkSettings) -> None:
        self.worlds, self.network = worlds, network
        self.group_size = worlds.group_size

    def __len__(self) -> int:
        return len(self.worlds)


class WorldSamples(_Worlds):
    """Kind `world`, see `sources.SampleSource`: the view of another camera, known where the source frame shows it."""

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample; sensor faults, light and mirroring are drawn from `rng`."""
        return augment_sample(self.example(index, rng), self.network, rng)

    def example(self, index: int, rng: np.random.Generator) -> ViewExample:
        """The view before it is mirrored or relit."""
        views = self.worlds.views(index)
        if rng.random() < SENSOR_SHARE:
            return sensor_hole_example(views.frame(views.pairs[index % len(views.pairs)][0]), rng)
        for number in range(len(views.pairs)):
            source, target = views.pairs[(index + number) % len(views.pairs)]
            rgbd = add_depth_faults(views.frame(source), rng)
            view = render(rgbd, views.cameras[target], types=False)
            if hole_size_fits(view.hole):
                return ViewExample(view, views.frame(target), Law.of(Scene((View.from_rgbd(rgbd),))))
        return mask_example(views.frame(0), random_mask(rng, views.cameras[0].hw))


class WorldRemovals(WorldSamples):
    """Kind `removal`: a frame with an object's mask as its hole."""

    def example(self, index: int, rng: np.random.Generator) -> ViewExample:
        """As WorldSamples."""
        views = self.worlds.views(index)
        number = index % len(views.cameras)
        frame, removed = views.frame(number), removable_object(views, number, rng)
        if removed is None:
            return mask_example(frame, random_mask(rng, frame.camera.hw))
        hole = dilate_mask(views.raycast(number).group == removed, int(rng.integers(1, MOST_DILATION + 1)))
        truth = frame_without(views, number, removed, hole)
        return mask_example(add_depth_faults(frame, rng), hole, truth)


class WorldPairs(_Worlds):
    """Kind `stereo`: both pictures of a pair with one object's masks as their holes."""

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One pair; see `batches.Batch`."""
        return mirror_at_random(change_light(self.pair(index, rng), rng, 6), rng, 2)

    def pair(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """The pair before it is mirrored or relit."""
        views = self.worlds.stereo_views(index)
        ends = views.pairs[index % len(views.pairs)]
        removed, radius = removable_object(views, ends[0], rng), int(rng.integers(1, MOST_DILATION + 1))
        shown, holes, true = [], [], []
        random = random_mask(rng, views.cameras[0].hw) if removed is None else None
        for number in ends:
            frame = views.frame(number)
            hole = random if random is not None else dilate_mask(views.raycast(number).group == removed, radius)
            shown.append(frame.color)
            true.append(frame_without(views, number, removed, hole).color if removed is not None else frame.color)
            holes.append(hole)
        return pair_sample(shown, true, holes, self.network)


def augment_sample(example: ViewExample, network: NetworkSettings, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The sample of an example, with random mirroring and light."""
    return mirror_at_random(change_light(view_sample(example, network), rng, 3), rng, 1)


def sensor_hole_example(frame: RGBD, rng: np.random.Generator) -> ViewExample:
    """A frame with missing depth, at its own camera."""
    view = View.from_rgbd(add_depth_faults(frame, rng, sensor_holes=True))
    return ViewExample(view, frame, Law.of(Scene((view,))))


def mask_example(source: RGBD, removed: BoolArray, truth: RGBD | None = None) -> ViewExample:
    """A frame without the pixels of `removed` (H x W bool), at its own camera.

    truth: the frame without the object; the depth of the removed object then still limits what is filled (visibility law).
    Default: no object is removed, the truth is the frame itself.
    """
    view = View.from_rgbd(source)
    rest = view.without(removed, HoleType.OBJECT)
    objects = (view.without(~removed, HoleType.NONE),) if truth is not None else ()
    return ViewExample(rest, truth if truth is not None else source, Law.of(Scene((rest,), objects)))


def removable_object(views: WorldViews, number: int, rng: np.random.Generator) -> int | None:
    """Number of an object of OBJECT_SHARE that the picture of camera `number` does not cut off (but at the bottom); None if there
    is none."""
    group = views.raycast(number).group
    groups, counts = np.unique(group[group > 0], return_counts=True)
    low, high = (share * group.size for share in OBJECT_SHARE)
    cut_off = np.concatenate([group[0], group[:, 0], group[:, -1]])  # walls of rooms among them
    found = np.setdiff1d(groups[(counts >= low) & (counts <= high)], cut_off)
    if not len(found):
        return None
    preferred, chosen = views.world.object_index, int(found[rng.integers(len(found))])
    return preferred if preferred in found and rng.random() < 0.5 else chosen


def frame_without(views: WorldViews, number: int, removed: int, where: BoolArray) -> RGBD:
    """The frame of camera `number` with the pixels of `where` (H x W) as they are without object `removed`; its shadow stays."""
    frame = views.frame(number)
    if not where.any():  # only the other picture of the pair shows it
        return frame
    rows, columns = box = box_around(where, 0)
    height, width = sides_of(box)
    part = frame.camera.cropped(columns.start, rows.start, width, height)
    cast = views.world.raycast(part, through=np.where(where[box], removed, -1).astype(np.int32))
    color, depth = frame.color.copy(), frame.depth.copy()
    np.copyto(color[box], cast.color, where=where[box][..., None])
    np.copyto(depth[box], cast.depth, where=where[box])
    return RGBD(color, depth, frame.camera)
