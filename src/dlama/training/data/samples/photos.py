"""Photos in -> samples of planes rgb out: with random masks as holes (kind `photo`) or with the holes that a moved camera would
see (kind `warped-photo`); the photo is the truth.

Photos have no depth: networks of colour and depth learn from them as textures of worlds (kind `world`), whose depth is true.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.inpainters.networks.view_tensors import color_planes
from dlama.training.data.augment import change_light, mirror_at_random
from dlama.training.data.masks import random_mask
from dlama.training.data.photos import Photo, square_crop
from dlama.training.data.samples.views import hole_size_fits
from dlama.training.data.samples.world_views import WorldSet
from dlama.training.settings import NetworkSettings

SHARES = {"wide": 0.5, "medium": 0.3, "narrow": 0.2}
"""Probability of each set of masks."""
MOST_DRAWS = 8
"""Of holes of a fitting size; then a random mask is taken."""
BANK_WORLDS = 96
"""Worlds that holes are taken from, a dozen holes each. They are made at first use (0.4 s a world at 256 px, in each worker) and
kept (8 kB each): a worker makes 3 samples a second at first, 300 in the end."""

HoleMaker = Callable[[np.random.Generator, int], BoolArray]
"""Random numbers and a size -> a hole, size x size; picklable."""


class PhotoSamples:
    """Kind `photo`, see `sources.SampleSource`. InputError on networks with depth or two views."""

    def __init__(self, photos: tuple[Photo, ...], network: NetworkSettings, size: int) -> None:
        if network.views != 1 or network.has_depth:
            raise InputError(
                f"photos have no depth and no second view, planes {network.planes!r} cannot learn from them alone; "
                "give them with kind 'world' (or 'removal', 'stereo'), whose surfaces they are put on"
            )
        self.photos, self.network, self.size = photos, network, size

    def __len__(self) -> int:
        return len(self.photos)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """A random square of photo `index` under a random mask."""
        target = color_planes(square_crop(self.photos[index].load(), self.size, rng))
        mask = self.hole(rng)[None].astype(np.float32)
        made = {"input": np.concatenate([target * (1 - mask), mask]), "target": target, "mask": mask}
        return mirror_at_random(change_light(made, rng, 3), rng, 1)

    def hole(self, rng: np.random.Generator) -> BoolArray:
        """size x size, True = hole."""
        kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
        return random_mask(rng, (self.size, self.size), kind)


class WarpedPhotoSamples(PhotoSamples):
    """Kind `warped-photo`: the hole is what another camera does not see of a depth map, which is not the photo's."""

    def __init__(self, photos: tuple[Photo, ...], network: NetworkSettings, size: int, holes: HoleMaker) -> None:
        super().__init__(photos, network, size)
        self.holes = holes

    def hole(self, rng: np.random.Generator) -> BoolArray:
        """size x size, True = hole, of a fitting size."""
        for _ in range(MOST_DRAWS):
            hole = self.holes(rng, self.size)
            if hole_size_fits(hole):
                return hole
        return super().hole(rng)


def hole_of_world(rng: np.random.Generator, size: int, split: str) -> BoolArray:
    """size x size, True = hole: of a random pair of cameras in one of BANK_WORLDS worlds. Each process caches its holes."""
    bits = _holes_of_world(split, int(rng.integers(BANK_WORLDS)), size)
    return np.unpackbits(bits[int(rng.integers(len(bits)))], count=size * size).reshape(size, size).view(np.bool_)


@functools.lru_cache(maxsize=BANK_WORLDS)
def _holes_of_world(split: str, number: int, size: int) -> np.ndarray:
    """The holes between all pairs of cameras of one world, packed as bits: made together, since the world costs most."""
    world = WorldSet(split, size).views_of_world(number)
    holes = [unseen_by_camera(world.frame(i), world.cameras[j]) for i, j in world.pairs]
    return np.packbits(np.array(holes).reshape(len(holes), -1), axis=1)


def unseen_by_camera(rgbd: RGBD, camera: Camera) -> BoolArray:
    """H x W, True at the pixels of a frame that another camera does not see: the frame is rendered into it, and back."""
    there = render(rgbd, camera, types=False)
    return render(there, rgbd.camera, types=False).hole
