"""Stereo pairs of procedural worlds, in pictures with noise, against the truth: with and without a rule.

    python benchmarks/stereo_depth.py 500 540 [--rule refined-disparity]

First and last number of a world. Of the left view, after filling: share of the sky that is far (worlds with 2 % of sky and more),
share of the picture that is far and no sky, mean error of disparity in pixels, which the right view has, too; of the view from 10
degrees aside LPIPS and squared error; of the left view without its object, in the mask: LPIPS, squared error and error of
disparity. Means without and with the rule, and the change with its 95 % interval.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import dlama
from bench import lpips_map
from dlama.evaluation.metrics.pictures import mse_map
from dlama.geometry.projection import disparity_from_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.worlds.dataset import world
from rules import RULES, without
from sensors import add_photo_noise

NAMES = (
    "share of sky that is far",
    "share that is far and no sky",
    "error of disparity, px",
    "error of disparity, right picture, px",
    "10 degrees aside, LPIPS",
    "10 degrees aside, squared error",
    "removed object, LPIPS",
    "removed object, squared error",
    "removed object, error of disparity, px",
)
LEAST_SKY, LEAST_OBJECT = 0.02, 300
"""Share of a picture; pixels."""
YAW_DEG = 10


def measure(number: int) -> tuple[float, ...]:
    """Of one world, see NAMES; NaN where there is no sky, or no object."""
    street, rng = world(number), np.random.default_rng(number)
    rig = street.rig(512)
    frames = [street.frame(camera) for camera in (rig.left, rig.right)]
    left, right = (add_photo_noise(one.color, rng) for one in frames)

    def disparity_errors(found: Float32Array, true: Float32Array) -> Float32Array:
        return np.abs(disparity_from_depth(found, rig) - disparity_from_depth(true, rig))

    pair = dlama.stereo(left, right, rig)
    found, true = pair.views[0].depth, frames[0].depth
    of_right = float(disparity_errors(pair.views[1].depth, frames[1].depth).mean())
    far = np.isposinf(true)
    share = float(np.isposinf(found)[far].mean()) if far.mean() >= LEAST_SKY else np.nan
    of_depth = share, float((np.isposinf(found) & ~far).mean()), float(disparity_errors(found, true).mean()), of_right
    camera = dlama.orbit(rig.left, YAW_DEG, pivot=float(np.median(true[~far])))
    aside = dlama.complete(pair.scene, [camera]).view
    of_view = picture_errors(street.frame(camera).color, aside.color, np.ones(far.shape, np.bool_))
    mask = street.raycast(rig.left).group == street.object_index
    if mask.sum() < LEAST_OBJECT:
        return *of_depth, *of_view, np.nan, np.nan, np.nan
    filled, bare = dlama.stereo(left, right, rig, mask=mask).views[0], street.frame(rig.left, object=False)
    behind = float(disparity_errors(filled.depth, bare.depth)[mask].mean())
    return *of_depth, *of_view, *picture_errors(bare.color, filled.color, mask), behind


def picture_errors(truth: UInt8Array, found: UInt8Array, region: BoolArray) -> tuple[float, float]:
    """LPIPS and squared error of a region (H x W)."""
    return float(lpips_map(truth, found, region)[region].mean()), float(mse_map(truth, found)[region].mean())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--rule", choices=RULES, default="plain-infinity")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    rows: dict[str, list[tuple[float, ...]]] = {asked.rule: [], "": []}
    for number in range(asked.first, asked.last):
        for rule, values in rows.items():
            with without(rule):
                values.append(measure(number))
    before, now = (np.array(values) for values in rows.values())
    for k, name in enumerate(NAMES):
        change = (now - before)[:, k]
        change = change[np.isfinite(change)]
        draws = np.random.default_rng(0).choice(change, (2000, len(change))).mean(1)
        low, high = np.quantile(draws, (0.025, 0.975))
        means = np.nanmean(before[:, k]), np.nanmean(now[:, k])
        print(f"{name:38} {means[0]:.4f} {means[1]:.4f}  {low:+.4f} to {high:+.4f}, {len(change)}")


if __name__ == "__main__":
    main()
