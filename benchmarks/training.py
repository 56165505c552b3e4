"""Short runs of one preset with one thing changed at a time -> a table of speed, waiting for data and memory.

    python benchmarks/training.py [--preset mini-rgbd] [--size 128] [--steps 30] [--only "batch 8" ...]

Every line is a run of its own on procedural worlds; the first half of its steps warms up (and compiles) and is not counted.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from statistics import mean
from typing import Any

from dlama.training.loop.train import train
from dlama.training.presets import PRESETS
from dlama.training.settings import TrainSettings

CHANGES: dict[str, dict[str, Any]] = {
    "batch 4": {"batch": 4},
    "batch 8": {"batch": 8},
    "batch 16": {"batch": 16},
    "batch 8, bf16": {"batch": 8, "precision": "bf16"},
    "batch 8, compiled": {"batch": 8, "compiled": True},
    "batch 8, bf16, compiled": {"batch": 8, "precision": "bf16", "compiled": True},
}
COLUMNS = ("samples_per_second", "waiting", "memory_gb")


def measured(settings: TrainSettings) -> list[float]:
    """The means of the columns over the second half of a run."""
    with tempfile.TemporaryDirectory() as folder:
        train(settings, Path(folder) / "run")
        rows = list(csv.DictReader((Path(folder) / "run" / "metrics.csv").open()))
    late = [row for row in rows if row["samples_per_second"] and int(row["step"]) > settings.loop.steps // 2]
    return [mean(float(row[column]) for row in late) for column in COLUMNS]


def alone(settings: TrainSettings) -> list[float]:
    """The same in a process of its own: its peak of memory is that of this run."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(measured, settings).result()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", choices=list(PRESETS), default="mini-rgbd")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--only", nargs="+", choices=list(CHANGES), default=list(CHANGES))
    args = parser.parse_args()
    base = PRESETS[args.preset].settings
    quiet = args.steps + 1
    rhythm = replace(
        base.loop, steps=args.steps, log_every=5, validate_every=quiet, sheet_every=quiet, checkpoint_every=quiet
    )
    base = replace(base, loop=rhythm, data=replace(base.data, size=args.size, held_out=2))
    print(f"{args.preset} at {args.size} px\n{'':30} {'samples/s':>10} {'waiting':>8} {'GB':>6}")
    for name in args.only:
        rhythm = replace(base.loop, **{"precision": "fp32"} | CHANGES[name])
        speed, waiting, memory = alone(replace(base, loop=rhythm))
        print(f"{name:30} {speed:10.1f} {waiting:8.1%} {memory:6.2f}", flush=True)


if __name__ == "__main__":
    main()
