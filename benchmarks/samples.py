"""Settings of each kind of sample in -> samples per second and core out: what a training's workers make.

    python benchmarks/samples.py [--size 256] [--count 32] [--photos FOLDER] [--frames FOLDER] [--cases FOLDER]

`in runs`: indices in order, as a training that shuffles whole runs of them asks; `shuffled`: every sample of another world.
`warped-photo` is slow until a process has made its bank of shapes: its first column is of a new process, its second of one
that has begun. Seconds are those of the process, one thread: other work on the machine hardly counts.
"""

from __future__ import annotations

import os

os.environ["NUMBA_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # before numba is imported

import argparse
import time
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from dlama.training.data.sources import SampleSource, source_for
from dlama.training.settings import DataSettings, NetworkSettings, TrainSettings

KINDS = {
    "sketch": ("rgbd", ""),
    "photo": ("rgb", "photos"),
    "warped-photo": ("rgb", "photos"),
    "world": ("rgbd", ""),
    "world, photos on it": ("rgbd", "photos"),
    "removal": ("rgbd", ""),
    "stereo": ("stereo", ""),
    "frame": ("rgbd", "frames"),
    "removal, of cases": ("rgbd", "cases"),
    "stereo, of cases": ("stereo", "cases"),
}
JUMP = 1009
"""From one index to the next where they are shuffled."""


def per_second(source: SampleSource, indices: Iterable[int]) -> float:
    """Samples per second of processor time; one sample is made before the clock starts."""
    chosen = [index % len(source) for index in indices]
    source.sample(chosen[-1], np.random.default_rng(0))
    started = time.process_time()
    for number, index in enumerate(chosen):
        source.sample(index, np.random.default_rng([1, number]))
    return len(chosen) / (time.process_time() - started)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--count", type=int, default=32)
    parser.add_argument("--photos", type=Path)
    parser.add_argument("--frames", type=Path)
    parser.add_argument(
        "--cases", type=Path, help="a data set with and without things, and with stereo pairs, or a pack of it"
    )
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'kind':<22}{'planes':<10}{'in runs':>10}{'shuffled':>10}   samples/s per core, {chosen.size} px")
    for kind, (planes, needs) in KINDS.items():
        folder = getattr(chosen, needs, None) if needs else None
        if needs and folder is None:
            print(f"{kind:<22}{planes:<10}   needs --{needs}")
            continue
        data = DataSettings(size=chosen.size, mixture={kind.split(",")[0]: 1.0}, cases=1.0)
        settings = TrainSettings("benchmark", network=NetworkSettings(planes), data=data)  # type: ignore[arg-type]
        source = source_for(settings, [folder] if folder else [], "train")
        ordered = per_second(source, range(JUMP, JUMP + chosen.count))
        shuffled = per_second(source, range(5000 * JUMP, (5000 + chosen.count) * JUMP, JUMP))
        print(f"{kind:<22}{planes:<10}{ordered:>10.1f}{shuffled:>10.1f}")


if __name__ == "__main__":
    main()
