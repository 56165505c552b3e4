"""The paper's recipe with Telea on ../shared/street beside the numbers of an independent implementation: a table for each way.

    python benchmarks/cross_check.py ../shared/street

`as shipped` is `paper/telea` as the package runs it. The package does two things to every recipe and the reference to none:
`without the law` leaves out the correction of filled depth by the visibility law, `to the letter` also the rejection of
flying pixels before points are drawn. `by hand` shares no code with the package but the metrics: a z-buffer of a dozen
lines and OpenCV. All are means over + and - and the four scenes; a number stands beside its ratio to the reference.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from dlama.completion.options import Options
from dlama.completion.pipeline import complete
from dlama.completion.recipes import RECIPES
from dlama.completion.start import Plan, plan_for, scene_of
from dlama.completion.steps import fill, warp
from dlama.evaluation.metrics.pictures import depth_8bit
from dlama.evaluation.protocols.methods import ProtocolSettings
from dlama.evaluation.protocols.scores import Reference
from dlama.geometry import rendering
from dlama.geometry.camera import Camera
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

SCENES = ("s03", "s05", "s06", "s08")
REFERENCE = {
    10: (24.79, 0.8004, 0.1717, 333.6, 0.9542, 0.0961, 160.8),
    20: (40.42, 0.7319, 0.2749, 659.9, 0.9318, 0.1619, 383.1),
    30: (51.04, 0.6837, 0.3458, 1005.2, 0.9129, 0.2064, 610.4),
    40: (58.79, 0.6406, 0.4080, 1369.2, 0.8888, 0.2541, 1013.6),
    50: (64.39, 0.6105, 0.4611, 1751.6, 0.8699, 0.2911, 1787.4),
    60: (68.29, 0.5894, 0.4999, 2222.8, 0.8578, 0.3111, 2624.3),
}
"""Yaw -> mask %, SSIM, LPIPS and MSE of colour, the same of 8-bit depth."""
COLUMNS = ("mask %", "SSIM", "LPIPS", "MSE", "d SSIM", "d LPIPS", "d MSE")
CLIP_M = 10.0
Made = tuple[float, np.ndarray, np.ndarray]
"""Hole in %, colour, metres."""


def frames(folder: Path, scene: str, yaws: set[int]) -> dict[int, RGBD]:
    """Yaw (0 and + and - each of `yaws`) -> frame, of the sequence with the object (street/README.md)."""
    listing = json.loads((folder / scene / "poses.json").read_text())["sequences"]["with"]["frames"]
    base, found = folder / scene / "with" / "CameraComponent", {}
    for number, frame in enumerate(listing):
        yaw = round(frame["yaw_deg"])
        if abs(yaw) not in yaws | {0}:
            continue
        name = f"{scene}_with.{number:04d}"
        color = np.asarray(cv2.imread(str(base / "ColorImage" / f"{name}.jpeg")))[..., ::-1]
        depth = np.asarray(cv2.imread(str(base / "DepthMM" / f"{name}.png"), cv2.IMREAD_UNCHANGED))
        metres = np.where(depth == 65535, np.inf, depth / 1000).astype(np.float32)
        camera = Camera.from_fov(512, 512, 90, frame["world_from_cam"])
        found[yaw] = RGBD(np.ascontiguousarray(color), metres, camera)
    return found


def as_shipped(source: RGBD, target: Camera) -> Made:
    """The package."""
    done = complete(source, [target], filler="telea", recipe="paper")
    return made(done.warped[0], done.view)


def without_law(source: RGBD, target: Camera) -> Made:
    """The package, filled depth left where the filler put it."""
    plan = paper_plan(source)
    warped, _ = warp(plan, plan.given, target)
    return made(warped, fill(plan, warped)[0])


def to_the_letter(source: RGBD, target: Camera) -> Made:
    """The package without the law, and with every point drawn."""
    plan = paper_plan(source)
    warped = rendering.render(lift(plan.given.layers[0]), target, "points")
    return made(warped, fill(plan, warped)[0])


def paper_plan(source: RGBD) -> Plan:
    """The paper's recipe with Telea, about to move; nothing holds its depth to a law."""
    recipe = dataclasses.replace(RECIPES["paper"], law=False)
    return plan_for(scene_of(source, recipe.clip), Options(recipe=recipe, filler="telea"))[0]


def made(warped: View, filled: View) -> Made:
    """What is measured of a view before and after filling."""
    return 100 * float(warped.hole.mean()), filled.color, filled.depth


def by_hand(source: RGBD, target: Camera) -> Made:
    """Nearest pixel, z-buffer, all clipped at 10 m; colour and 8-bit depth filled apart by Telea with radius 3."""
    depth = np.minimum(source.depth, CLIP_M).astype(np.float64)
    rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]] + 0.5
    camera = source.camera
    points = np.stack([(columns - camera.cx) / camera.fx * depth, (rows - camera.cy) / camera.fy * depth, depth], -1)
    pose = np.linalg.inv(target.world_from_cam) @ camera.world_from_cam
    x, y, z = (points.reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = np.floor(target.fx * x / z + target.cx), np.floor(target.fy * y / z + target.cy)
    lands = (z > 0) & (column >= 0) & (row >= 0) & (column < target.width) & (row < target.height)
    order = np.flatnonzero(lands)[np.argsort(-z[lands], kind="stable")]  # the nearest is written last
    place = row[order].astype(int), column[order].astype(int)
    color, metres = np.zeros((*target.hw, 3), np.uint8), np.zeros(target.hw, np.float32)
    color[place], metres[place] = source.color.reshape(-1, 3)[order], z[order]
    hole = (metres == 0).astype(np.uint8)
    levels = cv2.inpaint(depth_8bit(metres, CLIP_M), hole, 3, cv2.INPAINT_TELEA)
    filled = cv2.inpaint(color, hole, 3, cv2.INPAINT_TELEA)
    return 100 * float(hole.mean()), filled, (levels * (CLIP_M / 255)).astype(np.float32)


WAYS: dict[str, Callable[[RGBD, Camera], Made]] = {
    "as shipped": as_shipped,
    "without the law": without_law,
    "to the letter": to_the_letter,
    "by hand": by_hand,
}


def measured(made: Made, target: RGBD) -> list[float]:
    """The seven numbers of the reference's columns."""
    hole, color, depth = made
    reference = Reference(target.color, target.depth, {}, ProtocolSettings(clip_m=CLIP_M))
    found = {(m.modality, m.metric): m.value for m in reference.color_measures(color) + reference.depth_measures(depth)}
    return [hole, *(found[modality, metric] for modality in ("rgb", "depth") for metric in ("ssim", "lpips", "mse"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="shared/street")
    parser.add_argument("--yaws", nargs="+", type=int, default=list(REFERENCE))
    parser.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    args = parser.parse_args()
    street = {scene: frames(args.folder, scene, set(args.yaws)) for scene in SCENES}
    for way in args.ways:
        print(f"{way}\n{'yaw':>5} " + " ".join(f"{name:>16}" for name in COLUMNS))
        worst = 0.0
        for yaw in args.yaws:
            rows = [
                measured(WAYS[way](found[0], found[sign * yaw].camera), found[sign * yaw])
                for found in street.values()
                for sign in (1, -1)
            ]
            mean, there = np.mean(rows, 0), np.array(REFERENCE[yaw])
            ratios = mean / there
            worst = max(worst, float(np.abs(ratios - 1).max()))
            print(f"±{yaw:>4} " + " ".join(f"{m:>8.5g} x{r:<6.4f}" for m, r in zip(mean, ratios)), flush=True)
        print(f"farthest from the reference: {100 * worst:.2f} %\n")


if __name__ == "__main__":
    main()
