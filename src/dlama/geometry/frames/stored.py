"""What reads a view and its camera in; a handle that loads the view on demand out.

Of a scene of a thousand frames a camera needs four. The pixels that `StoredView.load` reads are in a `PixelCache` of limited
size, which drops the least recently used. Its coarse depth is held for every frame. Of what fills a small part of a picture, that
part alone is held (`BoxedView`).
"""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, from_source
from dlama.geometry.frames.facts import Facts
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, freeze
from dlama.geometry.view import PLANES, View

CACHE_BYTES = 400_000_000
"""Memory for the pixels of a scene's frames: 90 frames of 640x480."""
FACTS = "origins", "has_holes", "has_errors", "has_far"
"""Of a view, without its pixels."""
BLOCK = 8
"""Sides in px of the blocks of coarse depth: that of a thousand frames is held."""


class PixelCache:
    """Views by key, at most `limit` bytes of them; the least recently used is dropped."""

    def __init__(self, limit: int = CACHE_BYTES) -> None:
        self.limit, self.bytes, self.reads = limit, 0, 0
        self._kept: OrderedDict[object, View] = OrderedDict()
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        return PixelCache, (self.limit,)

    def view(self, key: object, read: Callable[[], View], keep: bool = True) -> View:
        """The view of that key, read unless it is there. keep: whether one that is read is kept."""
        with self._lock:
            found = self._kept.get(key)
            if found is not None:
                self._kept.move_to_end(key)
                return found
        view = read()
        size = count_bytes(view)
        with self._lock:
            self.reads += 1
            if keep and key not in self._kept and size <= self.limit:
                self._kept[key] = view
                self.bytes += size
                while self.bytes > self.limit:
                    self.bytes -= count_bytes(self._kept.popitem(last=False)[1])
        return view


def count_bytes(view: View) -> int:
    """Bytes of a view's planes."""
    return sum(plane.nbytes for plane in (getattr(view, name) for name in PLANES) if plane is not None)


class StoredView(Facts):
    """A frame, removed object or fill of a scene whose pixels are not in memory: `load` reads its View."""

    def __init__(self, camera: Camera, read: Callable[[], View], cache: PixelCache, first: View | None = None) -> None:
        """read: gives the view, always the same; cache: holds its pixels for a while; first: the view, if it was just read."""
        self.camera, self.read, self.cache = camera, read, cache
        self._key = object()
        if first is not None:
            cache.view(self._key, lambda: first)

    def __repr__(self) -> str:
        return f"StoredView({self.camera.width}x{self.camera.height})"

    def load(self, keep: bool = True) -> View:
        """The view with its pixels, read unless the cache holds them; hold it while working with it.

        keep: whether the cache holds them from now on. What a scene asks of its layers is found at the first reading.
        """
        view = self.cache.view(self._key, self.read, keep)
        if FACTS[0] not in vars(self):
            vars(self).update({name: getattr(view, name) for name in FACTS})
        return view

    def made_by(self, make: Callable[..., View], *more: Any, first: View | None = None) -> StoredView:
        """What `make` gives for the view and more, made when it is needed; first: as of `__init__`."""
        return StoredView(self.camera, partial(make_aside, self, make, *more), self.cache, first)

    def without(self, where: BoolArray, hole_type: HoleType) -> StoredView:
        """As `View.without`; of `where` a bit each is held."""
        return self.made_by(without_bits, np.packbits(where), hole_type)

    def without_filled_depth(self) -> StoredView:
        """As `View.without_filled_depth`."""
        return self.made_by(View.without_filled_depth) if self.has_filled_depth else self


class BoxedView(StoredView):
    """A removed object or fill that has pixels in a box of its picture alone: these are held, as a smaller camera sees them."""

    def __init__(self, camera: Camera, part: View | StoredView) -> None:
        """part: of a camera that `camera.cropped_to` gave."""
        super().__init__(camera, part.load, part.cache if isinstance(part, StoredView) else PixelCache(0))
        self.part = part
        row, column = round(camera.cy - part.camera.cy), round(camera.cx - part.camera.cx)
        self.box = slice(row, row + part.camera.height), slice(column, column + part.camera.width)

    def load(self, keep: bool = True) -> View:
        """The view of the whole picture; `load_part` gives its pixels without what is round them."""
        part, planes = self.load_part(), dict[str, Any]()
        for name, inside in ((name, getattr(part, name)) for name in PLANES):
            if inside is not None:
                whole = (np.ones if name == "hole" else np.zeros)((*self.camera.hw, *inside.shape[2:]), inside.dtype)
                whole[self.box] = inside
                planes[name] = freeze(whole)
        return replace(part, camera=self.camera, **planes)

    def load_part(self) -> View:
        """The view of the box."""
        return self.part.load()

    @cached_property
    def has_holes(self) -> bool:
        """True if there is a hole in it."""
        return self.part.camera.hw != self.camera.hw or self.part.has_holes


Layer = View | StoredView
"""A frame, removed object or fill of a scene; `load` gives its view."""


def make_of(layer: Layer, make: Callable[..., View], *more: Any) -> Layer:
    """What `make` gives for a layer's view and more: at once, or, of a stored one, when its pixels are needed. A boxed one
    gives it the part, of which it may look at each pixel alone."""
    if isinstance(layer, BoxedView):
        return BoxedView(layer.camera, make_of(layer.part, make, *more))
    return layer.made_by(make, *more) if isinstance(layer, StoredView) else make(layer, *more)


def cache_of(layers: Iterable[Layer]) -> PixelCache:
    """The cache that holds the pixels of stored layers, of whose scene it is the only one; a new one where all are in memory."""
    return next((layer.cache for layer in layers if isinstance(layer, StoredView)), PixelCache())


def make_aside(stored: StoredView, make: Callable[..., View], *more: Any) -> View:
    """What `make` gives for a stored view and more: no cache keeps that view, for what is made of it is asked for instead."""
    return make(stored.load(keep=False), *more)


def without_bits(view: View, bits: UInt8Array, hole_type: HoleType) -> View:
    """`View.without`, of a region as `numpy.packbits` packs it."""
    return view.without(unpack_bits(bits, view.camera), hole_type)


def unpack_bits(bits: UInt8Array, camera: Camera) -> BoolArray:
    """H x W of the camera, as `numpy.packbits` packed it."""
    return np.unpackbits(bits, count=camera.width * camera.height).reshape(camera.hw).astype(bool)


def coarse_depth(layer: Layer) -> Float32Array:
    """The nearest depth measured in each block of pixels, ceil(H / BLOCK) x ceil(W / BLOCK) metres.

    0 where a pixel of the block has none, inf = far.
    """
    view = layer.load()
    depth = np.where(from_source(view.origin) & ~view.hole, view.depth, np.float32(0))
    rows, columns = (-size % BLOCK for size in depth.shape)
    padded = np.pad(depth, ((0, rows), (0, columns)))
    blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, padded.shape[1] // BLOCK, BLOCK)
    return np.asarray(blocks.min((1, 3)), np.float32)


def pixel_digest(layer: Layer) -> bytes:
    """Changes with any colour, any depth and any hole of a layer."""
    view, digest = layer.load(), hashlib.sha256()
    for plane in (view.color, view.depth, view.hole):
        digest.update(plane.tobytes())
    return digest.digest()
