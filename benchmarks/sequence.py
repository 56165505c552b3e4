"""Posed frames of one scene in; how well held-out frames come out, by number of source frames, next to nearest-wins, out.

    python benchmarks/sequence.py DATASET --held 5 11 17 --counts 1 4 --width 320
    python benchmarks/sequence.py worlds:3 --held 3 --counts 1 2 4        # generated, poses are exact

A held-out frame is the truth; its sources are the frames nearest to it in the sequence, on both sides in turn, its direct
neighbours left out in long ones. Its pixels are sorted by how many of the sources see them, from the true depths: one, several or
none. Colours are compared after one gain a channel, fitted for each method where a source sees: the frames differ in exposure.
Poses are aligned first, that of the truth too and for all methods alike: where it is off by some pixels, SSIM rewards blur.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dlama.completion.pipeline import complete
from dlama.datasets.frames import Frame
from dlama.datasets.sequences.loading import open_frames
from dlama.evaluation.metrics.pictures import channel_gain
from dlama.evaluation.metrics.regions import Regions, source_visibility
from dlama.evaluation.protocols.methods import Measure, ProtocolSettings
from dlama.evaluation.protocols.scores import Reference
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import concatenate
from dlama.geometry.frames.alignment import align_frames
from dlama.geometry.projection import lift
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.training.data.crops import resize_frame
from dlama.worlds.dataset import open_dataset_or_worlds

APART, DENSE = 2, 30
"""Places between a held-out frame and its nearest sources, in sequences of so many frames; of fewer neighbours are sources."""
SHOWN = ("ssim", "lpips", "mse", "mae")
REGIONS = ("whole", "seen by one", "seen by several", "seen by none")
SETTINGS = ProtocolSettings()


@dataclass(frozen=True, eq=False)
class SynthesisedView:
    """What a method makes of the sources at a camera."""

    color: UInt8Array
    depth: Float32Array
    hole: BoolArray
    """H x W, True = it was unknown before filling."""


@dataclass(frozen=True)
class Row:
    """One number."""

    frames: int
    method: str
    measure: Measure


def run_dlama(sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
    """dlama, as it stands."""
    done = complete(list(sources), [camera])
    return SynthesisedView(done.view.color, done.view.depth, done.warped[0].color_hole)


def run_z_buffer(sources: Sequence[RGBD], camera: Camera) -> SynthesisedView:
    """All points of all frames, the nearest one to the camera in each pixel, and Telea's filling of colour and of 8-bit depth."""
    view = render(concatenate([lift(each) for each in sources]), camera, "points")
    mask, known = view.hole.astype(np.uint8), ~view.hole & np.isfinite(view.depth)
    filled = np.asarray(cv2.inpaint(np.ascontiguousarray(view.color), mask, 3, cv2.INPAINT_TELEA), np.uint8)
    top = float(view.depth[known].max()) if known.any() else 1.0
    levels = np.clip(np.where(known, view.depth, 0) / top * 255, 0, 255).astype(np.uint8)
    guessed = np.asarray(cv2.inpaint(levels, mask, 3, cv2.INPAINT_TELEA), np.float32) / 255 * top
    return SynthesisedView(filled, np.where(view.hole, guessed, view.depth).astype(np.float32), view.hole)


METHODS: dict[str, Callable[[Sequence[RGBD], Camera], SynthesisedView]] = {
    "dlama": run_dlama,
    "nearest wins": run_z_buffer,
}


def scenes_of(dataset: str) -> Iterator[list[Frame]]:
    """The frames of each scene of a folder or of generated worlds, along the orbit where there is one."""
    if Path(dataset).is_dir():
        yield list(open_frames(dataset))
        return
    frames = open_dataset_or_worlds(dataset).frames
    for name in dict.fromkeys(one.scene for one in frames):
        own = {one.yaw: one for one in frames if one.scene == name}
        yield sorted(own.values(), key=lambda one: one.yaw or 0)


def score_sequence(frames: Sequence[RGBD], held_out: Sequence[int], counts: Sequence[int]) -> Iterator[Row]:
    """The numbers of every held-out frame (places), with every number of sources, by every method."""
    apart = APART if len(frames) >= DENSE else 1
    for place in held_out:
        truth = frames[place]
        around = [place + side * step for step in range(apart, len(frames)) for side in (1, -1)]
        near = [frames[one] for one in around if 0 <= one < len(frames)]
        for count in counts:
            if len(near) < count:
                continue
            regions = visibility_by_count(near[:count], truth)
            for method, make in METHODS.items():
                started = time.process_time()
                made = make(near[:count], truth.camera)
                yield Row(count, method, Measure("whole", "time", "seconds", time.process_time() - started))
                yield from (Row(count, method, measure) for measure in measures_of(made, truth, regions))


def visibility_by_count(sources: Sequence[RGBD], truth: RGBD) -> Regions:
    """H x W of the truth each: pixels that one, several or none of the sources see, and `seen` by any; of known depth only."""
    seen = [source_visibility(source, truth) for source in sources]
    count = sum(each.seen.astype(np.int64) for each in seen)
    known = np.any([each.seen | each.unseen for each in seen], axis=0)
    return {
        "seen by one": count == 1,
        "seen by several": count > 1,
        "seen by none": known & (count == 0),
        "seen": np.asarray(count > 0),
    }


def measures_of(made: SynthesisedView, truth: RGBD, regions: Regions) -> list[Measure]:
    """The numbers of one view."""
    usable = regions["seen"] & ~made.hole
    gain = channel_gain(made.color, truth.color, usable) if usable.any() else (1.0, 1.0, 1.0)
    reference = Reference(truth.color, truth.depth, regions, SETTINGS, gain=gain)
    found = [Measure("whole", "rgb", "hole_share", 100 * float(made.hole.mean()))]
    return [*found, *reference.color_measures(made.color), *reference.metre_measures(made.depth)]


def table(rows: Sequence[Row], region: str) -> str:
    """Means over the held-out frames as a Markdown table: a line for each number of sources and method."""

    def mean(own: Sequence[Row], region: str, metric: str, digits: int) -> str:
        found = [row.measure for row in own if row.measure.region == region and row.measure.metric == metric]
        values = [one.value for one in found if one.modality != "depth"]
        return f"{np.mean(values):.{digits}f}" if values else "-"

    head = ("frames", "method", "hole %", "SSIM", "LPIPS", "MSE", "depth MAE (m)", "s (processor)")
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for count, method in dict.fromkeys((row.frames, row.method) for row in sorted(rows, key=lambda row: row.frames)):
        own = [row for row in rows if (row.frames, row.method) == (count, method)]
        scores = [mean(own, region, name, 0 if name == "mse" else 4) for name in SHOWN]
        cells = [mean(own, "whole", "hole_share", 1), *scores, mean(own, "whole", "seconds", 1)]
        lines.append(f"| {count} | {method} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="a folder, or worlds:N")
    parser.add_argument("--held", type=int, nargs="+", default=[6, 15, 24, 33, 42])
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--width", type=int)
    parser.add_argument("--given-poses", action="store_true", help="leave the data set's poses as they are")
    options = parser.parse_args()
    rows: list[Row] = []
    for listed in scenes_of(options.dataset):
        loaded = [each.load() for each in listed]
        frames = loaded if options.given_poses else align_frames(loaded)
        if options.width:
            frames = [resize_frame(each, options.width / each.camera.width) for each in frames]
        rows += score_sequence(frames, options.held, options.counts)
    for region in REGIONS:
        print(f"**{region}**\n\n{table(rows, region)}\n")


if __name__ == "__main__":
    main()
