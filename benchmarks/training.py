"""Short runs of one preset with one thing changed at a time -> a table of speed, waiting for data, TFLOP/s and memory.

    python benchmarks/training.py [--preset mini-rgbd] [--size 128] [--steps 30] [--only "batch 8" ...]

Every line is a run of its own on procedural worlds; the first half of its steps warms up (and compiles) and is not counted.
TFLOP/s are those of the convolutions of both networks, forward and backward, as `metrics.csv` has them; the matrix rate
beside them is what this machine's matrix product (4096 x 4096, torch) reaches in the same precision.

The Fourier units stay float32 inside bf16. Two lines say what that costs: `1x1 in bf16` leaves float32 to their transforms
alone; `no Fourier` takes the units out (no network of ours, but nothing can gain more than that). What torch says to a
transform in bf16, and how far a unit is off with its convolution in bf16, stands below the table.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from statistics import mean
from typing import Any

import torch
from torch import Tensor

from dlama.nets.ffc import FourierUnit
from dlama.training.loop.train import train
from dlama.training.presets import PRESETS
from dlama.training.settings import TrainSettings

CHANGES: dict[str, dict[str, Any]] = {
    "batch 4": {"batch": 4},
    "batch 8": {"batch": 8},
    "batch 16": {"batch": 16},
    "batch 8, bf16": {"batch": 8, "precision": "bf16"},
    "batch 8, channels last": {"batch": 8, "channels_last": True},
    "batch 8, bf16, channels last": {"batch": 8, "precision": "bf16", "channels_last": True},
    "batch 8, compiled": {"batch": 8, "compiled": True},
    "batch 8, bf16, compiled": {"batch": 8, "precision": "bf16", "compiled": True},
    "batch 8, bf16, 1x1 in bf16": {"batch": 8, "precision": "bf16"},
    "batch 8, bf16, no Fourier": {"batch": 8, "precision": "bf16"},
}
COLUMNS = ("samples_per_second", "waiting", "tflop_per_second", "memory_gb")


def narrow(unit: FourierUnit, x: Tensor) -> Tensor:
    """As FourierUnit.forward, but the convolution of the spectrum in bfloat16: only the transforms are float32."""
    batch, channels, height, width = x.shape
    with torch.autocast(x.device.type, enabled=False):
        spectrum = torch.view_as_real(torch.fft.rfft2(x.float(), norm="ortho"))
    planes = spectrum.permute(0, 1, 4, 2, 3).reshape(batch, 2 * channels, height, width // 2 + 1)
    with torch.autocast(x.device.type, torch.bfloat16):
        planes = unit.relu(unit.bn(unit.conv_layer(planes))).float()
    with torch.autocast(x.device.type, enabled=False):
        pairs = planes.reshape(batch, channels, 2, height, width // 2 + 1).permute(0, 1, 3, 4, 2).contiguous()
        return torch.fft.irfft2(torch.view_as_complex(pairs), s=(height, width), norm="ortho").to(x.dtype)


def nothing(unit: FourierUnit, x: Tensor) -> Tensor:
    """What is left of a block without its Fourier unit: the skip beside it."""
    return torch.zeros_like(x)


UNITS: dict[str, Callable[[FourierUnit, Tensor], Tensor]] = {"1x1 in bf16": narrow, "no Fourier": nothing}


@contextmanager
def fourier_units(forward: Callable[[FourierUnit, Tensor], Tensor] | None) -> Iterator[None]:
    """With another forward pass of all Fourier units; None: their own."""
    own = FourierUnit.forward
    FourierUnit.forward = forward or own  # type: ignore[method-assign, assignment]
    try:
        yield
    finally:
        FourierUnit.forward = own  # type: ignore[method-assign]


def measured(settings: TrainSettings, unit: str) -> list[float]:
    """The means of the columns over the second half of a run with Fourier units of that name (none known: their own)."""
    with tempfile.TemporaryDirectory() as folder, fourier_units(UNITS.get(unit)):
        train(settings, Path(folder) / "run")
        rows = list(csv.DictReader((Path(folder) / "run" / "metrics.csv").open()))
    late = [row for row in rows if row["samples_per_second"] and int(row["step"]) > settings.loop.steps // 2]
    return [mean(float(row[column]) for row in late) for column in COLUMNS]


def alone(settings: TrainSettings, unit: str) -> list[float]:
    """The same in a process of its own: its peak of memory is that of this run."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(measured, settings, unit).result()


def matrix_rate(kind: torch.dtype, device: str) -> float:
    """TFLOP/s of a large matrix product."""
    a = torch.rand(4096, 4096, device=device).to(kind)
    best = float("inf")
    for _ in range(4):
        start = time.perf_counter()
        (a @ a)[0, 0].item()
        best = min(best, time.perf_counter() - start)
    return 2 * 4096**3 / best / 1e12


def spectrum_notes(device: str) -> list[str]:
    """Whether torch transforms bfloat16, and a unit's relative error with its convolution in bfloat16."""
    x = torch.randn(4, 48, 32, 32, device=device)
    try:
        torch.fft.rfft2(x.to(torch.bfloat16))
        said = "is done"
    except RuntimeError as error:
        said = f"is refused: {str(error).splitlines()[0]}"
    unit = FourierUnit(48).to(device).eval()
    with torch.no_grad():
        wanted, found = unit(x), narrow(unit, x)
    off = float((found - wanted).norm() / wanted.norm())
    return [
        f"a transform in bfloat16 {said}",
        f"a Fourier unit with its convolution in bfloat16 is off by {off:.2%} (norm)",
    ]


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
        speed, waiting, rate, memory = alone(replace(base, loop=rhythm), name.rpartition(", ")[2])
        share = rate / rates[rhythm.precision]
        print(f"{name:30} {speed:10.1f} {waiting:8.1%} {rate:8.3f} {share:8.1%} {memory:6.2f}", flush=True)
    print(*spectrum_notes(device), sep="\n")


if __name__ == "__main__":
    main()
