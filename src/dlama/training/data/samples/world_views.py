"""A sample's index in -> a procedural world, a few cameras in it and what they see, out.

Building a world and casting its rays are most of a sample's cost, so SAMPLES_PER_WORLD consecutive indices share a world, and the
last few worlds are cached. A loader that shuffles indices should shuffle whole groups of them.
"""

from __future__ import annotations

import functools
import itertools
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dlama.errors import InputError, format_size
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import dolly, move_sideways, orbit
from dlama.geometry.rgbd import RGBD, UInt8Array
from dlama.training.data.photos import read_photo, square_crop
from dlama.worlds.dataset import world
from dlama.worlds.world import Raycast, World

SAMPLES_PER_WORLD = 8
"""Of consecutive indices of the split `train`."""
VIEWS = 4
"""Cameras in a world."""
CACHED_WORLDS = 4
"""In each process: at 256 px 3 MB of views, and 10 MB of the world itself."""
WORLDS = 200_000
"""Different worlds of a split."""
FIRST_SEED = {"train": 1_000_000_000, "held_out": 2_000_000_000}
"""Seed of the first world of a split; the evaluation uses small seeds."""
TEXTURES = 10
"""Photos that are textures of one world."""
TEXTURE_PX = 256
"""Height and width of a texture."""
FOV_DEG = (60.0, 95.0)
LARGEST_YAW = 60.0
"""Degrees, either way; also the largest difference between the cameras of a pair."""
SMALLEST_TURN = 4.0
"""Degrees between the first camera and the others."""
PITCH_DEG = (-4.0, 12.0)
SHIFT_M = (0.05, 0.4)
DOLLY_M = (-0.5, 0.6)
"""Ranges of field of view and pitch (degrees), sideways shift and movement forwards (metres)."""


@dataclass(frozen=True, eq=False)
class WorldViews:
    """Some cameras in one world; what they see is cast at first use and kept."""

    world: World
    cameras: tuple[Camera, ...]
    pairs: tuple[tuple[int, int], ...]
    """Numbers of a source and a target camera, in random order."""
    _raycasts: dict[int, Raycast] = field(default_factory=dict)

    def raycast(self, number: int) -> Raycast:
        """Colour, depth and object numbers that camera `number` sees."""
        if number not in self._raycasts:
            self._raycasts[number] = self.world.raycast(self.cameras[number])
        return self._raycasts[number]

    def frame(self, number: int) -> RGBD:
        """The frame of camera `number`."""
        return self.raycast(number).frame(self.cameras[number])


@dataclass(frozen=True)
class WorldSet:
    """The worlds of one split, with or without photos as textures."""

    split: str
    """train or held_out."""
    size: int
    """Height and width of pictures in pixels."""
    photos: tuple[Path, ...] = field(default=(), compare=False)
    names: int = field(init=False)
    """Hash of the photos' names, by which sets are equal: several sources of one run share their worlds."""

    def __post_init__(self) -> None:
        names = "\n".join(photo.stem for photo in self.photos)
        object.__setattr__(self, "names", zlib.crc32(names.encode()))

    @property
    def group_size(self) -> int:
        """Number of consecutive indices that share a world; 1 for held-out ones."""
        return SAMPLES_PER_WORLD if self.split == "train" else 1

    def __len__(self) -> int:
        return WORLDS * self.group_size

    def views(self, index: int) -> WorldViews:
        """World and cameras for sample `index`; pairs are of a source and a target."""
        return _world_views(self, index // self.group_size)

    def stereo_views(self, index: int) -> WorldViews:
        """World and stereo cameras for sample `index`: cameras 2n and 2n + 1 are left and right, and pairs are of those."""
        return _world_views(self, index // self.group_size, paired=True)


@functools.lru_cache(maxsize=CACHED_WORLDS)
def _world_views(worlds: WorldSet, number: int, paired: bool = False) -> WorldViews:
    seed, size, photos = FIRST_SEED[worlds.split] + number, worlds.size, worlds.photos
    rng = np.random.default_rng([seed, VIEWS])
    drawn = rng.choice(len(photos), min(TEXTURES, len(photos)), replace=False) if photos else ()
    made = world(seed, textures=[_texture(photos[i], rng) for i in drawn])
    fov = float(rng.uniform(*FOV_DEG))
    yaws = _yaws(rng)
    if paired:
        lefts = [made.camera(yaw, size, fov) for yaw in yaws[: VIEWS // 2]]
        both = ((left, move_sideways(left, float(rng.uniform(*SHIFT_M)))) for left in lefts)
        return WorldViews(made, tuple(itertools.chain(*both)), tuple((n, n + 1) for n in range(0, VIEWS, 2)))
    cameras = _random_move(rng, [made.camera(yaw, size, fov) for yaw in yaws])
    pairs = [(i, j) for i, j in itertools.permutations(range(VIEWS), 2) if abs(yaws[i] - yaws[j]) <= LARGEST_YAW]
    rng.shuffle(pairs)
    return WorldViews(made, cameras, tuple((int(i), int(j)) for i, j in pairs))


def _yaws(rng: np.random.Generator) -> list[float]:
    """Yaws of the cameras in degrees; the last camera has the first one's, and is moved by `_random_move`."""
    first = float(rng.uniform(-LARGEST_YAW, LARGEST_YAW))
    turned = [float(rng.uniform(-LARGEST_YAW, LARGEST_YAW)) for _ in range(VIEWS - 2)]
    turned = [yaw if abs(yaw - first) > SMALLEST_TURN else first + SMALLEST_TURN for yaw in turned]
    return [first, *turned, first]


def _random_move(rng: np.random.Generator, cameras: list[Camera]) -> tuple[Camera, ...]:
    """The last camera moved sideways as in a stereo pair, forwards or back, or turned and pitched a little."""
    last, sign = cameras[-1], float(rng.choice((-1, 1)))
    moved = (
        move_sideways(last, sign * float(rng.uniform(*SHIFT_M))),
        dolly(last, float(rng.uniform(*DOLLY_M))),
        orbit(last, sign * float(rng.uniform(SMALLEST_TURN, 15)), float(rng.uniform(*PITCH_DEG))),
    )
    return (*cameras[:-1], moved[int(rng.integers(len(moved)))])


def _texture(photo: Path, rng: np.random.Generator) -> UInt8Array:
    picture = read_photo(photo)
    if min(picture.shape[:2]) < 16:
        raise InputError(f"{photo}: is {format_size(picture.shape)}; 16 pixels or more are expected")
    return square_crop(picture, TEXTURE_PX, rng)
