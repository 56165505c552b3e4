"""Short runs of one preset with one thing changed at a time -> a table of speed, waiting for data, TFLOP/s and memory.

    python benchmarks/training.py [--preset mini-rgbd] [--size 128] [--steps 30]

Every line is a run of its own on procedural worlds; the first half of its steps warms up and is not counted. TFLOP/s are
those of the convolutions of both networks, forward and backward, as `metrics.csv` has them; the matrix rate beside them is
what this machine's matrix product (4096 x 4096, torch) reaches in the same precision.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import Any

import torch

from dlama.training.loop import train
from dlama.training.presets import PRESETS
from dlama.training.settings import TrainSettings

CHANGES: dict[str, dict[str, Any]] = {
    "batch 4": {"batch": 4},
    "batch 8": {"batch": 8},
    "batch 16": {"batch": 16},
    "batch 8, bf16": {"batch": 8, "precision": "bf16"},
    "batch 8, channels last": {"batch": 8, "channels_last": True},
    "batch 8, bf16, channels last": {"batch": 8, "precision": "bf16", "channels_last": True},
}
COLUMNS = ("samples_per_second", "waiting", "tflop_per_second", "memory_gb")


def measured(settings: TrainSettings) -> list[float]:
    """The means of the columns over the second half of a run."""
    with tempfile.TemporaryDirectory() as folder:
        train(settings, Path(folder) / "run")
        rows = list(csv.DictReader((Path(folder) / "run" / "metrics.csv").open()))
    late = [row for row in rows if row["samples_per_second"] and int(row["step"]) > settings.loop.steps // 2]
    return [mean(float(row[column]) for row in late) for column in COLUMNS]


def matrix_rate(kind: torch.dtype, device: str) -> float:
    """TFLOP/s of a large matrix product."""
    a = torch.rand(4096, 4096, device=device).to(kind)
    best = float("inf")
    for _ in range(4):
        start = time.perf_counter()
        (a @ a)[0, 0].item()
        best = min(best, time.perf_counter() - start)
    return 2 * 4096**3 / best / 1e12


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
    device = "cuda" if torch.cuda.is_available() else "cpu"
    rates = {name: matrix_rate(kind, device) for name, kind in (("fp32", torch.float32), ("bf16", torch.bfloat16))}
    print(f"{args.preset} at {args.size} px; matrix product: " + ", ".join(f"{n} {r:.3g}" for n, r in rates.items()))
    print(f"{'':30} {'samples/s':>10} {'waiting':>8} {'TFLOP/s':>8} {'of rate':>8} {'GB':>6}")
    for name in args.only:
        rhythm = replace(base.loop, **{"precision": "fp32"} | CHANGES[name])
        speed, waiting, rate, memory = measured(replace(base, loop=rhythm))
        share = rate / rates[rhythm.precision]
        print(f"{name:30} {speed:10.1f} {waiting:8.1%} {rate:8.3f} {share:8.1%} {memory:6.2f}", flush=True)


if __name__ == "__main__":
    main()
