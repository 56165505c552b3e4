"""Posed RGB-D frames in; cases out that go from one frame to another which turned away by 10 to 60 degrees."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain, islice
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Case, Dataset, ViewTruth
from dlama.datasets.posed.posed_frames import PosedFrame
from dlama.errors import FileError, InputError, format_count
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.motion.poses import rotation_deg, transform_points
from dlama.geometry.projection import project, rays
from dlama.geometry.rgbd import RGBD, Float32Array
from dlama.perception.missing_depth import repeat_readings

DEGREES = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Rotations that pairs are looked for at: the paper's yaws."""
DEGREES_OFF = 3.0
"""A pair may turn by so much less or more."""
SOURCES = 20
"""How many source frames a scene has by default."""
MIN_OVERLAP = 0.1
"""Share of the source's pixels that must land in the target within LANDS_WITHIN of its depth (kitchen_vpi's least: 0.10)."""
LANDS_WITHIN = 0.05
TRIED = 6
"""Candidates per source and angle whose depth is looked at."""
EVERY_PIXEL = 8
"""Overlap is measured on every eighth row and column."""


class NoPairsError(FileError):
    """No case can be made of the frames of a data set; it has that, and whether any two turn as those of a case do, for a
    diagnosis."""

    def __init__(self, message: str, dataset: Dataset, turned: bool = False) -> None:
        super().__init__(message)
        self.dataset = dataset
        self.turned = turned


def load_view(source: Callable[[], RGBD], target: Callable[[], RGBD]) -> ViewTruth:
    """Read both frames of a pair."""
    return ViewTruth(source(), target(), exposure_varies=True)


def posed_dataset(layout: str, root: Path, frames: Iterable[PosedFrame], limit: int | None = None) -> Dataset:
    """A data set of posed frames (scene after scene) with the cases of `view_pairs`; raises FileError if none is found, and
    where two frames of a scene have one name.

    limit: so many cases at most; 0: no pairs are looked for, the frames alone are expected.
    """
    frames, name = tuple(frames), root.resolve().name
    for (scene, called), count in Counter((frame.scene, frame.name) for frame in frames).items():
        if count > 1:  # frames of a scene are distinguished by their names alone
            raise FileError(
                f"{root}: two frames have pictures called {called} (scene {scene}); different names are expected"
            )
    scenes: dict[str, list[PosedFrame]] = {}
    for frame in frames:
        scenes.setdefault(frame.scene, []).append(frame)
    cases = tuple(islice(chain.from_iterable(view_pairs(own, name) for own in scenes.values()), limit))
    found = Dataset(name, layout, root, frames, cases)
    if not cases and limit != 0:
        raise _no_pairs(found, scenes.values())
    return found


def _no_pairs(dataset: Dataset, scenes: Iterable[list[PosedFrame]]) -> NoPairsError:
    """Why no case can be made of the frames."""
    root, count = dataset.root, len(dataset.frames)
    if count < 2:
        held = format_count(count, "frame")
        return NoPairsError(f"{root}: holds {held}; two or more of one scene are expected", dataset)
    turned = any(_turns(frame, own) for own in scenes for frame in own)
    of_those = f"overlap by {MIN_OVERLAP:.0%} and turn" if turned else "turn"
    unit = "; are depth and poses in the same unit?" if turned else ", as those of a case do"
    degrees = f"{DEGREES[0]:g} to {DEGREES[-1]:g} degrees"
    return NoPairsError(f"{root}: no two of its {count} frames {of_those} by {degrees}{unit}", dataset, turned)


def view_pairs(frames: Sequence[PosedFrame], dataset: str) -> Iterator[Case]:
    """VPI cases between frames of one scene: of SOURCES frames, evenly, to frames that turned away by about each of DEGREES.

    Of the frames within DEGREES_OFF of an angle the nearest to it with enough overlap is taken (of frames in a row the best is
    tried), each target once per source. Overlap is the share of the source's pixels that land in the target within 5 % of its
    depth: depth files of candidates are read for it, as cases are asked for. `yaw` is the angle of rotation. Deterministic.
    """
    overlaps = Overlaps(frames)
    rotations = np.stack([frame.world_from_cam[:3, :3] for frame in frames])
    for source in range(0, len(frames), math.ceil(len(frames) / SOURCES)):
        for target in _targets(source, rotations, overlaps):
            yield pair_case(dataset, frames[source], frames[target])


class Overlaps:
    """How much of one frame lies in another; each depth file is read once, and kept small."""

    def __init__(self, frames: Sequence[PosedFrame]) -> None:
        self._frames = frames
        self._seen: dict[int, tuple[Float64Array, Float32Array, Camera] | None] = {}
        self._error: InputError | None = None

    def share(self, source: int, target: int) -> float:
        """Share (0..1) of the source's pixels, holes included, that land in the target within 5 % of its depth.

        1 where one of them cannot be read: the pair is listed, so that loading it reports the bad file. Raises the
        reason when not a single frame can be read.
        """
        one, other = self._of(source), self._of(target)
        if self._error is not None and not any(self._seen.values()):
            raise self._error
        if one is None or other is None:
            return 1.0
        points, every_pixel, _ = one
        _, depth, camera = other
        pixels, z = project(points, camera)
        x, y = pixels[:, 0] / camera.width * depth.shape[1], pixels[:, 1] / camera.height * depth.shape[0]
        inside = (x >= 0) & (x < depth.shape[1]) & (y >= 0) & (y < depth.shape[0])
        there = depth[y[inside].astype(np.intp), x[inside].astype(np.intp)]
        return float((np.abs(there - z[inside]) <= LANDS_WITHIN * there).sum() / every_pixel.size)

    def _of(self, number: int) -> tuple[Float64Array, Float32Array, Camera] | None:
        if number not in self._seen:
            try:
                self._seen[number] = _sample(*self._frames[number].load_depth())
            except InputError as error:
                self._seen[number], self._error = None, self._error or error
        return self._seen[number]


def _sample(depth: Float32Array, camera: Camera) -> tuple[Float64Array, Float32Array, Camera]:
    """World points of every eighth pixel, the same pixels' depth (0 = none), and the whole picture's camera."""
    rows, columns = (np.arange(min(EVERY_PIXEL, n) // 2, n, EVERY_PIXEL) for n in depth.shape)
    small = repeat_readings(depth)[rows[:, None], columns]
    small[~np.isfinite(small)] = 0
    local = (rays(camera)[rows[:, None], columns] * small[..., None])[small > 0]
    return transform_points(camera.world_from_cam, local), small, camera


def _turns(source: PosedFrame, frames: Sequence[PosedFrame]) -> bool:
    """Whether one of the frames turned away from the source as the target of a case does."""
    rotations = np.stack([frame.world_from_cam[:3, :3] for frame in frames])
    angles = rotation_deg(rotations, source.world_from_cam[:3, :3])
    return bool(((angles >= DEGREES[0] - DEGREES_OFF) & (angles <= DEGREES[-1] + DEGREES_OFF)).any())


def _targets(source: int, rotations: Float64Array, overlaps: Overlaps) -> Iterator[int]:
    angles = rotation_deg(rotations, rotations[source])
    used = [source]
    for angle in DEGREES:
        for target in _candidates(np.abs(angles - angle), used):
            if overlaps.share(source, target) >= MIN_OVERLAP:
                used.append(target)
                yield target
                break


def _candidates(off: Float64Array, used: list[int]) -> list[int]:
    """Frames at most DEGREES_OFF from the requested angle, nearest first; of neighbours in a row, which see much the same,
    only the best."""
    near = off <= DEGREES_OFF
    near[used] = False
    places = np.nonzero(near)[0]
    rows = np.split(places, np.nonzero(np.diff(places) > 1)[0] + 1) if len(places) else []
    best = [int(row[np.argmin(off[row])]) for row in rows]
    return sorted(best, key=lambda place: float(off[place]))[:TRIED]


def pair_case(dataset: str, source: PosedFrame, target: PosedFrame) -> Case:
    """The VPI case from one frame to another; `yaw` is the angle of rotation between them, about any axis."""
    turned = rotation_deg(source.world_from_cam[None, :3, :3], target.world_from_cam[:3, :3])
    load = partial(load_view, source.load, target.load)
    return Case("vpi", dataset, source.scene, f"{source.name}_to_{target.name}", load, round(float(turned[0]), 3))
