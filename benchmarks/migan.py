"""MI-GAN's generator against the published pipeline file, side by side in one run: seconds and memory of a 512 x 512 crop.

    python benchmarks/migan.py PIPELINE.onnx [--runs 5]

Each line runs in a process of its own; the ratio is against the pipeline as it ran before (no memory arena).
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import onnxruntime

from dlama.inpainters import model_file

LINES = (
    # what, memory arena, memory pattern
    ("pipeline", False, False),
    ("pipeline", True, True),
    ("generator", False, False),
    ("generator", True, False),
    ("generator", True, True),
)
THREADS = 2


def measured(pipeline: Path, line: int, runs: int) -> str:
    """Median seconds of a run and the peak memory of this process, in MB."""
    what, arena, pattern = LINES[line]
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (1, 3, 512, 512), np.uint8)
    keep = np.full((1, 1, 512, 512), 255, np.uint8)
    keep[..., 150:300, 100:400] = 0
    hole = (keep == 0).astype(np.float32)
    planes = np.concatenate([picture / np.float32(255) * (1 - hole), hole], 1)
    feed = {"image": picture, "mask": keep} if what == "pipeline" else {"planes": planes}
    path = pipeline if what == "pipeline" else model_file("migan")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = THREADS, 3
    options.enable_cpu_mem_arena, options.enable_mem_pattern = arena, pattern
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    session.run(None, feed)
    taken = []
    for _ in range(runs):
        started = time.perf_counter()
        session.run(None, feed)
        taken.append(time.perf_counter() - started)
    return f"{statistics.median(taken)} {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pipeline", type=Path)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--line", type=int, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.line is not None:
        print(measured(asked.pipeline, asked.line, asked.runs))
        return
    reference = 0.0
    print("network    arena  pattern  seconds   ratio   peak MB")
    for number, (what, arena, pattern) in enumerate(LINES):
        words = [sys.executable, __file__, str(asked.pipeline), "--runs", str(asked.runs), "--line", str(number)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        seconds, peak = map(float, done.stdout.split()[-2:])
        reference = reference or seconds
        print(
            f"{what:10} {arena!s:6} {pattern!s:8} {seconds:8.3f} {seconds / reference:7.2f} {peak:9.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
