"""Masks carried from one frame to others of the same scene, whose true masks are known: how well they fit, by domain.

    python benchmarks/carried_masks.py ../shared --split tune
    python benchmarks/carried_masks.py ../shared --split validate -o carried.json
    python benchmarks/carried_masks.py ../shared --cut       # worlds alone: the masked frame's border cuts the object in half
    python benchmarks/carried_masks.py ../shared --hidden    # worlds alone: what other objects hide of it in the masked frame

Procedural worlds (`world`), the same with objects on islands, plinths and tables (`stand`), and streets, as sensors see them.
The true mask is given in one frame; printed is the mean IoU in four others, 12 to 50 degrees (streets: 10 to 40) aside, with its
95 % interval (bootstrap by scene), the share of the object that is found, what else is found over the object's pixels, the share
of masks under .5, and processor seconds a frame. Objects of which less than SEEN px are seen there do not count. Five minutes on
one core.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from itertools import chain, product
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

import dlama
from click_worlds import ClickScene, ClickWorld, objects_in_sight
from clicks import FIRST, HELD_OUT, SHARES, STREETS, interval
from dlama.datasets.frames import RemovalTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import InputError
from dlama.geometry.frames.agreement import AGREES
from dlama.geometry.holes import iou
from dlama.geometry.projection import project_to_pixels, world_points
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View
from dlama.perception.object_removal import carry_masks
from world_cases import as_seen

YAWS, SIZE, FOV_DEG, MOST_YAW = (0, -25, 25, 12, -50), 384, 75.0, 30
"""Of the frames about a world's first camera, whose own yaw is at most MOST_YAW; px; degrees."""
STREET_FRAMES = "with-0000", "with-0001", "with-0002", "with-0004", "with-0007"
"""Yaw 0, 10, -10, -20 and 40."""
WORLDS, MOST_OBJECTS, FARTHEST_M, SEEN = 8, 4, 8.0, 100
HIDDEN_WORLDS, HIDDEN = 24, 0.15
"""Worlds in which partly hidden objects are looked for; least share of an object's pixels in another frame that the masked frame
hides."""
SENSORS = "exact", "kinect", "matcher"
STAND_SEEDS = 500
"""Between the seeds of worlds and of those with stands."""


class Frames(NamedTuple):
    """A scene, and objects in it."""

    domain: str
    name: str
    frames: list[RGBD]
    objects: list[list[tuple[BoolArray, BoolArray]]]
    """Of each object its mask in every frame, and what stands on it, which does not count (H x W each)."""


def world_frames(split: str, cut: bool, hidden: bool) -> Iterator[Frames]:
    """Worlds as each sensor sees them. cut: each object apart, cut by the border of the frame in which it is masked; hidden:
    those that are hidden in part there, in the frames that show the hidden part."""
    for number in range(FIRST[split], FIRST[split] + (HIDDEN_WORLDS if hidden else WORLDS)):
        for kind in ("world", "stand"):
            made = ClickWorld(HELD_OUT + number + STAND_SEEDS * (kind == "stand"), stands=kind == "stand")
            rng = np.random.default_rng([number, 21])
            first = float(rng.uniform(-MOST_YAW, MOST_YAW))
            scenes = [made.scene(made.world.camera(first + yaw, SIZE, FOV_DEG)) for yaw in YAWS]
            depth = scenes[0].frame.depth
            seen = [n for n in objects_in_sight(scenes[0], *SHARES) if np.median(depth[scenes[0].mask(n)]) < FARTHEST_M]
            views = [(scenes, seen[:MOST_OBJECTS])]
            if hidden:
                shares = {n: [hidden_share(scenes[0], each, n) for each in scenes] for n in seen}
                showing = {n: [0, *(k for k, share in enumerate(of) if share > HIDDEN)] for n, of in shares.items()}
                views = [([scenes[k] for k in at], [n]) for n, at in showing.items() if len(at) > 1][:MOST_OBJECTS]
            if cut:
                views = [([turn_away(made, scenes[0], n), *scenes[1:]], [n]) for n in seen[:MOST_OBJECTS]]
            for (shown, objects), sensor in product(views, SENSORS):
                frames = [
                    as_seen(one.frame, sensor, np.random.default_rng([number, 5, k])) for k, one in enumerate(shown)
                ]
                masks = [[(one.mask(n), one.on_it(n)) for one in shown] for n in objects]
                yield Frames(f"{kind} {sensor}", str(number), frames, masks)


def hidden_share(first: ClickScene, other: ClickScene, n: int) -> float:
    """Share of the pixels of an object in another frame, in view of the first one, that something else hides there."""
    points = world_points(View.from_rgbd(other.frame))[other.mask(n)]
    row, column, z, inside = project_to_pixels(points, first.frame.camera)
    hides = (first.frame.depth[row, column] < (1 - AGREES) * z) & ~first.mask(n)[row, column]
    return float(hides[inside].mean()) if inside.any() else 0.0


def turn_away(made: ClickWorld, scene: ClickScene, n: int) -> ClickScene:
    """What a camera sees that turns until half of an object's columns lie beyond its right border."""
    camera = scene.frame.camera
    middle = np.median(np.nonzero(scene.mask(n))[1]) + 0.5
    angle = np.arctan((middle - camera.cx) / camera.fx) - np.arctan((camera.width - camera.cx) / camera.fx)
    pose = camera.world_from_cam.copy()
    pose[:3, :3] @= cv2.Rodrigues(np.array([0, angle, 0]))[0]
    return made.scene(camera.at(pose))


def streets_with_objects(split: str, shared: Path) -> Iterator[tuple[str, list[RemovalTruth]]]:
    """Name and STREET_FRAMES of each street."""
    dataset = open_dataset(shared / "street")
    for scene in STREETS[split]:
        cases = {case.frame: case for case in dataset.cases if case.protocol == "ori" and case.scene == scene}
        loaded = (cases[frame].load() for frame in STREET_FRAMES)
        yield scene, [one for one in loaded if isinstance(one, RemovalTruth)]


def street_frames(split: str, shared: Path) -> Iterator[Frames]:
    """Streets as each sensor sees them."""
    for scene, truths in streets_with_objects(split, shared):
        objects = [[(one.mask, np.zeros_like(one.mask)) for one in truths]]
        for sensor in SENSORS:
            frames = [as_seen(one.source, sensor, np.random.default_rng([5, k])) for k, one in enumerate(truths)]
            yield Frames(f"street {sensor}", scene, frames, objects)


def scores_of(scene: Frames) -> list[tuple[float, float, float]]:
    """IoU, share found and share too much of each mask that is carried."""
    frames, found = dlama.scene(scene.frames), list[tuple[float, float, float]]()
    for masks in scene.objects:
        try:
            carried = list(carry_masks(frames, {0: masks[0][0]}))
        except InputError:  # no depth under the mask
            carried = [np.zeros_like(true) for true, _ in masks]
        for (true, on_it), mask in zip(masks[1:], carried[1:]):
            if (size := int(true.sum())) >= SEEN:
                both, more = (true & mask).sum() / size, (mask & ~true & ~on_it).sum() / size
                found.append((iou(mask & ~on_it, true), float(both), float(more)))
    return found


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(FIRST), default="tune")
    parser.add_argument("--cut", action="store_true", help="objects that the border of the masked frame cuts")
    parser.add_argument("--hidden", action="store_true", help="objects that others hide in part in the masked frame")
    parser.add_argument("-o", "--output", type=Path, help="scores of each mask as JSON")
    args = parser.parse_args(argv)
    scores: dict[str, dict[str, list[tuple[float, float, float]]]] = {}
    seconds: dict[str, float] = {}
    streets = street_frames(args.split, args.shared) if args.shared.is_dir() and not (args.cut or args.hidden) else ()
    for scene in chain(world_frames(args.split, args.cut, args.hidden), streets):
        started = time.process_time()
        scores.setdefault(scene.domain, {}).setdefault(scene.name, []).extend(scores_of(scene))
        seconds[scene.domain] = seconds.get(scene.domain, 0) + time.process_time() - started
    print("| domain | masks | IoU | 95 % | found | too much | under .5 | seconds |\n|" + "---|" * 8)
    means = []
    for domain, by_scene in scores.items():
        table = np.array([each for scene in by_scene.values() for each in scene])
        low, high = interval([[each[0] for each in scene] for scene in by_scene.values()])
        means.append(table.mean(0))
        under = 100 * float((table[:, 0] < 0.5).mean())
        print(
            f"| {domain} | {len(table)} | {means[-1][0]:.3f} | {low:.3f} to {high:.3f} | {means[-1][1]:.2f} | "
            f"{means[-1][2]:.2f} | {under:.0f} % | {seconds[domain] / len(table):.2f} |"
        )
    print(f"| mean | | {' | | '.join(f'{value:.3f}' for value in np.mean(means, 0)[:2])} | | | |")
    if args.output:
        args.output.write_text(json.dumps(scores))


if __name__ == "__main__":
    main()
