"""Posed frames of one scene in; how well views of held-out frames come out, by number of source frames, out.

A held-out frame is the truth; its sources are the frames nearest to it in the sequence, on both sides in turn, its direct
neighbours left out. Its pixels are sorted by how many of the sources see them, from the true depths: one, several or none.
Colours are compared after one gain a channel, fitted for each method where a source sees: the frames differ in exposure.
Poses are aligned first, that of the truth too and for all methods alike (`sequence.py`): where it is off by some pixels, SSIM
rewards blur. Used by sequence.py and sequence_pictures.py.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.completion.pipeline import complete
from dlama.datasets.frames import Frame
from dlama.evaluation.metrics.pictures import channel_gain
from dlama.evaluation.metrics.regions import source_visibility
from dlama.evaluation.protocols.methods import Measure, ProtocolSettings
from dlama.evaluation.protocols.scores import Reference
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import concatenate
from dlama.geometry.projection import lift
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array

COUNTS = (1, 2, 4, 8)
"""Source frames."""
APART = 2
"""Places in the sequence between a held-out frame and its nearest sources."""
DENSE = 30
"""From so many frames on, a held-out frame's sources are APART places away and more; of fewer its neighbours are sources."""
SHOWN = ("ssim", "lpips", "mse", "mae")


@dataclass(frozen=True, eq=False)
class SynthesisedView:
    """What a method makes of the sources at a camera."""

    color: UInt8Array
    """H x W x 3."""
    depth: Float32Array
    """H x W metres."""
    hole: BoolArray
    """H x W, True = it was unknown before filling."""
    seconds: float | None = None
    """Of processor time, where another process made it."""


SequenceMethod = Callable[[Sequence[RGBD], Camera], SynthesisedView]


@dataclass(frozen=True)
class Row:
    """One number."""

    held_out: str
    frames: int
    method: str
    measure: Measure


def run_dlama(sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
    """dlama, as it stands."""
    done = complete(list(sources), [camera])
    return SynthesisedView(done.view.color, done.view.depth, done.warped[0].color_hole)


def run_z_buffer(sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
    """All points of all frames, the nearest one to the camera in each pixel, and Telea's filling of colour and depth."""
    view = render(concatenate([lift(each) for each in sources]), camera, "points")
    return fill_with_telea(view.color, view.depth, view.hole)


def fill_with_telea(color: UInt8Array, depth: Float32Array, hole: BoolArray) -> SynthesisedView:
    """Holes filled by Telea's inpainting: colours, and depth as a picture of 16-bit millimetres cut into 8 bits of its range."""
    mask = hole.astype(np.uint8)
    filled = np.asarray(cv2.inpaint(np.ascontiguousarray(color), mask, 3, cv2.INPAINT_TELEA), np.uint8)
    known = ~hole & np.isfinite(depth)
    top = float(depth[known].max()) if known.any() else 1.0
    levels = np.clip(np.where(known, depth, 0) / top * 255, 0, 255).astype(np.uint8)
    guessed = np.asarray(cv2.inpaint(levels, mask, 3, cv2.INPAINT_TELEA), np.float32) / 255 * top
    return SynthesisedView(filled, np.where(hole, guessed, depth).astype(np.float32), hole)


METHODS: Mapping[str, SequenceMethod] = {"dlama": run_dlama, "nearest wins": run_z_buffer}


def sources_of(place: int, count: int, frames: int, apart: int = APART) -> list[int]:
    """Places of the frames that a held-out one is made of: the nearest on both sides in turn, `apart` places away and more."""
    around = [place + side * step for step in range(apart, frames) for side in (1, -1)]
    return [one for one in around if 0 <= one < frames][:count]


def score_sequence(
    frames: Sequence[RGBD],
    held_out: Sequence[int],
    names: Sequence[str],
    settings: ProtocolSettings,
    methods: Mapping[str, SequenceMethod] = METHODS,
    counts: Sequence[int] = COUNTS,
    apart: int = APART,
) -> Iterator[Row]:
    """The numbers of every held-out frame (places), with every number of sources, by every method. Raises what they raise."""
    for place in held_out:
        truth = frames[place]
        for count in counts:
            sources = [frames[one] for one in sources_of(place, count, len(frames), apart)]
            if len(sources) < count:
                continue
            regions = visibility_by_count(sources, truth, settings.seen_tolerance)
            for method, make in methods.items():
                started = time.process_time()
                made = make(sources, truth.camera)
                seconds = time.process_time() - started if made.seconds is None else made.seconds
                for measure in measures_of(made, truth, regions, settings):
                    yield Row(names[place], count, method, measure)
                yield Row(names[place], count, method, Measure("whole", "time", "seconds", seconds))


def sort_along_orbit(frames: Sequence[Frame]) -> list[Frame]:
    """The frames of a scene along its orbit, where it has one, else as listed."""
    if all(frame.yaw is not None for frame in frames):
        return sorted({frame.yaw: frame for frame in frames}.values(), key=lambda frame: frame.yaw or 0)
    return list(frames)


def source_distance(frames: Sequence[Frame]) -> int:
    """Places between a held-out frame and its nearest sources."""
    return APART if len(frames) >= DENSE else 1


def visibility_by_count(sources: Sequence[RGBD], truth: RGBD, tolerance: float) -> dict[str, BoolArray]:
    """H x W of the truth each: pixels that one, several or none of the sources see, and `seen` by any; of known depth only."""
    seen = [source_visibility(source, truth, None, tolerance) for source in sources]
    count = sum(each.seen.astype(np.int64) for each in seen)
    known = np.any([each.seen | each.unseen for each in seen], axis=0)
    none = known & (count == 0)
    return {
        "seen by one": count == 1,
        "seen by several": count > 1,
        "seen by none": none,
        "seen": np.asarray(count > 0),
    }


def measures_of(
    made: SynthesisedView, truth: RGBD, regions: Mapping[str, BoolArray], settings: ProtocolSettings
) -> list[Measure]:
    """The numbers of one view."""
    usable = regions["seen"] & ~made.hole
    gain = channel_gain(made.color, truth.color, usable) if usable.any() else (1.0, 1.0, 1.0)
    reference = Reference(truth.color, truth.depth, regions, settings, gain=gain)
    found = [Measure("whole", "rgb", "hole_share", 100 * float(made.hole.mean()))]
    return [*found, *reference.color_measures(made.color), *reference.metre_measures(made.depth)]


def table(rows: Sequence[Row], region: str) -> str:
    """Means over the held-out frames as a Markdown table: a line for each number of sources and method."""
    head = ("frames", "method", "hole %", "SSIM", "LPIPS", "MSE", "depth MAE (m)", "s (processor)")
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    rows = [row for row in rows if row.measure.region in ("whole", region)]
    for count in sorted({row.frames for row in rows}):
        for method in dict.fromkeys(row.method for row in rows):
            own = [row for row in rows if row.frames == count and row.method == method]
            scores = [_mean(own, region, name, 0 if name == "mse" else 4) for name in SHOWN]
            cells = [_mean(own, "whole", "hole_share", 1), *scores, _mean(own, "whole", "seconds", 1)]
            lines.append(f"| {count} | {method} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _mean(rows: Sequence[Row], region: str, metric: str, digits: int) -> str:
    values = [
        row.measure.value
        for row in rows
        if row.measure.region == region and row.measure.metric == metric and row.measure.modality != "depth"
    ]
    return f"{np.mean(values):.{digits}f}" if values else "-"
