"""Dataset cases in -> samples out: views of posed pairs (kind `frame`), removals (`removal`), stereo pairs (`stereo`).

A removal's hole is the object's mask, dilated as before an object leaves the cloud, within the region where both frames show one
background. Known pixels are those of the frame with the object, so a shadow that it casts outside the mask stays; in the hole
the truth is the frame without it. Depth is used as it is: a real sensor's faults are in it. Frames of different exposure are
brought to one by a gain per channel, found where both show the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dlama.datasets.frames import Case, RemovalTruth, StereoTruth, ViewTruth
from dlama.errors import MaskError
from dlama.evaluation.metrics.pictures import channel_gain
from dlama.geometry.holes import dilate_mask, erode_mask
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array, brighten
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.perception.stereo.agreement import transfer_mask
from dlama.training.data.crops import Crop, random_crop, resize_frame
from dlama.training.data.masks import random_mask
from dlama.training.data.samples.views import DEPTH_AGREES, PairExample, ViewExample, hole_size_fits
from dlama.training.data.samples.worlds import MOST_DILATION, dilate_equally, mask_example

MOST_DRAWS = 4
"""Crops of a frame that are tried; where the mask has no fitting size in any of them, a random mask is taken."""


Cases = Sequence[Case]


def case_view(cases: Cases, size: int, index: int, rng: np.random.Generator) -> ViewExample:
    """Kind `frame`: a random crop of the target frame, known where the source frame of a posed pair shows it; either direction of
    the pair."""
    pair = cases[index].load()
    assert isinstance(pair, ViewTruth)
    source, target = (pair.source, pair.target) if rng.random() < 0.5 else (pair.target, pair.source)
    target = random_crop(target.camera.hw, size, rng).rgbd(target)
    source = resize_frame(source, target.camera.fx / source.camera.fx)
    view = render(source, target.camera, types=False)
    if hole_size_fits(view.hole):
        truth = match_exposure(view, target) if pair.exposure_varies else target
        return ViewExample(view, truth, Law.of(Scene((View.from_rgbd(source),))))
    return mask_example(target, random_mask(rng, target.camera.hw))


def case_removal(cases: Cases, size: int, index: int, rng: np.random.Generator) -> ViewExample:
    """Kind `removal`: a random crop that shows the object. There is no hole where the two frames show different backgrounds."""
    case = cases[index].load()
    assert isinstance(case, RemovalTruth)
    for _ in range(MOST_DRAWS):
        crop = random_crop(case.source.camera.hw, size, rng, case.mask)
        (hole,) = dilate_equally([crop.mask(case.mask)], rng)
        if case.compare is not None:
            hole &= ~crop.mask(~case.compare)
        if hole_size_fits(hole):
            source, without = crop.rgbd(case.source), crop.rgbd(match_source_exposure(case))
            color = np.where(hole[..., None], without.color, source.color)
            return mask_example(source, hole, RGBD(color, np.where(hole, without.depth, source.depth), source.camera))
    source = crop.rgbd(case.source)
    return mask_example(source, random_mask(rng, source.camera.hw))


def case_pair(cases: Cases, size: int, index: int, rng: np.random.Generator) -> PairExample:
    """Kind `stereo`: the same random crop of both pictures, with the object's masks as holes; where there is no object, with a
    random mask on the same surface in both."""
    case = cases[index].load()
    assert isinstance(case, StereoTruth)
    hw, pair = (case.left.shape[0], case.left.shape[1]), (case.left, case.right)
    if case.mask_left is not None and case.mask_right is not None and case.without_left and case.without_right:
        for _ in range(MOST_DRAWS):
            crop = random_crop(hw, size, rng, case.mask_left | case.mask_right)
            holes = dilate_equally([crop.mask(mask) for mask in (case.mask_left, case.mask_right)], rng)
            if hole_size_fits(holes[0] | holes[1]):
                shown = _crop_both(crop, pair)
                without = _crop_both(crop, (case.without_left.color, case.without_right.color))
                true = [np.where(hole[..., None], gone, one) for hole, gone, one in zip(holes, without, shown)]
                return PairExample(shown, true, holes)
    crop = random_crop(hw, size, rng)
    shown = _crop_both(crop, pair)
    return PairExample(shown, shown, random_masks(crop, case, rng))


def random_masks(crop: Crop, case: StereoTruth, rng: np.random.Generator) -> list[BoolArray]:
    """A random mask of the left picture's crop, and the same surface in the right one's by the pair's disparity."""
    mask = random_mask(rng, (crop.size, crop.size))
    try:
        return [mask, transfer_mask(mask, crop.disparity(case.disparity_left))]
    except MaskError:  # no disparity is known anywhere in it
        return [mask, mask]


def match_source_exposure(case: RemovalTruth) -> RGBD:
    """The frame without the object, at the exposure of the frame with it, by the pixels that both show."""
    if not case.exposure_varies:
        return case.without
    both = ~dilate_mask(case.mask, MOST_DILATION)
    if case.compare is not None:
        both &= case.compare
    gain = channel_gain(case.without.color, case.source.color, both)
    return replace(case.without, color=brighten(case.without.color, gain))


def match_exposure(view: View, truth: RGBD) -> RGBD:
    """The truth at the exposure of the view, by the pixels where both have the same depth, off the edge of the hole."""
    w, true = inverse_depth(view.depth), inverse_depth(truth.depth)
    same = erode_mask(~view.hole, 1) & (true > 0) & (np.abs(w - true) <= DEPTH_AGREES * true)
    gain = channel_gain(truth.color, view.color, same)
    return RGBD(brighten(truth.color, gain), truth.depth, truth.camera)


def _crop_both(crop: Crop, pictures: tuple[UInt8Array, UInt8Array]) -> list[UInt8Array]:
    return [crop.color(picture) for picture in pictures]
