"""big-lama's geometry with random weights -> what holes cost: full, one compact 5 % hole, scattered; colour with depth; 4K.

    python benchmarks/engine.py [--runs 3] [--threads 2] [--big]

Ratios of medians within one run. --big fills 3840x2160 with 10 % holes and prints the process's peak memory (minutes).
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

from dlama.inpainters.networks.contract import generator_contract
from dlama.inpainters.networks.engine import Engine
from dlama.nets.architecture import GeneratorSettings, generator_shapes
from dlama.nets.export.generator import onnx_bytes


def model_file(folder: Path) -> Path:
    """Random weights that keep the activations' size."""
    rng, state, settings = np.random.default_rng(0), {}, GeneratorSettings()
    for name, shape in generator_shapes(settings).items():
        spread = np.prod(shape[1:]) ** -0.5 if len(shape) == 4 else 0.1
        drawn = rng.uniform(0.5, 1.5, shape) if name.endswith("running_var") else rng.normal(0, spread, shape)
        state[name] = np.asarray(drawn, np.float32 if shape else np.int64)
    path = folder / "random.onnx"
    path.write_bytes(onnx_bytes(settings, state, generator_contract(settings).metadata()))
    return path


def holes(size: int) -> dict[str, np.ndarray]:
    """Name -> size x size bool."""
    full, compact = np.zeros((2, size, size), bool)
    full[8:-8:9, 8:-8:9] = True
    side = round(size * 0.05**0.5)
    compact[size // 3 : size // 3 + side, size // 3 : size // 3 + side] = True
    scattered = np.zeros((size, size), bool)
    for y, x in np.random.default_rng(1).integers(0, size - 20, (round(0.05 * size * size / 400), 2)):
        scattered[y : y + 20, x : x + 20] = True
    return {"full": full, "compact 5 %": compact, "scattered 5 %": scattered}


def seconds(call: Callable[[], object], runs: int) -> float:
    """Median of some runs after one to warm up."""
    call()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return median(times)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--big", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        network = Engine(model_file(Path(folder)), threads=arguments.threads)
        planes = np.random.default_rng(2).random((2, 3, arguments.size, arguments.size), np.float32)
        if arguments.big:
            big = np.zeros((2160, 3840), bool)
            big[300:1100, 500:1537] = True
            start = time.perf_counter()
            network.fill(np.full((1, 3, *big.shape), 0.5, np.float32), big)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
            print(f"3840x2160, {big.mean():.0%} hole: {time.perf_counter() - start:.0f} s, peak {peak:.2f} GB")
            return
        table = {
            name: seconds(lambda hole=hole: network.fill(planes[:1], hole), arguments.runs)
            for name, hole in holes(arguments.size).items()
        }
        full = holes(arguments.size)["full"]
        apart = seconds(lambda: [network.fill(planes[i : i + 1], full) for i in (0, 1)], arguments.runs)
        batch = seconds(lambda: network.fill(planes, full), arguments.runs)
        table |= {"colour + depth, one by one": apart, "colour + depth, batched": batch}
        for name, took in table.items():
            print(f"{name:28} {took:7.2f} s {took / table['full']:6.2f} x full", flush=True)


if __name__ == "__main__":
    main()
