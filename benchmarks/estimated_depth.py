"""Depth estimated from the picture against true depth: its errors, its blurred edges, and views made of it; prints one table.

    python benchmarks/estimated_depth.py ../shared/street --scenes s03 s05
    python benchmarks/estimated_depth.py ../shared/data/kitchen_vpi

Scale (factor and shift of inverse depth) is fitted to some 400 true depths, as `--metres-at` does. AbsRel: mean relative error of
depth up to 60 m. Flying: where a map has a step by a sixth within 10 px, near a true depth edge, the share of the pixels that lie
between both sides of it, further from each than a fifth of the step. Views go about 10 degrees to the side and are compared with
the true picture.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from dlama.datasets.frames import Case, ViewTruth
from dlama.evaluation.protocols.methods import Method, ProtocolSettings, run_method
from dlama.evaluation.protocols.vpi import reference_of
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.perception.monocular import DEFAULT, estimate_depth
from dlama.worlds.dataset import open_dataset_or_worlds

FARTHEST_M = 60.0
COLUMNS = ("AbsRel", "flying %", "SSIM", "LPIPS", "MSE", "seen SSIM", "seen MSE")


def cases(dataset: str, scenes: Sequence[str] | None, yaw: float, limit: int) -> Iterator[Case]:
    """View changes by about that many degrees."""
    found = open_dataset_or_worlds(dataset, scenes=scenes).cases
    near = [case for case in found if case.protocol == "vpi" and case.yaw is not None and abs(abs(case.yaw) - yaw) < 1]
    return iter(near[:limit])


def usable(depth: np.ndarray) -> np.ndarray:
    """Where true depth can be compared."""
    return (depth > 0) & (depth < FARTHEST_M)


def known_points(depth: np.ndarray) -> list[tuple[float, float, float]]:
    """Some 400 true depths, on a grid."""
    step = max(1, round((depth.size / 400) ** 0.5))
    return [
        (column + 0.5, row + 0.5, float(depth[row, column]))
        for row in range(step // 2, depth.shape[0], step)
        for column in range(step // 2, depth.shape[1], step)
        if usable(depth)[row, column]
    ]


def near_edges(depth: np.ndarray) -> np.ndarray:
    """Within 8 px of a step of true depth by a quarter."""
    filled = np.where(depth > 0, np.minimum(depth, 100), np.float32(0))
    square = np.ones((3, 3), np.uint8)
    low = cv2.erode(np.where(filled > 0, filled, np.float32(1e3)), square)
    step = (cv2.dilate(filled, square) > 1.25 * low) & (low < 1e3) & (cv2.erode(filled, np.ones((5, 5), np.uint8)) > 0)
    return cv2.dilate(step.astype(np.uint8), np.ones((17, 17), np.uint8)) > 0


def flying_share(depth: np.ndarray, near: np.ndarray) -> float:
    """Of the pixels of `near` round which depth has a step, the share that lies on neither side of it, in percent."""
    known = depth > 0
    w = np.divide(1, depth, out=np.zeros_like(depth), where=known & np.isfinite(depth))
    window = np.ones((21, 21), np.uint8)
    low, high = cv2.erode(np.where(known, w, np.float32(1e9)), window), cv2.dilate(w, window)
    gap = high - low
    step = near & known & (gap > high / 6)
    between = (w - low > 0.2 * gap) & (high - w > 0.2 * gap)
    return 100 * float(between[step].mean()) if step.any() else 0.0


def scores(truth: ViewTruth, rgbd: RGBD, filler: str | None) -> list[float]:
    """The numbers of COLUMNS for one source."""
    true, mine = truth.source.depth, rgbd.depth
    where = usable(true) & (mine > 0) & np.isfinite(mine)
    error = float((abs(mine[where] - true[where]) / true[where]).mean())
    row = [error, flying_share(mine, near_edges(true))]
    if filler is None:
        return row
    reference = reference_of(truth, truth.target, ProtocolSettings(), with_object=False)
    view = run_method(Method("dlama", filler), rgbd, truth.target.camera).view()
    found = {(one.region, one.metric): one.value for one in reference.color_measures(view.color)}
    wanted = [("whole", "ssim"), ("whole", "lpips"), ("whole", "mse"), ("seen", "ssim"), ("seen", "mse")]
    return row + [found.get(name, float("nan")) for name in wanted]


def sources(truth: ViewTruth, depth_model: str) -> dict[str, RGBD]:
    """The source with its true depth, and with estimated depth as it comes and sharpened."""
    given = truth.source
    known = known_points(given.depth)
    estimate = estimate_depth(given.color, given.camera, depth_model=depth_model, metres_at=known)
    raw = estimate_depth(given.color, given.camera, depth_model=depth_model, metres_at=known, sharpen=False)
    return {"true": given, "estimated, raw": raw.rgbd, "estimated, sharpened": estimate.rgbd}


def times(color: np.ndarray, depth_model: str) -> str:
    """Processor time of an estimate, kernels and network loaded, the median of seven."""
    camera, taken = Camera.from_fov(color.shape[1], color.shape[0], 60), {}
    for name, options in (("sharpened", {}), ("raw", {"sharpen": False})):
        known = [(color.shape[1] / 2, color.shape[0] / 2, 3.0)]
        found = []
        for _ in range(8):
            started = time.process_time()
            estimate_depth(color, camera, depth_model=depth_model, metres_at=known, **options)
            found.append(time.process_time() - started)
        taken[name] = float(np.median(found[1:]))
    size = f"{color.shape[1]}x{color.shape[0]}"
    return f"estimate_depth of {size}: {taken['sharpened']:.3f} s of processor time, {taken['raw']:.3f} s unsharpened"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--scenes", nargs="*")
    parser.add_argument("--yaw", type=float, default=10, help="degrees of the views (default: 10)")
    parser.add_argument("--limit", type=int, default=8, help="cases at most (default: 8)")
    parser.add_argument("--depth-model", default=DEFAULT)
    parser.add_argument("--filler", default="layered")
    parser.add_argument("--no-views", action="store_true", help="depth only")
    chosen = parser.parse_args()
    found: dict[str, list[list[float]]] = {}
    for case in cases(str(chosen.dataset), chosen.scenes, chosen.yaw, chosen.limit):
        truth = case.load()
        for name, rgbd in sources(truth, chosen.depth_model).items():
            found.setdefault(name, []).append(scores(truth, rgbd, None if chosen.no_views else chosen.filler))
    width = len(next(iter(found.values()))[0])
    count = len(next(iter(found.values())))
    print(f"{chosen.dataset.name}, {count} views, {chosen.depth_model}\n")
    print("| depth | " + " | ".join(COLUMNS[:width]) + " |\n|---" * 1 + "|---" * width + "|")
    for name, rows in found.items():
        mean = np.mean(rows, 0)
        digits = (3, 1, 4, 4, 0, 4, 0)
        print(f"| {name} | " + " | ".join(f"{value:.{places}f}" for value, places in zip(mean, digits)) + " |")
    print(f"\n{times(truth.source.color, chosen.depth_model)}")


if __name__ == "__main__":
    main()
