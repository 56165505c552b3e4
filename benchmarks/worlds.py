"""Frames per second of the procedural worlds, by kind and edges: each frame with depth, mask-ready, on all cores.

    python benchmarks/worlds.py [--size 512] [--seeds 8]

A world is built and its first frame cast before the clock starts; then its camera goes through the orbit of the evaluation.
"""

from __future__ import annotations

import argparse
import time

from dlama.worlds.dataset import world

YAWS = (0, 10, -10, 20, -20, 30, -30, 60, -60)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--seeds", type=int, default=8)
    args = parser.parse_args()
    print(f"{'kind':8} {'edges':10} {'building, ms':>13} {'frames/s':>9} {'slowest world':>14}")
    for kind in ("street", "room"):
        for smooth in (True, False):
            building, rates = [], []
            for seed in range(args.seeds):
                start = time.perf_counter()
                made = world(seed, kind=kind, antialias=smooth)
                building.append(time.perf_counter() - start)
                cameras = [made.camera(yaw, args.size) for yaw in YAWS]
                made.frame(cameras[0])
                start = time.perf_counter()
                for camera in cameras:
                    made.frame(camera)
                rates.append(len(cameras) / (time.perf_counter() - start))
            mean = args.seeds / sum(1 / rate for rate in rates)
            print(
                f"{kind:8} {'smoothed' if smooth else 'hard':10} {1e3 * sorted(building)[len(building) // 2]:13.0f} "
                f"{mean:9.1f} {min(rates):14.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
