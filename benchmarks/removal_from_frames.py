"""Objects removed from five frames of a scene, or from a stereo pair: errors of colour and depth behind them, by domain.

    python benchmarks/removal_from_frames.py ../shared --split tune
    python benchmarks/removal_from_frames.py ../shared --split validate -o removal.json
    python benchmarks/removal_from_frames.py ../shared --split tune --poses drifted
    python benchmarks/removal_from_frames.py ../shared --split tune --pairs

Procedural worlds with an object on the ground (`world`), with one that stands on a table, a plinth or an island (`stand`), and
streets, in exact depth, a Kinect's, and a LIDAR's made dense. Masks hold the shadow, too (not on streets). All frames are
completed with `layered`. Printed by domain, in the masks grown by GROWN px: mean squared error, and the mean error of the
logarithm of depth. Six minutes on one core. `--poses drifted`: poses that are off by DRIFT, as those of hand-held cameras are;
`corrected`: by `align_frames`.

Pairs (--pairs) are noisy pictures that are matched, with the left mask alone; whole, and cut so that the left picture's border
hides CUT of the object. Printed, too: the IoU of the mask carried to the right picture with the true one, both grown, and the
share of the object that is left there. Eight minutes.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

import dlama
from carried_masks import streets_with_objects
from click_worlds import ClickWorld, objects_in_sight
from clicks import FIRST, HELD_OUT, STREETS
from dlama.datasets.frames import StereoTruth
from dlama.datasets.layouts import open_dataset
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.frames.alignment import with_pose
from dlama.geometry.holes import dilate_mask, iou
from dlama.geometry.motion.trajectories import move_sideways
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View
from dlama.worlds.dataset import world
from dlama.worlds.world import BASELINE_M, FOV_DEG, World
from sensors import add_photo_noise
from world_cases import as_seen

YAWS, SIZE, SENSORS, GROWN = (0, -20, 20, -45, 45), 256, ("exact", "kinect", "lidar"), 3
WORLDS, STANDS, SEEDS, STAND_SEEDS = 16, 18, {"tune": 5000, "validate": 5100}, 700
SHARES, FARTHEST_M, MOST_OBJECTS = (0.006, 0.12), 6.0, 2
DRIFT = 0.01, 0.3
"""Metres and degrees, standard deviations of each axis; the first frame has none."""
CHANGED = 12
"""Levels by which a pixel changes with the object, its shadow then."""
LEAST_PX = 50, 400
"""Of a mask that counts, and of the object of a world in the first frame."""
PAIR_SIZE, CUT, NARROWEST = 512, 0.4, 200
"""Of pictures of a pair, px; share of an object's columns that is cut off; px of a cut picture."""


class Removal(NamedTuple):
    """A scene, and the same without an object."""

    domain: str
    frames: list[RGBD]
    """Of a pair its left and right picture; its depth is not used."""
    masks: list[BoolArray]
    without: list[RGBD]


def as_sensors(
    kind: str, number: int, frames: list[RGBD], masks: list[BoolArray], without: list[RGBD]
) -> Iterator[Removal]:
    """As each sensor sees it; none where a frame does not show the object."""
    for sensor in SENSORS if all(mask.any() for mask in masks) else ():
        seen = [as_seen(frame, sensor, np.random.default_rng([number, k])) for k, frame in enumerate(frames)]
        yield Removal(f"{kind} {sensor}", [dlama.densify(frame) for frame in seen], masks, without)


def as_pair(
    kind: str, number: int, frames: list[RGBD], masks: list[BoolArray], without: list[RGBD]
) -> Iterator[Removal]:
    """Noisy pictures of a pair, whole and cut; none where they show too little of the object."""
    if min(mask.sum() for mask in masks) < LEAST_PX[1]:
        return
    rng = np.random.default_rng([number, 31])
    seen = [dataclasses.replace(frame, color=add_photo_noise(frame.color, rng)) for frame in frames]
    yield Removal(f"{kind} whole", seen, masks, without)
    columns = np.flatnonzero(masks[0].any(0))
    width = int(columns[-1] + 1 - CUT * (columns[-1] + 1 - columns[0]))
    parts = [mask[:, :width] for mask in masks]
    if width >= NARROWEST and min(part.sum() for part in parts) >= LEAST_PX[1]:
        cut = ([cut_off(frame, width) for frame in each] for each in (seen, without))
        yield Removal(f"{kind} cut", next(cut), parts, next(cut))


def cut_off(frame: RGBD, width: int) -> RGBD:
    """The first columns of a frame."""
    camera = dataclasses.replace(frame.camera, width=width)
    return RGBD(frame.color[:, :width].copy(), frame.depth[:, :width].copy(), camera)


def orbit_cameras(made: World, fov: float) -> list[Camera]:
    """Of five frames."""
    return [made.camera(yaw, SIZE, fov) for yaw in YAWS]


def pair_cameras(made: World, fov: float) -> list[Camera]:
    """Left and right."""
    left = made.camera(0, PAIR_SIZE, fov)
    return [left, move_sideways(left, BASELINE_M)]


def world_removals(split: str, pairs: bool) -> Iterator[Removal]:
    """Worlds without their object."""
    for number in range(SEEDS[split], SEEDS[split] + WORLDS):
        made = world(number)
        cameras = pair_cameras(made, FOV_DEG) if pairs else orbit_cameras(made, FOV_DEG)
        seen = [(made.raycast(camera), made.raycast(camera, object=False)) for camera in cameras]
        masks = [(full.group == made.object_index) | made.shadow_of(full, empty) for full, empty in seen]
        if masks[0].sum() >= LEAST_PX[1]:
            frames = [[made.frame(camera, object=there) for camera in cameras] for there in (True, False)]
            yield from (as_pair if pairs else as_sensors)("world", number, frames[0], masks, frames[1])


def stand_removals(split: str, pairs: bool) -> Iterator[Removal]:
    """Worlds without an object that stands on another one; of pairs, without any object of such a world."""
    for number in range(FIRST[split], FIRST[split] + STANDS):
        made = ClickWorld(HELD_OUT + number + STAND_SEEDS, stands=True)
        cameras = pair_cameras(made.world, 75) if pairs else orbit_cameras(made.world, 75)
        scenes = [made.scene(camera) for camera in cameras]
        depth = scenes[0].frame.depth
        seen = [n for n in objects_in_sight(scenes[0], *SHARES) if pairs or n in made.stands_on]
        for n in [each for each in seen if np.median(depth[scenes[0].mask(each)]) < FARTHEST_M][:MOST_OBJECTS]:
            empty = dataclasses.replace(made.world, object_index=n)
            without = [empty.frame(camera, object=False) for camera in cameras]
            changed = [np.abs(a.frame.color.astype(int) - b.color).max(-1) > CHANGED for a, b in zip(scenes, without)]
            masks = [one.mask(n) | more for one, more in zip(scenes, changed)]
            yield from (as_pair if pairs else as_sensors)(
                "stand", number, [one.frame for one in scenes], masks, without
            )


def street_pairs(split: str, shared: Path) -> Iterator[Removal]:
    """Pairs of streets without their object."""
    cases = open_dataset(shared / "street").cases
    for pair in (case.load() for case in cases if case.protocol == "sii" and case.scene in STREETS[split]):
        assert isinstance(pair, StereoTruth)
        masks, without = (pair.mask_left, pair.mask_right), (pair.without_left, pair.without_right)
        frames = [
            dataclasses.replace(frame, color=color) for frame, color in zip(without, (pair.left, pair.right)) if frame
        ]
        yield from as_pair(
            "street", 5, frames, [one for one in masks if one is not None], [one for one in without if one]
        )


def street_removals(split: str, shared: Path) -> Iterator[Removal]:
    """Streets without their object."""
    for _, truths in streets_with_objects(split, shared):
        parts = ([getattr(one, name) for one in truths] for name in ("source", "mask", "without"))
        yield from as_sensors("street", 5, *parts)


def with_poses(frames: list[RGBD], poses: str, rng: np.random.Generator) -> list[RGBD]:
    """The frames with true, drifted or corrected poses."""
    if poses == "true":
        return frames
    drifted = frames[:1]
    for frame in frames[1:]:
        pose = frame.camera.world_from_cam.copy()
        pose[:3, :3] @= cv2.Rodrigues(rng.normal(0, np.radians(DRIFT[1]), 3))[0]
        pose[:3, 3] += rng.normal(0, DRIFT[0], 3)
        drifted.append(with_pose(frame, pose))
    return dlama.align_frames(drifted) if poses == "corrected" else drifted


def errors_of(case: Removal) -> list[tuple[float, ...]]:
    """Squared error, and error of the logarithm of depth, of each frame."""
    scene = dlama.scene(case.frames).without(dict(enumerate(case.masks)))
    done = dlama.complete(scene, [frame.camera for frame in case.frames], filler="layered")
    seen = zip(done.views, case.without, case.masks)
    return [errors_behind(view, true, mask) for view, true, mask in seen if mask.sum() >= LEAST_PX[0]]


def errors_of_pair(case: Removal) -> list[tuple[float, ...]]:
    """The same, and of the carried mask its IoU and the share of the object that is left over (NaN, left)."""
    left, right = case.frames
    rig = StereoRig(left.camera, right.camera)
    done = dlama.stereo(left.color, right.color, rig, mask=case.masks[0], filler="layered")
    errors = [errors_behind(*each) for each in zip(done.views, case.without, case.masks)]
    carried, true = done.warped[1].object_hole, case.masks[1]
    of_mask = iou(carried, dilate_mask(true, GROWN)), float((true & ~carried).sum() / true.sum())
    return [(*errors[0], np.nan, np.nan), (*errors[1], *of_mask)]


def errors_behind(view: View, true: RGBD, mask: BoolArray) -> tuple[float, float]:
    """Squared error, and error of the logarithm of depth, in the grown mask."""
    grown = dilate_mask(mask, GROWN)
    known = grown & true.valid & view.valid
    error = float(np.square(view.color[grown].astype(float) - true.color[grown]).mean())
    return error, float(np.abs(np.log(view.depth[known] / true.depth[known])).mean())


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(FIRST), default="tune")
    parser.add_argument("--pairs", action="store_true", help="of stereo pairs")
    parser.add_argument("--poses", choices=("true", "drifted", "corrected"), default="true")
    parser.add_argument("-o", "--output", type=Path, help="errors of each scene as JSON")
    args = parser.parse_args(argv)
    errors: dict[str, list[list[tuple[float, ...]]]] = {}
    of_streets, measure = (street_pairs, errors_of_pair) if args.pairs else (street_removals, errors_of)
    streets = of_streets(args.split, args.shared) if args.shared.is_dir() else ()
    cases = chain(world_removals(args.split, args.pairs), stand_removals(args.split, args.pairs), streets)
    for number, case in enumerate(cases):
        frames = with_poses(case.frames, args.poses, np.random.default_rng(number))
        errors.setdefault(case.domain, []).append(measure(case._replace(frames=frames)))
    of_mask = ("IoU of the right mask", "left over") if args.pairs else ()
    names = "domain", "scenes", "squared error", "error of log depth", *of_mask
    print(f"| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for domain, scenes in errors.items():
        squared, *others = np.nanmean([each for scene in scenes for each in scene], 0)
        print(f"| {domain} | {len(scenes)} | {squared:.0f} | {' | '.join(f'{value:.4f}' for value in others)} |")
    if args.output:
        args.output.write_text(json.dumps(errors))


if __name__ == "__main__":
    main()
