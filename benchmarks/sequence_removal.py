"""Removal from 1, 3 and 5 frames of worlds: error behind the thing, and how well filled points agree between frames.

python benchmarks/sequence_removal.py --seeds 3 4 5 --size 256
"""

from __future__ import annotations

import argparse

import numpy as np

import dlama
from dlama.worlds.dataset import world

YAWS = {1: (0,), 3: (0, -10, 10), 5: (0, -10, 10, -20, 20)}


def row(seed: int, size: int, count: int, masked: int) -> dict[str, float]:
    """The numbers of one world with so many frames; the mask is given in the first `masked` of them."""
    made = world(seed)
    cameras = [made.camera(yaw, size) for yaw in YAWS[count]]
    frames = [made.frame(camera) for camera in cameras]
    truth = made.frame(cameras[0], object=False)
    masks = [made.raycast(camera).group == made.object_index for camera in cameras]
    mask = masks[0]
    done = dlama.complete(frames, cameras, mask={number: masks[number] for number in range(masked)})
    view = done.views[0]
    near = mask & np.isfinite(truth.depth) & np.isfinite(view.depth)
    colors, depths = [], []
    for other in done.views[1:]:
        again = dlama.render(view, other.camera)
        both = (again.origin == dlama.Origin.FILLED) & other.filled & again.valid & other.valid
        apart = np.abs(again.depth[both] - other.depth[both]) / other.depth[both]
        same = apart < 0.05  # the others are hidden by something
        colors.append(np.abs(again.color.astype(int) - other.color)[both][same].ravel())
        depths.append(apart[same])
    color, depth = (np.concatenate(parts) if parts else np.zeros(0) for parts in (colors, depths))
    return {
        "filled": float(view.filled[mask].mean()),
        "color": float(np.abs(view.color.astype(float) - truth.color)[mask].mean()),
        "absrel": float((np.abs(view.depth[near] - truth.depth[near]) / truth.depth[near]).mean()),
        "color_agrees": float(np.median(color)) if len(color) else np.nan,
        "depth_agrees": float(np.median(depth)) if len(depth) else np.nan,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[3, 4, 5])
    parser.add_argument("--size", type=int, default=256)
    options = parser.parse_args()
    head = (
        "frames",
        "masks",
        "filled in the mask",
        "colour error, levels",
        "depth AbsRel",
        "colours agree, levels",
        "depths agree",
    )
    print(f"| {' | '.join(head)} |\n{'|---' * len(head)}|")
    for count, masked in ((1, 1), (3, 1), (3, 3), (5, 1), (5, 5)):
        rows = [row(seed, options.size, count, masked) for seed in options.seeds]
        mean = {name: float(np.mean([one[name] for one in rows])) for name in rows[0]}
        agree = f"{mean['color_agrees']:.1f} | {mean['depth_agrees']:.3%}" if count > 1 else "- | -"
        errors = f"{mean['color']:.1f} | {mean['absrel']:.4f}"
        print(f"| {count} | {masked} | {mean['filled']:.0%} | {errors} | {agree} |", flush=True)


if __name__ == "__main__":
    main()
