"""What both eyes are worth for a removed object: prints how the filled left picture agrees with what the right camera really saw.

python benchmarks/stereo_removal.py --data FOLDER/motorcycle

The front of the motorcycle (everything nearer than NEAR_PX in the right half) is removed from both pictures. Counted are pixels
of the left hole whose completed surface lies in sight of the right camera outside its own hole: their share of the hole, and
their mean absolute difference in grey levels from the right picture there (times the gain between both pictures).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from dlama.completion.stereo.stereo import stereo
from dlama.datasets.frames import StereoTruth
from dlama.datasets.layouts import open_dataset
from dlama.geometry.view import HoleType
from dlama.perception.stereo.matching import nearest_columns

NEAR_PX = 38
"""Disparity from which a pixel is the motorcycle's."""
SAME_PX = 1.5
"""Disparities of one surface in both completed views differ by no more."""


def main() -> None:
    """Print the share and the difference."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    truth = open_dataset(parser.parse_args().data).cases[0].load()
    assert isinstance(truth, StereoTruth)
    done = stereo(truth.left, truth.right, truth.rig, mask=front(truth))
    hole, other = (before.hole_type == HoleType.OBJECT for before in done.warped)
    columns, inside = nearest_columns(done.disparity_left, 1)
    apart = np.abs(np.take_along_axis(done.disparity_right, columns, 1) - done.disparity_left)
    shown = hole & inside & ~np.take_along_axis(other, columns, 1) & (apart < SAME_PX)
    there = np.take_along_axis(truth.right, columns[..., None], 1) * np.asarray(done.meta["stereo"].get("gain", 1.0))
    difference = np.abs(done.views[0].color - there).mean(-1)[shown].mean()
    print(
        f"in sight of the right camera: {shown.sum() / hole.sum():.1%} of the hole, {difference:.1f} grey levels apart"
    )


def front(truth: StereoTruth) -> np.ndarray:
    """H x W, True at the front half of the motorcycle: the largest near thing, grown by 2 px, without the ground below it."""
    near = (np.nan_to_num(truth.disparity_left, posinf=0) > NEAR_PX).astype(np.uint8)
    _, labels, sizes, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(near, cv2.MORPH_CLOSE, np.ones((9, 9))))
    rows, columns = np.indices(near.shape)
    thing = (labels == 1 + sizes[1:, cv2.CC_STAT_AREA].argmax()) & (rows < 0.86 * near.shape[0])
    mask = cv2.dilate(thing.astype(np.uint8), np.ones((5, 5))) > 0
    return np.asarray(mask & (columns > near.shape[1] // 2), np.bool_)


if __name__ == "__main__":
    main()
