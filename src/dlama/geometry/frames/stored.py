"""A view on disk and its camera in; a View that reads its pixels on demand out.

Of a scene of a thousand frames a camera needs four. A `StoredView` behaves as a View; its pixels are in a `PixelCache` of
limited size, which drops the least recently used.
"""

from __future__ import annotations

import itertools
import threading
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, UInt16Array
from dlama.geometry.view import View

CACHE_BYTES = 256_000_000
"""Memory for the pixels of a scene's frames: 60 frames of 640x480."""


class PixelCache:
    """Views by number, at most `limit` bytes of them; the least recently used is dropped."""

    def __init__(self, limit: int = CACHE_BYTES) -> None:
        self.limit, self.bytes, self.reads = limit, 0, 0
        self._kept: OrderedDict[int, View] = OrderedDict()
        self._lock = threading.Lock()
        self._numbers = itertools.count()

    def __reduce__(self) -> tuple[Any, ...]:
        return PixelCache, (self.limit,)

    def number(self) -> int:
        """An unused number."""
        return next(self._numbers)

    def view(self, number: int, load: Callable[[], View]) -> View:
        """The view of that number, loaded unless it is there."""
        with self._lock:
            found = self._kept.get(number)
            if found is not None:
                self._kept.move_to_end(number)
                return found
        loaded = load()
        with self._lock:
            self.reads += 1
            self._keep(number, loaded)
        return loaded

    def _keep(self, number: int, view: View) -> None:
        size = count_bytes(view)
        if number in self._kept or size > self.limit:
            return
        self._kept[number] = view
        self.bytes += size
        while self.bytes > self.limit:
            self.bytes -= count_bytes(self._kept.popitem(last=False)[1])


def count_bytes(view: View) -> int:
    """Bytes of a view's planes."""
    planes = (view.color, view.depth, view.hole, view.hole_type, view.origin, view.confidence, view.frame, view.errors)
    return sum(plane.nbytes for plane in planes if plane is not None)


class StoredView(View):
    """A view whose pixels are read on demand (`StoredView.of`); `read` gives it with them.

    Given pixels, as `dataclasses.replace` gives them, the class makes a plain View.
    """

    _load: Callable[[], View]
    _cache: PixelCache
    _number: int

    def __new__(cls, *fields: Any, **named: Any) -> View:  # type: ignore[misc]
        return View(*fields, **named)

    @classmethod
    def of(cls, camera: Camera, load: Callable[[], View], cache: PixelCache, read: View | None = None) -> StoredView:
        """The view that `load` reads, which must always give the same, with this camera; `read`: the view if just read."""
        made: StoredView = object.__new__(cls)
        for name, value in {"camera": camera, "_load": load, "_cache": cache, "_number": cache.number()}.items():
            object.__setattr__(made, name, value)
        if read is not None:
            cache.view(made._number, lambda: read)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return StoredView.of, (self.camera, self._load, self._cache)

    def read(self) -> View:
        """The view with its pixels; hold this while working with it."""
        return self._cache.view(self._number, self._load)

    @property
    def cache(self) -> PixelCache:
        """Where its pixels are held."""
        return self._cache

    @property
    def color(self) -> UInt8Array:
        """H x W x 3, RGB."""
        return self.read().color

    @property
    def depth(self) -> Float32Array:
        """H x W, metres."""
        return self.read().depth

    @property
    def hole(self) -> BoolArray:
        """H x W."""
        return self.read().hole

    @property
    def hole_type(self) -> UInt8Array:
        """H x W."""
        return self.read().hole_type

    @property
    def origin(self) -> UInt8Array:
        """H x W."""
        return self.read().origin

    @property
    def confidence(self) -> Float32Array:
        """H x W."""
        return self.read().confidence

    @property
    def frame(self) -> UInt16Array | None:
        """H x W, or None."""
        return self.read().frame

    @property
    def errors(self) -> Float32Array | None:
        """H x W x 2, or None."""
        return self.read().errors

    def without(self, where: BoolArray, hole_type: HoleType) -> View:
        """As of any view; the pixels are not held either: `where` is, a bit each."""
        load = partial(without_bits, self, np.packbits(where), hole_type)
        return StoredView.of(self.camera, load, self._cache)

    def without_filled_depth(self) -> View:
        """As of any view; the pixels are not held either."""
        if not self.has_filled_depth:
            return self
        return StoredView.of(self.camera, partial(View.without_filled_depth, self), self._cache)


def without_bits(view: View, bits: UInt8Array, hole_type: HoleType) -> View:
    """`View.without`, of a region as `numpy.packbits` packs it."""
    return View.without(view.read(), unpack_bits(bits, view.camera), hole_type)


def unpack_bits(bits: UInt8Array, camera: Camera) -> BoolArray:
    """H x W of the camera, as `numpy.packbits` packed it."""
    return np.unpackbits(bits, count=camera.width * camera.height).reshape(camera.hw).astype(bool)
