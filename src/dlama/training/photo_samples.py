"""Photos in -> samples of planes rgb out: under random masks (kind `photo`) or under holes that a moved camera would see
(kind `warped-photo`), while the photo stays the truth.

Photos have no depth: networks of colour and depth learn from them as textures of worlds (kind `world`), whose depth is true.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.inpainters.planes_of_views import color_planes
from dlama.training.augment import mirrored, relit
from dlama.training.masks import random_mask
from dlama.training.photos import Photo, square_crop
from dlama.training.settings import NetworkSettings

SHARES = {"wide": 0.5, "medium": 0.3, "narrow": 0.2}
"""How often each set of masks is drawn."""
MOST_DRAWS = 8

Move = Callable[[int, np.random.Generator], tuple[RGBD, Camera]]
"""Index and random numbers -> a frame whose depth counts, and a camera to go to; size x size both."""


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
        mask = self.hole(index, rng)[None].astype(np.float32)
        made = {"input": np.concatenate([target * (1 - mask), mask]), "target": target, "mask": mask}
        return mirrored(relit(made, rng, 3), rng, 1)

    def hole(self, index: int, rng: np.random.Generator) -> BoolArray:
        """size x size, True = hole."""
        kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
        return random_mask(rng, (self.size, self.size), kind)


class WarpedPhotoSamples(PhotoSamples):
    """Kind `warped-photo`: the hole is what a camera that moves there and back loses of some depth map."""

    def __init__(self, photos: tuple[Photo, ...], network: NetworkSettings, size: int, move: Move) -> None:
        super().__init__(photos, network, size)
        self.move = move

    def hole(self, index: int, rng: np.random.Generator) -> BoolArray:
        """As there_and_back; holes too small or too large are drawn again, then a random mask is taken."""
        from dlama.training.view_samples import fits

        for _ in range(MOST_DRAWS):
            lost = there_and_back(*self.move(index, rng))
            if fits(lost):
                return lost
        return super().hole(index, rng)


def there_and_back(rgbd: RGBD, camera: Camera) -> BoolArray:
    """H x W, True at the pixels of a frame that are not seen from another camera: rendered into it, and back."""
    there = render(rgbd, camera, types=False)
    return render(there, rgbd.camera, types=False).hole
