"""Depth of stereo pairs of procedural worlds, in pictures with noise, against the truth: with and without the search for sky.

    python benchmarks/stereo_depth.py 500 540

First and last number of a world. Of the left view, after filling: share of the sky that is far (worlds with 2 % of sky and more),
share of the picture that is far and no sky, and mean error of disparity in pixels; means, and the change with its 95 % interval.
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

import dlama
from dlama.geometry.projection import disparity_from_depth
from dlama.worlds.dataset import world
from rules import without
from sensors import add_photo_noise

NAMES = ("share of sky that is far", "share that is far and no sky", "error of disparity, px")
LEAST_SKY = 0.02


def measure(number: int) -> tuple[float, float, float]:
    """Of one world, see NAMES."""
    street, rng = world(number), np.random.default_rng(number)
    rig = street.rig(512)
    frames = [street.frame(camera) for camera in (rig.left, rig.right)]
    left, right = (add_photo_noise(one.color, rng) for one in frames)
    found, true = dlama.stereo(left, right, rig).views[0].depth, frames[0].depth
    far = np.isposinf(true)
    lens = {"fx": rig.left.fx, "baseline_m": rig.baseline_m}
    error = np.abs(disparity_from_depth(found, **lens) - disparity_from_depth(true, **lens)).mean()
    share = float(np.isposinf(found)[far].mean()) if far.mean() >= LEAST_SKY else np.nan
    return share, float((np.isposinf(found) & ~far).mean()), float(error)


def main(first: int, last: int) -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    rows: dict[str, list[tuple[float, float, float]]] = {"plain-infinity": [], "": []}
    for number in range(first, last):
        for rule, values in rows.items():
            with without(rule):
                values.append(measure(number))
    before, now = (np.array(values) for values in rows.values())
    for k, name in enumerate(NAMES):
        change = (now - before)[:, k]
        change = change[np.isfinite(change)]
        draws = np.random.default_rng(0).choice(change, (2000, len(change))).mean(1)
        low, high = np.quantile(draws, (0.025, 0.975))
        print(
            f"{name:30} {np.nanmean(before[:, k]):.4f} {np.nanmean(now[:, k]):.4f}  {low:+.4f} to {high:+.4f}, {len(change)}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
