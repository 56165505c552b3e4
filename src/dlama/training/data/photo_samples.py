"""Photos in -> samples of planes rgb out: under random masks (kind `photo`) or under holes that a moved camera would see
(kind `warped-photo`), while the photo stays the truth.

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
from dlama.training.data.augment import mirrored, relit
from dlama.training.data.masks import random_mask
from dlama.training.data.photos import Photo, square_crop
from dlama.training.data.view_samples import fits
from dlama.training.settings import NetworkSettings

SHARES = {"wide": 0.5, "medium": 0.3, "narrow": 0.2}
"""How often each set of masks is drawn."""
MOST_DRAWS = 8
BANK_WORLDS = 96
"""Worlds that the shapes of holes are taken from, a dozen each. A world's shapes are made the first time (0.4 s at 256 px, in
each worker), then kept (8 kB each): a worker makes 3 samples a second at first, 300 in the end."""

Shapes = Callable[[np.random.Generator, int], BoolArray]
"""Random numbers and a size -> a hole, size x size; picklable."""


class PhotoSamples:
    """Kind `photo`, see `sources.SampleSource`. InputError on networks with depth or two views."""

    def __init__(self, photos: tuple[Photo, ...], network: NetworkSettings, size: int) -> None:
        if network.planes != "rgb":
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
        return mirrored(relit(made, rng, 3), rng, 1)

    def hole(self, rng: np.random.Generator) -> BoolArray:
        """size x size, True = hole."""
        kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
        return random_mask(rng, (self.size, self.size), kind)


class WarpedPhotoSamples(PhotoSamples):
    """Kind `warped-photo`: the hole is what a camera that moves there and back loses of some depth map."""

    def __init__(self, photos: tuple[Photo, ...], network: NetworkSettings, size: int, shapes: Shapes) -> None:
        super().__init__(photos, network, size)
        self.shapes = shapes

    def hole(self, rng: np.random.Generator) -> BoolArray:
        """A shape; next to nothing or everything is drawn again, then a random mask is taken."""
        for _ in range(MOST_DRAWS):
            lost = self.shapes(rng, self.size)
            if fits(lost):
                return lost
        return super().hole(rng)


def world_shapes(rng: np.random.Generator, size: int, split: str) -> BoolArray:
    """A shape from the depth of a world: one of BANK_WORLDS worlds' pairs of cameras. A process keeps what it has made."""
    bits = _bank(split, int(rng.integers(BANK_WORLDS)), size)
    return np.unpackbits(bits[int(rng.integers(len(bits)))], count=size * size).reshape(size, size).view(np.bool_)


@functools.lru_cache(maxsize=BANK_WORLDS)
def _bank(split: str, number: int, size: int) -> np.ndarray:
    """What is lost between any two cameras of one world, as bits: made together, since the world costs most."""
    from dlama.training.data.world_views import Galleries

    gallery = Galleries(split, size).single(number)
    lost = [there_and_back(gallery.frame(i), gallery.cameras[j]) for i, j in gallery.pairs]
    return np.packbits(np.array(lost).reshape(len(lost), -1), axis=1)


def there_and_back(rgbd: RGBD, camera: Camera) -> BoolArray:
    """H x W, True at the pixels of a frame that are not seen from another camera: rendered into it, and back."""
    there = render(rgbd, camera, types=False)
    return render(there, rgbd.camera, types=False).hole
