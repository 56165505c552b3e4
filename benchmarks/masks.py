"""Object masks alone, without the removal that `dlama evaluate --protocol mask` does with them: data sets in, a table out.

    python benchmarks/masks.py worlds:100:3100 --yaws 0
    python benchmarks/masks.py ../shared/street --scenes s06 s08

Means of IoU and border F over the frames that show a thing and its true mask, by what was given: clicks, a box, a click with the
depth estimated from the picture; GrabCut alone beside them. One line for each frame comes first.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.masks import border_f, iou
from dlama.evaluation.protocols.mask import found_masks
from dlama.worlds.dataset import open_dataset_or_worlds


def measured(truth: RemovalTruth) -> dict[str, tuple[float, float]]:
    """IoU and border F by what was given."""
    masks, _ = found_masks(truth)
    return {name: (iou(mask, truth.mask), border_f(mask, truth.mask)) for name, mask in masks.items()}


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("--scenes", nargs="*", default=None, help="only these, of data sets in folders")
    parser.add_argument("--yaws", nargs="*", type=float, default=None, help="only frames at these, degrees")
    args = parser.parse_args(argv)
    for name in args.datasets:
        scenes = None if name.startswith("worlds") else args.scenes
        cases = [case for case in open_dataset_or_worlds(name, scenes=scenes).cases if case.protocol == "ori"]
        rows = []
        for case in cases:
            if args.yaws and case.yaw not in args.yaws:
                continue
            truth = case.load()
            assert isinstance(truth, RemovalTruth)
            rows.append(measured(truth))
            print(case.scene, case.frame, *(f"{which} {value[0]:.3f}" for which, value in rows[-1].items()), flush=True)
        print(f"\n{name}: {len(rows)} frames\n\n| | IoU | border F |\n|---|---|---|")
        for which in rows[0]:
            mean = np.mean([row[which] for row in rows], axis=0)
            print(f"| {which} | {mean[0]:.3f} | {mean[1]:.3f} |")


if __name__ == "__main__":
    main()
