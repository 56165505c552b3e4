"""Quality of rendering and filling against true frames: prints one table per data set, every method in the same regions.

    python benchmarks/quality.py street ../shared/street --scenes s03 s05
    python benchmarks/quality.py kitchen ../shared/data/kitchen_vpi

The region is the same for all: target pixels that the source camera does not see, from the true depths (2 % tolerance),
typed by whether they project into the source picture (disoccluded) or not (out of view). Depth errors are absolute, in
metres, with both depths cut at 10 m so that sky has a value; colour errors are 8 bit. A method's own
hole counts only as its ratio.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from skimage.metrics import structural_similarity

from dlama.completion.pipeline import complete
from dlama.geometry.camera import Camera
from dlama.geometry.projection import lift, project
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

CLIP_M = 10.0
METHODS = {
    "points+telea": {"filler": "telea", "mode": "points", "depth_by": "filler"},
    "surface+telea": {"filler": "telea", "depth_by": "filler"},
    "surface+layered": {"filler": "layered"},
}


@dataclass
class Pair:
    """A source frame, the true frame at the target, and a name for the row it counts in."""

    group: str
    source: RGBD
    target: RGBD


def street_pairs(folder: Path, scenes: list[str], yaws: list[int]) -> Iterator[Pair]:
    """Yaw 0 to +-yaw, for each scene (street/README.md)."""
    for scene in scenes:
        poses = json.loads((folder / scene / "poses.json").read_text())
        frames = poses["sequences"]["with"]["frames"]
        loaded = {}
        for number, frame in enumerate(frames):
            if abs(round(frame["yaw_deg"])) in (0, *yaws):
                camera = Camera.from_fov(512, 512, 90, frame["world_from_cam"])
                loaded[round(frame["yaw_deg"])] = street_frame(folder / scene / "with", f"{scene}_with", number, camera)
        for yaw in yaws:
            for sign in (1, -1):
                yield Pair(f"yaw {yaw}", loaded[0], loaded[sign * yaw])


def street_frame(folder: Path, name: str, number: int, camera: Camera) -> RGBD:
    color = cv2.imread(str(folder / f"CameraComponent/ColorImage/{name}.{number:04d}.jpeg"))[..., ::-1]
    depth = cv2.imread(str(folder / f"CameraComponent/DepthMM/{name}.{number:04d}.png"), cv2.IMREAD_UNCHANGED)
    metres = depth.astype(np.float32) / 1000
    metres[depth == 65535] = np.inf
    return RGBD(np.ascontiguousarray(color), metres, camera)


def kitchen_pairs(folder: Path) -> Iterator[Pair]:
    """The posed real pairs of kitchen_vpi, grouped by rotation."""
    listing = json.loads((folder / "pairs.json").read_text())
    k = np.array(listing["K"])

    def load(name: str) -> RGBD:
        frame = listing["frames"][name]
        color = cv2.imread(str(folder / frame["color"]))[..., ::-1]
        depth = cv2.imread(str(folder / frame["depth"]), cv2.IMREAD_UNCHANGED).astype(np.float32) / 1000
        camera = Camera.from_K(k, 640, 480, pixel_center=0.0, world_from_cam=frame["world_from_cam"])
        return RGBD(np.ascontiguousarray(color), depth, camera)

    for pair in listing["pairs"]:
        a, b = pair["a"], pair["b"]
        degrees = 10 * round(pair["rotation_deg"] / 10)
        yield Pair(f"rot {degrees}", load(a), load(b))


def regions(pair: Pair) -> dict[str, np.ndarray]:
    """What the source sees of the target, by the true depths; far pixels by their direction."""
    source, target = pair.source, pair.target
    far_to = 1e5
    finite = View.from_rgbd(RGBD(target.color, np.where(target.far, np.float32(far_to), target.depth), target.camera))
    pixels, z = project(lift(finite).points, source.camera)
    height, width = source.depth.shape
    inside = (z > 0) & (pixels >= 0).all(1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    seen = np.zeros(len(z), bool)
    column, row = pixels[inside].astype(int).T
    there = np.where(source.far, np.float32(far_to), source.depth)[row, column]
    # the source saw this point, or something farther (a sensor hole is 0 and says nothing)
    seen[inside] = (np.abs(there - z[inside]) < 0.02 * z[inside]) | (
        (there > 0.5 * far_to) & (z[inside] > 0.5 * far_to)
    )
    hidden = np.zeros(len(z), bool)
    hidden[inside] = (there > 0) & (there < 0.98 * z[inside])
    valid = target.depth > 0
    out = {}
    for name, flags in (("seen", seen), ("disoccluded", hidden), ("out of view", ~inside)):
        picture = np.zeros(valid.shape, bool)
        picture[valid] = flags
        out[name] = picture
    out["unseen"] = out["disoccluded"] | out["out of view"]
    return out


def gain(view: View, truth: RGBD, seen: np.ndarray) -> np.ndarray:
    """One factor per colour channel, fitted on what both frames see (auto-exposure)."""
    known = seen & ~view.filled
    mine, theirs = view.color[known].astype(float), truth.color[known].astype(float)
    return np.median(theirs, 0) / np.maximum(np.median(mine, 0), 1) if known.sum() > 100 else np.ones(3)


def score(view: View, warped: View, pair: Pair, where: dict[str, np.ndarray], undo_gain: bool) -> dict[str, float]:
    truth = pair.target.color.astype(float)
    mine = view.color.astype(float)
    if undo_gain:
        mine = np.clip(mine * gain(warped, pair.target, where["seen"]), 0, 255)
    _, ssim = structural_similarity(truth, mine, data_range=255, channel_axis=2, full=True)
    squared = ((truth - mine) ** 2).mean(2)
    known = pair.target.depth > 0
    true_depth = np.minimum(pair.target.depth, CLIP_M)
    depth = np.where(view.hole, CLIP_M, np.minimum(view.depth, CLIP_M))
    error = np.abs(depth - true_depth)
    visible = where["seen"] & ~warped.hole
    out = {
        "hole %": 100 * float(warped.hole.mean()),
        "SSIM": float(ssim.mean()),
        "PSNR": float(10 * np.log10(255**2 / squared.mean())),
        "seen>5%": 100 * float((error[visible] > 0.05 * true_depth[visible]).mean()),
    }
    for region in ("unseen", "disoccluded", "out of view"):
        chosen = where[region] & known
        short = {"unseen": "uns", "disoccluded": "dis", "out of view": "oov"}[region]
        if chosen.sum() > 50:
            out[f"{short} SSIM"] = float(ssim.mean(2)[chosen].mean())
            out[f"{short} MSE"] = float(squared[chosen].mean())
            out[f"{short} dMAE"] = float(error[chosen].mean())
    return out


def evaluate(pairs: Iterator[Pair], methods: dict[str, dict], undo_gain: bool, sheet: Path | None) -> None:
    rows: dict[tuple[str, str], list[dict[str, float]]] = defaultdict(list)
    for number, pair in enumerate(pairs):
        where = regions(pair)
        for name, settings in methods.items():
            started = time.perf_counter()
            done = complete(pair.source, [pair.target.camera], **settings)
            seconds = time.perf_counter() - started
            result = score(done.view, done.warped[0], pair, where, undo_gain)
            rows[pair.group, name].append(result | {"s": seconds})
            if sheet:
                sheet.mkdir(parents=True, exist_ok=True)
                panel = np.hstack(
                    [
                        done.warped[0].color,
                        done.view.color,
                        pair.target.color,
                        shown(done.view.depth),
                        shown(pair.target.depth),
                    ]
                )
                cv2.imwrite(str(sheet / f"{number:02d}_{pair.group.replace(' ', '')}_{name}.jpg"), panel[..., ::-1])
    keys = (
        ["hole %", "SSIM", "PSNR", "seen>5%"]
        + [f"{r} {m}" for r in ("uns", "dis", "oov") for m in ("SSIM", "MSE", "dMAE")]
        + ["s"]
    )
    print(f"{'group':8} {'method':18} " + " ".join(f"{key:>8}" for key in keys))
    for (group, name), results in sorted(rows.items(), key=lambda item: (item[0][0], list(methods).index(item[0][1]))):
        means = [
            np.mean([r[key] for r in results if key in r]) if any(key in r for r in results) else np.nan for key in keys
        ]
        print(f"{group:8} {name:18} " + " ".join(f"{value:8.4g}" for value in means))


def shown(depth: np.ndarray) -> np.ndarray:
    level = np.where(depth > 0, 255 * np.clip(1 / np.maximum(depth, 1), 0, 1), 0).astype(np.uint8)
    return cv2.applyColorMap(level, cv2.COLORMAP_TURBO)[..., ::-1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", choices=("street", "kitchen"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenes", nargs="+", default=["s03", "s05"])
    parser.add_argument("--yaws", nargs="+", type=int, default=[10, 20, 30, 40, 50, 60])
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    parser.add_argument("--sheet", type=Path, help="write a picture of every result into this folder")
    args = parser.parse_args()
    pairs = (
        street_pairs(args.folder, args.scenes, args.yaws) if args.dataset == "street" else kitchen_pairs(args.folder)
    )
    evaluate(pairs, {name: METHODS[name] for name in args.methods}, args.dataset == "kitchen", args.sheet)


if __name__ == "__main__":
    main()
