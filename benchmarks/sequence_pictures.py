"""Three pairs of pictures of what many frames give, each beside the truth: docs/images/sequence.jpg.

python benchmarks/sequence_pictures.py kitchen_sequence -o docs/images/sequence.jpg

Rows: a held-out frame, nearest-wins of four others, dlama of the same four; another one, TSDF + Telea, dlama; a generated world
without a thing, the thing removed from one frame, and from five with one mask.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.datasets.sequences.loading import open_frames
from dlama.evaluation.metrics.pictures import channel_gain, with_gain
from dlama.geometry.rgbd import RGBD, UInt8Array
from dlama.worlds.dataset import world
from held_out_frames import SequenceMethod, run_dlama, run_z_buffer, sources_of
from sequence import InItsOwnProcess, resized

WIDTH, HEIGHT = 480, 360
SOURCES = 4
YAWS = (0, -10, 10, -20, 20)


def held_out(frames: Sequence[RGBD], place: int, other: SequenceMethod) -> list[UInt8Array]:
    """A held-out frame, and what another method and dlama make of it, in its exposure."""
    truth = frames[place]
    sources = [frames[one] for one in sources_of(place, SOURCES, len(frames))]
    cells = [truth.color]
    for method in (other, run_dlama):
        made = method(sources, truth.camera)
        cells.append(with_gain(made.color, channel_gain(made.color, truth.color, ~made.hole)))
    return cells


def removed(seed: int) -> list[UInt8Array]:
    """A world without its thing, and that thing removed from one frame, and from several by one mask."""
    made = world(seed)
    cameras = [made.camera(yaw, WIDTH) for yaw in YAWS]
    frames = [made.frame(camera) for camera in cameras]
    mask = made.raycast(cameras[0]).group == made.object_index
    one = dlama.complete(frames[:1], cameras[:1], mask={0: mask}).view.color
    several = dlama.complete(frames, cameras[:1], mask={0: mask}).view.color
    rows = np.flatnonzero(mask.any(1))
    top = int(np.clip((rows[0] + rows[-1]) // 2 - HEIGHT // 2, 0, WIDTH - HEIGHT))
    truth = made.frame(cameras[0], object=False).color
    return [cell[top : top + HEIGHT] for cell in (truth, one, several)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--held", type=int, nargs=2, default=[30, 21])
    parser.add_argument("--seed", type=int, default=6)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    loaded = dlama.align_frames([each.load() for each in open_frames(options.dataset)])
    frames = [resized(each, WIDTH) for each in loaded]
    rows = [
        held_out(frames, options.held[0], run_z_buffer),
        held_out(frames, options.held[1], InItsOwnProcess()),
        removed(options.seed),
    ]
    sheet = np.vstack([np.hstack(cells) for cells in rows])
    cv2.imwrite(str(options.output), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
