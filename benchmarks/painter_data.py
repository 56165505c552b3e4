"""Packs of `painter_crops` in; batches on any device, varied in light, zoom and side, and what is held out, out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

SIDE, LARGE_SIDE = 256, 384
"""Pixels of a crop. Views are of the first size alone."""
SQUARES = {SIDE: 5, LARGE_SIDE: 4}
"""Squares that are cut of a photo of twice that size; of smaller ones fewer."""
LARGE, LARGE_SHARE = 0.25, 0.375
"""Share of batches of large crops, and their size, in batches of small ones."""
OF_VIEWS, OF_WORLDS, LARGE_WORLDS = 0.42, 0.14, 0.33
"""Shares of a batch, of small and of large crops; the rest are photos."""
ZOOMED, ZOOM = 0.5, 0.7
"""Share of crops that are enlarged, and the smallest part of one that is."""
BRIGHTER, TINTED, GAMMA, PERMUTED = (0.75, 1.2), (0.93, 1.07), 0.25, 0.15
"""Factors on all channels and on each, spread of log gamma, share of crops whose channels change places."""
WORLD_GROWTH = 3, 12
"""Sides in pixels, the last one excluded, of squares that masks of worlds are dilated by."""
WHOLE = 0.4
"""Share of worlds that are made smaller rather than cut."""
GUIDES = 6
"""Planes besides colour and mask: colours of the continued surfaces, their nearness, the open and the out-of-view share."""
UNGUIDED = 0.15
"""Share of views that the network sees without guides."""
LEAST_OPEN = 0.02
"""Open share of a pixel from which it counts, and has a guide."""


class Batch(NamedTuple):
    """B crops; values in 0..1."""

    color: Tensor
    """B x 3 x S x S RGB; what it shows in the hole counts for nothing."""
    truth: Tensor
    """The same as it is without what the hole hides."""
    hole: Tensor
    """B x 1 x S x S, 1 = painted."""
    counted: Tensor
    """B x 1 x S x S, 1 = the part of the hole whose truth is known: not what is hidden from the painter only."""
    guides: Tensor
    """B x GUIDES x S x S, 0 where there are none."""


def read_pack(path: Path) -> list[dict[str, bytes]]:
    """The compressed pictures of each crop of a file of `painter_crops.write_pack`."""
    with np.load(path) as stored:
        data, ends, names = stored["data"].tobytes(), stored["ends"], [str(name) for name in stored["names"]]
    crops: dict[str, dict[str, bytes]] = {}
    for name, start, end in zip(names, ends[:-1], ends[1:]):
        number, _, plane = name.partition("/")
        crops.setdefault(number, {})[plane] = data[start:end]
    return list(crops.values())


def decoded(blob: bytes) -> np.ndarray:
    """A compressed picture, its channels in the order that they were stored in."""
    return cv2.imdecode(np.frombuffer(blob, np.uint8), cv2.IMREAD_UNCHANGED)


def squares_of(photo: np.ndarray, side: int) -> list[np.ndarray]:
    """Squares of a photo (H x W x 3), side x side: the whole shorter side first, then smaller parts."""
    least, rng = min(photo.shape[:2]), np.random.default_rng(photo.shape[0] + int(photo[:4].sum()))
    found = []
    for number in range(1 + min(SQUARES[side] - 1, max(0, SQUARES[side] * (least - side) // side))):
        cut = least if number == 0 else int(rng.integers(side, least + 1))
        top, left = (int(rng.integers(0, length - cut + 1)) for length in photo.shape[:2])
        square = photo[top : top + cut, left : left + cut]
        how = cv2.INTER_AREA if cut > side else cv2.INTER_CUBIC
        found.append(square if cut == side else cv2.resize(square, (side, side), interpolation=how))
    return found


class Crops:
    """The packs of a folder, one split, on a device, as 8-bit tensors."""

    def __init__(self, folder: Path, device: torch.device) -> None:
        self.device = device
        with ThreadPoolExecutor() as pool:
            photos = list(pool.map(_photo, read_pack(folder / "photos.npz")))
            self.photos = {
                side: self._on_device([one for photo in photos for one in squares_of(photo, side)])
                for side in (SIDE, LARGE_SIDE)
            }
            views = [one for file in sorted(folder.glob("views*.npz")) for one in read_pack(file)]
            self.views = self._planes(pool, views)
            self.worlds = self._planes(pool, read_pack(folder / "worlds.npz"))
        with np.load(folder / "holes.npz") as stored:
            self.holes = {int(name): self._on_device(np.unpackbits(stored[name], axis=2)) for name in stored.files}

    def _planes(self, pool: ThreadPoolExecutor, crops: Sequence[dict[str, bytes]]) -> dict[str, Tensor]:
        rows = list(pool.map(lambda crop: {name: decoded(blob) for name, blob in crop.items()}, crops))
        return {name: self._on_device([row[name] for row in rows]) for name in rows[0]}

    def _on_device(self, planes: Sequence[np.ndarray] | np.ndarray) -> Tensor:
        stacked = torch.from_numpy(np.ascontiguousarray(np.stack(list(planes))))
        stacked = stacked[..., None] if stacked.ndim == 3 else stacked
        return stacked.permute(0, 3, 1, 2).contiguous().to(self.device)

    def draw(self, count: int, rng: np.random.Generator) -> Batch:
        """`count` small crops, or fewer large ones, of all kinds, varied."""
        side = LARGE_SIDE if rng.random() < LARGE else SIDE
        if side == LARGE_SIDE:
            count = max(2, round(LARGE_SHARE * count))
            worlds, views = max(1, round(LARGE_WORLDS * count)), 0
        else:
            worlds, views = (max(1, round(share * count)) for share in (OF_WORLDS, OF_VIEWS))
        parts = [self.some_photos(max(1, count - worlds - views), side, rng), self.some_worlds(worlds, side, rng)]
        if views:
            parts.append(self.some_views(views, rng))
        return Batch(*(torch.cat(planes) for planes in zip(*parts)))

    def some_photos(self, count: int, side: int, rng: np.random.Generator) -> Batch:
        """Photos with holes."""
        (truth,) = vary_light([zoomed(self._some(self.photos[side], count, rng), rng)], rng)
        hole = self._some(self.holes[side], count, rng)
        return Batch(truth, truth, hole, hole, truth.new_zeros(count, GUIDES, side, side))

    def some_worlds(self, count: int, side: int, rng: np.random.Generator) -> Batch:
        """Worlds with the object removed, the mask dilated."""
        at = self._places(self.worlds["color"], count, rng)
        planes = torch.cat([unit(self.worlds[name][at]) for name in ("color", "truth", "mask")], 1)
        if planes.shape[-1] > side and rng.random() < WHOLE:
            planes = functional.interpolate(planes, (side, side), mode="area")
        top, left = rng.integers(0, planes.shape[-1] - side + 1, 2)
        planes = zoomed(planes[..., top : top + side, left : left + side], rng)
        color, truth = vary_light([planes[:, :3], planes[:, 3:6]], rng)
        hole = dilated(planes[:, 6:] > 0.5, int(rng.integers(*WORLD_GROWTH)))
        return Batch(color, truth, hole, hole, hole.new_zeros(count, GUIDES, side, side))

    def some_views(self, count: int, rng: np.random.Generator) -> Batch:
        """Views with their guides, some without."""
        at = self._places(self.views["color"], count, rng)
        planes = zoomed(stacked_view(self.views, at), rng)
        lit = vary_light([planes[:, :3], planes[:, 3:6], planes[:, 6:9]], rng)
        batch = view_batch(torch.cat([*lit, planes[:, 9:]], 1))
        guided = torch.from_numpy((rng.random((count, 1, 1, 1)) >= UNGUIDED).astype(np.float32)).to(self.device)
        return batch._replace(guides=batch.guides * guided)

    def whole(self, kind: str, at_once: int) -> Iterator[Batch]:
        """All crops of a kind (photos, large photos, worlds, views), unvaried; of photos those that have a hole."""
        if kind == "views":
            for at in torch.arange(len(self.views["color"])).split(at_once):
                yield view_batch(stacked_view(self.views, at.to(self.device)))
            return
        side = SIDE if kind == "photos" else LARGE_SIDE
        if kind == "worlds":
            truth, color, hole = self.worlds["truth"], self.worlds["color"], dilated(self.worlds["mask"] > 127, 7)
        else:
            hole = self.holes[side].float()
            truth = color = self.photos[side][: len(hole)]
        for at in torch.arange(min(len(truth), len(hole))).split(at_once):
            there = hole[at]
            yield Batch(
                unit(color[at]), unit(truth[at]), there, there, there.new_zeros(len(at), GUIDES, *there.shape[2:])
            )

    def _places(self, planes: Tensor, count: int, rng: np.random.Generator) -> Tensor:
        return torch.from_numpy(rng.integers(0, len(planes), count)).to(self.device)

    def _some(self, planes: Tensor, count: int, rng: np.random.Generator) -> Tensor:
        found = planes[self._places(planes, count, rng)]
        return found.float() if found.shape[1] == 1 else unit(found)


def _photo(crop: dict[str, bytes]) -> np.ndarray:
    """H x W x 3 RGB."""
    return np.ascontiguousarray(cv2.imdecode(np.frombuffer(crop["photo"], np.uint8), cv2.IMREAD_COLOR)[..., ::-1])


def unit(levels: Tensor) -> Tensor:
    """0..255 as 0..1."""
    return levels.float() / 255


def stacked_view(views: dict[str, Tensor], at: Tensor) -> Tensor:
    """B x 13 x S x S: colour, truth, surface, nearness and flags of some views."""
    return torch.cat([unit(views[name][at]) for name in ("color", "truth", "surface", "near", "flags")], 1)


def view_batch(planes: Tensor) -> Batch:
    """The batch of `stacked_view`."""
    color, truth, surface, near, hidden, open_, unseen = planes.split([3, 3, 3, 1, 1, 1, 1], 1)
    hole, counts = (hidden > 0.5).float(), (open_ > LEAST_OPEN).float()
    return Batch(color, truth, hole, hole * counts, torch.cat([surface * counts, near, open_, unseen], 1))


def dilated(mask: Tensor, side: int) -> Tensor:
    """B x 1 x S x S: a mask dilated by a square."""
    return functional.max_pool2d(mask.float(), side, 1, side // 2)[..., : mask.shape[-2], : mask.shape[-1]]


def zoomed(planes: Tensor, rng: np.random.Generator) -> Tensor:
    """Planes (B x C x S x S) of which some are mirrored, and of some a part is enlarged."""
    count = len(planes)
    zoom = np.where(rng.random(count) < ZOOMED, rng.uniform(ZOOM, 1, count), 1.0)
    moves = np.zeros((count, 2, 3), np.float32)
    moves[:, 0, 0], moves[:, 1, 1] = zoom * rng.choice((-1, 1), count), zoom
    moves[:, :, 2] = (1 - zoom)[:, None] * rng.uniform(-1, 1, (count, 2))
    grid = functional.affine_grid(torch.from_numpy(moves).to(planes.device), list(planes.shape), align_corners=False)
    return functional.grid_sample(planes, grid, padding_mode="border", align_corners=False)


def vary_light(pictures: Sequence[Tensor], rng: np.random.Generator) -> list[Tensor]:
    """Pictures (B x 3 x S x S) in other light, the same for all pictures of a crop."""
    count = len(pictures[0])
    gain = rng.uniform(*BRIGHTER, (count, 1)) * rng.uniform(*TINTED, (count, 3))
    gamma = np.exp(np.clip(GAMMA * rng.normal(size=(count, 1)), -0.35, 0.35))
    order = np.stack([rng.permutation(3) if rng.random() < PERMUTED else np.arange(3) for _ in range(count)])
    device = pictures[0].device
    by, power = (torch.from_numpy(each[..., None, None].astype(np.float32)).to(device) for each in (gain, gamma))
    rows, channels = torch.arange(count, device=device)[:, None], torch.from_numpy(order).to(device)
    return [(one.clamp_min(1e-6) ** power * by).clamp(0, 1)[rows, channels] for one in pictures]
