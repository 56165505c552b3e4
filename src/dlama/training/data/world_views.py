"""A world's seed in -> a few cameras in it, their frames, and which pairs of them are worth a question, out.

Building a world and casting its rays cost most of a sample, so a world is used for RUN samples: indices n RUN ... n RUN + RUN - 1
belong to world n, and the last few galleries are kept. Whoever shuffles indices does best to shuffle whole runs.
"""

from __future__ import annotations

import functools
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, UInt8Array
from dlama.geometry.trajectories import dolly, orbit
from dlama.training.data.photos import Photo

RUN = 8
"""Samples of one world, where indices follow each other."""
VIEWS = 4
KEPT = 4
"""Galleries in memory: at 256 px 3 MB and the world's 10."""
WORLDS = 200_000
FIRST_SEED = {"train": 1_000_000_000, "held_out": 2_000_000_000}
"""Worlds of the evaluation have small seeds."""
TEXTURES = 10
"""Photos that one world is given."""
TEXTURE_PX = 256
FOV_DEG = (60.0, 95.0)
LARGEST_YAW = 60.0
SMALLEST_TURN = 4.0
PITCH_DEG = (-4.0, 12.0)
SHIFT_M = (0.05, 0.4)
DOLLY_M = (-0.5, 0.6)


@dataclass(frozen=True, eq=False)
class Gallery:
    """Some cameras in one world; what they see is cast when it is asked for, and kept."""

    world: Any
    """`dlama.worlds.world.World`."""
    cameras: tuple[Camera, ...]
    pairs: tuple[tuple[int, int], ...]
    """Numbers of a source and a target camera, in random order."""
    _seen: dict[int, Any] = field(default_factory=dict)

    def seen(self, number: int) -> Any:
        """All that camera `number` sees: `dlama.worlds.world.Raycast`."""
        if number not in self._seen:
            self._seen[number] = self.world.raycast(self.cameras[number])
        return self._seen[number]

    def frame(self, number: int) -> RGBD:
        """What camera `number` takes."""
        cast = self.seen(number)
        return RGBD(cast.color, cast.depth, self.cameras[number])


@dataclass(frozen=True, eq=False)
class Galleries:
    """The worlds of one split, with or without photos on their surfaces; indices in, galleries out."""

    split: str
    size: int
    photos: tuple[Photo, ...] = ()
    key: tuple[str, int, int] = field(init=False)
    """Tells galleries apart, so that several sources of one run share what is kept."""

    def __post_init__(self) -> None:
        names = "\n".join(photo.name for photo in self.photos)
        object.__setattr__(self, "key", (self.split, self.size, zlib.crc32(names.encode())))

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Galleries) and self.key == other.key

    @property
    def run(self) -> int:
        """Samples that share a world when indices follow each other; held-out ones never do."""
        return RUN if self.split == "train" else 1

    def __len__(self) -> int:
        return WORLDS * self.run

    def gallery(self, index: int) -> Gallery:
        """The gallery of a sample's index."""
        return _gallery(self, index // self.run)

    def single(self, number: int) -> Gallery:
        """The gallery of world `number`, whatever the run."""
        return _gallery(self, number)

    def rig(self, index: int) -> Gallery:
        """A gallery of stereo pairs: cameras 2n and 2n + 1 are left and right."""
        return _gallery(self, index // self.run, paired=True)


@functools.lru_cache(maxsize=KEPT)
def _gallery(galleries: Galleries, number: int, paired: bool = False) -> Gallery:
    from dlama.worlds.dataset import world

    seed, size, photos = FIRST_SEED[galleries.split] + number, galleries.size, galleries.photos
    rng = np.random.default_rng([seed, VIEWS])
    made = world(seed, textures=[_texture(photos[i], rng) for i in _some(rng, len(photos))])
    fov = float(rng.uniform(*FOV_DEG))
    yaws = _yaws(rng)
    if paired:
        cameras = _rigs(rng, [made.camera(yaw, size, fov) for yaw in yaws[: VIEWS // 2]])
        return Gallery(made, cameras, tuple((n, n + 1) for n in range(0, len(cameras), 2)))
    cameras = _moved(rng, [made.camera(yaw, size, fov) for yaw in yaws])
    pairs = [(i, j) for i in range(VIEWS) for j in range(VIEWS) if i != j and abs(yaws[i] - yaws[j]) <= LARGEST_YAW]
    rng.shuffle(pairs)
    return Gallery(made, cameras, tuple((int(i), int(j)) for i, j in pairs))


def _yaws(rng: np.random.Generator) -> list[float]:
    """Anywhere on the orbit; the last camera stands where the first one does (and is moved by other means)."""
    first = float(rng.uniform(-LARGEST_YAW, LARGEST_YAW))
    turned = [float(rng.uniform(-LARGEST_YAW, LARGEST_YAW)) for _ in range(VIEWS - 2)]
    turned = [yaw if abs(yaw - first) > SMALLEST_TURN else first + SMALLEST_TURN for yaw in turned]
    return [first, *turned, first]


def _moved(rng: np.random.Generator, cameras: list[Camera]) -> tuple[Camera, ...]:
    """The last one moved: beside the first as in a stereo pair, dollied, or turned and pitched a little."""
    last, sign = cameras[-1], float(rng.choice((-1, 1)))
    moved = (
        beside(last, sign * float(rng.uniform(*SHIFT_M))),
        dolly(last, float(rng.uniform(*DOLLY_M))),
        orbit(last, sign * float(rng.uniform(SMALLEST_TURN, 15)), float(rng.uniform(*PITCH_DEG))),
    )
    return (*cameras[:-1], moved[int(rng.integers(len(moved)))])


def _rigs(rng: np.random.Generator, cameras: list[Camera]) -> tuple[Camera, ...]:
    """Each camera as a left one, and a right one beside it."""
    return tuple(each for left in cameras for each in (left, beside(left, float(rng.uniform(*SHIFT_M)))))


def beside(camera: Camera, metres: float) -> Camera:
    """The camera moved to its right (negative: left)."""
    pose = camera.world_from_cam.copy()
    pose[:3, 3] += metres * pose[:3, 0]
    return camera.at(pose)


def _some(rng: np.random.Generator, count: int) -> list[int]:
    return [int(i) for i in rng.choice(count, min(TEXTURES, count), replace=False)] if count else []


def _texture(photo: Photo, rng: np.random.Generator) -> UInt8Array:
    from dlama.training.data.photos import square_crop

    picture = photo.load()
    if min(picture.shape[:2]) < 16:
        raise InputError(f"photo {photo.name} is {picture.shape[1]}x{picture.shape[0]}; 16 pixels or more are wanted")
    return square_crop(picture, TEXTURE_PX, rng)
