"""The name of a kind of material in; a material of one world out, its texture drawn when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from dlama.files.rasters.pictures import read_color
from dlama.geometry.rgbd import UInt8Array, check_color
from dlama.worlds.materials import panels, textures
from dlama.worlds.materials.textures import Range
from dlama.worlds.raycast.shape_rows import FIT, MIRROR, WRAP
from dlama.worlds.scene_builder import Material, SceneBuilder

Photo = UInt8Array | Path
"""H x W x 3, RGB, or a file that holds it, read only when it is used."""


class MaterialKind(NamedTuple):
    """How a kind of material is made."""

    draw: Callable[[Generator], UInt8Array]
    variants: int
    """How many textures of it a world may have; tints make more of them."""
    tile: float = 1.0
    mode: int = WRAP
    stain: float = 0.0
    cut: bool = False
    photo: float = 0.0
    """How often a photo stands in for it, where there are photos."""
    metres: Range = (1.0, 1.0)
    """Width of that photo on the surface; a photo that fills a face goes by `mode`."""


def _plaster(rng: Generator) -> UInt8Array:
    base = textures.color(rng, (0.0, 0.17), (0.02, 0.4), (0.65, 0.92))
    return textures.rough_surface(rng, base, rng.uniform(0.04, 0.16), rng.uniform(0.02, 0.12))


def _concrete(rng: Generator) -> UInt8Array:
    base = textures.color(rng, (0.05, 0.6), (0, 0.08), (0.45, 0.7))
    return textures.rough_surface(rng, base, 0.2, 0.3, textures.ROUGH)


MATERIAL_KINDS: dict[str, MaterialKind] = {
    "plain": MaterialKind(lambda rng: textures.rough_surface(rng, (225, 225, 225), 0.1, 0.06), 1, 1.5),
    "bricks": MaterialKind(textures.bricks, 2, 2.0, stain=0.3, photo=0.7, metres=(2.5, 5)),
    "stones": MaterialKind(textures.stones, 1, 2.4, stain=0.3, photo=0.7, metres=(2.5, 5)),
    "plaster": MaterialKind(_plaster, 2, 2.2, stain=0.12, photo=0.7, metres=(2.5, 5)),
    "concrete": MaterialKind(_concrete, 1, 2.0, stain=0.4, photo=0.6, metres=(2, 4)),
    "asphalt": MaterialKind(textures.asphalt, 1, 1.6, stain=0.3, photo=0.6, metres=(2, 5)),
    "paving": MaterialKind(textures.paving, 2, 2.0, stain=0.25, photo=0.6, metres=(2, 5)),
    "gravel": MaterialKind(textures.gravel, 1, 1.4, stain=0.3, photo=0.6, metres=(2, 5)),
    "grass": MaterialKind(textures.grass, 1, 1.5, stain=0.4, photo=0.5, metres=(2, 5)),
    "tiles": MaterialKind(textures.tiles, 1, 1.6, stain=0.1, photo=0.6, metres=(1.5, 4)),
    "planks": MaterialKind(textures.planks, 1, 1.4, stain=0.15, photo=0.6, metres=(1.5, 4)),
    "wood": MaterialKind(textures.wood, 2, 1.1, photo=0.6, metres=(1, 2)),
    "metal": MaterialKind(textures.metal, 1, 1.4, stain=0.2, photo=0.4, metres=(1, 3)),
    "cloth": MaterialKind(textures.cloth, 3, 0.9, photo=0.7, metres=(1, 2.5)),
    "leaves": MaterialKind(lambda rng: textures.leaves(rng, gaps=True), 1, 1.3, cut=True),
    "hedge": MaterialKind(lambda rng: textures.leaves(rng, gaps=False), 1, 1.1, stain=0.2),
    "fence": MaterialKind(textures.fence, 1, 1.3, cut=True),
    "window": MaterialKind(panels.window, 2, mode=FIT, photo=0.2),
    "door": MaterialKind(panels.door, 1, mode=FIT, photo=0.2),
    "shutter": MaterialKind(panels.shutter, 1, mode=FIT),
    "shop": MaterialKind(panels.shop, 1, mode=FIT, photo=0.3),
    "poster": MaterialKind(panels.poster, 2, mode=FIT, photo=0.8),
    "sign": MaterialKind(panels.sign, 1, mode=FIT, photo=0.2),
    "books": MaterialKind(panels.books, 1, mode=FIT, photo=0.2),
    "crate": MaterialKind(panels.crate, 2, mode=FIT, photo=0.3),
    "bands": MaterialKind(panels.bands, 1, mode=FIT),
    "machine": MaterialKind(panels.machine, 2, mode=FIT, photo=0.2),
}
"""Every kind of material a scene may ask for."""


class Palette:
    """Materials of one world by kind. `photos`: pictures that stand in for some of them."""

    def __init__(self, builder: SceneBuilder, rng: Generator, photos: Sequence[Photo] = ()) -> None:
        self._builder, self._rng, self._photos = builder, rng, photos
        self._baked: dict[str, list[Material]] = {}

    def __call__(self, *kinds: str, spread: float = 0.12) -> Material:
        """A material of one of these kinds, its brightness and hue varied a little."""
        rng = self._rng
        kind = kinds[int(rng.integers(len(kinds)))]
        recipe, baked = MATERIAL_KINDS[kind], self._baked.setdefault(kind, [])
        if len(baked) < recipe.variants and (not baked or rng.random() < 0.5):
            baked.append(self._bake(recipe))
        material = baked[int(rng.integers(len(baked)))]
        tint = rng.normal(1, spread) * rng.normal(1, 0.3 * spread, 3)
        return material.with_tint(*(float(np.clip(part, 0.4, 1.5)) for part in tint))

    def paint(self, hue: Range = (0, 1), saturation: Range = (0.1, 0.8), value: Range = (0.2, 0.9)) -> Material:
        """A painted surface of a random colour."""
        red, green, blue = textures.color(self._rng, hue, saturation, value)
        return self("plain", spread=0).with_tint((red / 225) ** 2, (green / 225) ** 2, (blue / 225) ** 2)

    def _bake(self, kind: MaterialKind) -> Material:
        rng = self._rng
        if len(self._photos) and rng.random() < kind.photo:
            photo = self._photos[int(rng.integers(len(self._photos)))]
            picture = read_color(photo) if isinstance(photo, Path) else check_color(photo, "a texture")
            layer = self._builder.layer(panels.photo(picture))
            if kind.mode == FIT:
                return Material(layer, mode=FIT)
            metres = rng.uniform(*kind.metres)
            return Material(layer, (metres, metres), MIRROR)
        layer = self._builder.layer(kind.draw(rng))
        return Material(layer, (kind.tile, kind.tile), kind.mode, stain=kind.stain, cut=kind.cut)
