"""Objects removed from five frames of a scene whose masks are known: errors of colour and depth behind them, by domain.

    python benchmarks/removal_from_frames.py ../shared --split tune
    python benchmarks/removal_from_frames.py ../shared --split validate -o removal.json

Procedural worlds with an object on the ground (`world`), with one that stands on a table, a plinth or an island (`stand`), and
streets, in exact depth and a Kinect's. Masks hold the shadow, too (not on streets). All frames are completed with `layered`.
Printed by domain, in the masks grown by GROWN px: mean squared error, and the mean error of the logarithm of depth. Four minutes
on one core.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

import dlama
from carried_masks import streets_with_objects
from click_worlds import ClickWorld, objects_in_sight
from clicks import FIRST, HELD_OUT
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.worlds.dataset import world
from world_cases import as_seen

YAWS, SIZE, SENSORS, GROWN = (0, -20, 20, -45, 45), 256, ("exact", "kinect"), 3
WORLDS, STANDS, SEEDS, STAND_SEEDS = 16, 18, {"tune": 5000, "validate": 5100}, 700
SHARES, FARTHEST_M, MOST_OBJECTS = (0.006, 0.12), 6.0, 2
CHANGED = 12
"""Levels by which a pixel changes with the object, its shadow then."""
LEAST_PX = 50, 400
"""Of a mask that counts, and of the object of a world in the first frame."""


class Removal(NamedTuple):
    """A scene, and the same without an object."""

    domain: str
    frames: list[RGBD]
    masks: list[BoolArray]
    without: list[RGBD]


def as_sensors(
    kind: str, number: int, frames: list[RGBD], masks: list[BoolArray], without: list[RGBD]
) -> Iterator[Removal]:
    """As each sensor sees it; none where a frame does not show the object."""
    for sensor in SENSORS if all(mask.any() for mask in masks) else ():
        seen = [as_seen(frame, sensor, np.random.default_rng([number, k])) for k, frame in enumerate(frames)]
        yield Removal(f"{kind} {sensor}", seen, masks, without)


def world_removals(split: str) -> Iterator[Removal]:
    """Worlds without their object."""
    for number in range(SEEDS[split], SEEDS[split] + WORLDS):
        made = world(number)
        cameras = [made.camera(yaw, SIZE) for yaw in YAWS]
        seen = [(made.raycast(camera), made.raycast(camera, object=False)) for camera in cameras]
        masks = [(full.group == made.object_index) | made.shadow_of(full, empty) for full, empty in seen]
        if masks[0].sum() >= LEAST_PX[1]:
            frames = [[made.frame(camera, object=there) for camera in cameras] for there in (True, False)]
            yield from as_sensors("world", number, frames[0], masks, frames[1])


def stand_removals(split: str) -> Iterator[Removal]:
    """Worlds without an object that stands on another one."""
    for number in range(FIRST[split], FIRST[split] + STANDS):
        made = ClickWorld(HELD_OUT + number + STAND_SEEDS, stands=True)
        cameras = [made.world.camera(yaw, SIZE, 75) for yaw in YAWS]
        scenes = [made.scene(camera) for camera in cameras]
        depth = scenes[0].frame.depth
        seen = [n for n in objects_in_sight(scenes[0], *SHARES) if n in made.stands_on]
        for n in [each for each in seen if np.median(depth[scenes[0].mask(each)]) < FARTHEST_M][:MOST_OBJECTS]:
            empty = dataclasses.replace(made.world, object_index=n)
            without = [empty.frame(camera, object=False) for camera in cameras]
            changed = [np.abs(a.frame.color.astype(int) - b.color).max(-1) > CHANGED for a, b in zip(scenes, without)]
            masks = [one.mask(n) | more for one, more in zip(scenes, changed)]
            yield from as_sensors("stand", number, [one.frame for one in scenes], masks, without)


def street_removals(split: str, shared: Path) -> Iterator[Removal]:
    """Streets without their object."""
    for _, truths in streets_with_objects(split, shared):
        parts = ([getattr(one, name) for one in truths] for name in ("source", "mask", "without"))
        yield from as_sensors("street", 5, *parts)


def errors_of(case: Removal) -> list[tuple[float, float]]:
    """Squared error, and error of the logarithm of depth, of each frame."""
    scene = dlama.scene(case.frames).without(dict(enumerate(case.masks)))
    done, found = dlama.complete(scene, [frame.camera for frame in case.frames], filler="layered"), []
    for view, true, mask in zip(done.views, case.without, case.masks):
        if mask.sum() >= LEAST_PX[0]:
            grown = dilate_mask(mask, GROWN)
            known = grown & true.valid & view.valid
            error = float(np.square(view.color[grown].astype(float) - true.color[grown]).mean())
            found.append((error, float(np.abs(np.log(view.depth[known] / true.depth[known])).mean())))
    return found


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(FIRST), default="tune")
    parser.add_argument("-o", "--output", type=Path, help="errors of each scene as JSON")
    args = parser.parse_args(argv)
    errors: dict[str, list[list[tuple[float, float]]]] = {}
    streets = street_removals(args.split, args.shared) if args.shared.is_dir() else ()
    for case in chain(world_removals(args.split), stand_removals(args.split), streets):
        errors.setdefault(case.domain, []).append(errors_of(case))
    print("| domain | scenes | squared error | error of log depth |\n|---|---|---|---|")
    for domain, scenes in errors.items():
        squared, depth = np.nanmean([each for scene in scenes for each in scene], 0)
        print(f"| {domain} | {len(scenes)} | {squared:.0f} | {depth:.4f} |")
    if args.output:
        args.output.write_text(json.dumps(errors))


if __name__ == "__main__":
    main()
