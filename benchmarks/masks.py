"""How well object masks are found: data sets in, a table out.

    python benchmarks/masks.py worlds:100:3100 --yaws 0
    python benchmarks/masks.py ../shared/street --scenes s06 s08
    python benchmarks/masks.py worlds:20:9400 --yaws 0 --sensor shifted

Means of IoU and border F over the frames that show a thing and its true mask, by what was given: clicks, a box, a click with the
depth estimated from the picture; GrabCut alone beside them. With --sensor one click alone, in frames as a depth camera measures
them (`sensors`: noise, steps, shadows without depth; the picture as JPEG); `shifted` moves depth by 3 or 4
columns and 2 rows against the picture first, `none` leaves both exact. One line for each frame comes first.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np

from dlama.datasets.frames import RemovalTruth
from dlama.evaluation.metrics.masks import border_f, innermost_pixel
from dlama.evaluation.protocols.pointing import find_masks, find_or_empty
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.object_masks import MaskSession
from dlama.worlds.dataset import open_dataset_or_worlds
from sensors import add_photo_noise, structured_light

SEED = 7


def measured(truth: RemovalTruth) -> dict[str, tuple[float, float]]:
    """IoU and border F by what was given."""
    masks, _ = find_masks(truth)
    return {name: (iou(mask, truth.mask), border_f(mask, truth.mask)) for name, mask in masks.items()}


def by_a_depth_camera(truth: RemovalTruth, shifted: bool, seed: int) -> RGBD:
    """The frame as a depth camera measures it, beside its picture where `shifted`."""
    source, rng = truth.source, np.random.default_rng(seed)
    measured = source
    if shifted:
        by = np.array([[1, 0, rng.choice([-3.0, 3.0, 4.0])], [0, 1, rng.choice([-2.0, 2.0])]], np.float32)
        size = source.camera.wh
        depth = cv2.warpAffine(source.depth, by, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        measured = dataclasses.replace(source, depth=depth)
    return dataclasses.replace(structured_light(measured, rng), color=add_photo_noise(source.color, rng))


def one_click(rgbd: RGBD, true: BoolArray) -> dict[str, tuple[float, float]]:
    """IoU and border F of one click at the true mask's innermost pixel."""
    mask = find_or_empty(MaskSession(rgbd), true, clicks=[innermost_pixel(true)])
    return {"click": (iou(mask, true), border_f(mask, true))}


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("--scenes", nargs="*", default=None, help="only these, of data sets in folders")
    parser.add_argument("--yaws", nargs="*", type=float, default=None, help="only frames at these, degrees")
    parser.add_argument("--every", type=int, default=1, help="every so many frames")
    parser.add_argument("--sensor", choices=("none", "camera", "shifted"), help="as a depth camera measures; one click")
    args = parser.parse_args(argv)
    for name in args.datasets:
        scenes = None if name.startswith("worlds") else args.scenes
        cases = [case for case in open_dataset_or_worlds(name, scenes=scenes).cases if case.protocol == "ori"]
        cases = [case for case in cases if not args.yaws or case.yaw in args.yaws][:: args.every]
        rows = []
        for number, case in enumerate(cases):
            truth = case.load()
            assert isinstance(truth, RemovalTruth)
            if args.sensor is None:
                rows.append(measured(truth))
            else:
                exact = args.sensor == "none"
                frame = truth.source if exact else by_a_depth_camera(truth, args.sensor == "shifted", number + SEED)
                rows.append(one_click(frame, truth.mask))
            print(case.scene, case.frame, *(f"{which} {value[0]:.3f}" for which, value in rows[-1].items()), flush=True)
        print(f"\n{name}: {len(rows)} frames\n\n| | IoU | border F |\n|---|---|---|")
        for which in rows[0]:
            mean = np.mean([row[which] for row in rows], axis=0)
            print(f"| {which} | {mean[0]:.3f} | {mean[1]:.3f} |")


if __name__ == "__main__":
    main()
