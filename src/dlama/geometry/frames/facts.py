"""A layer of a scene in; what the scene asks of it, found once, out: kept when its pixels no longer are in memory."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from dlama.geometry.codes import DEPTH_FROM_OTHERS, HoleType, Origin

OneLayer = TypeVar("OneLayer", bound="Facts")
Source = TypeVar("Source")
Found = TypeVar("Found")

_found: WeakKeyDictionary[Any, dict[Callable[..., Any], Any]] = WeakKeyDictionary()
"""Layer or picture -> function -> what it found; not fields of the layers, which are sent to other processes."""


def find_once(source: Source, find: Callable[[Source], Found]) -> Found:
    """What `find` gives for a layer or a picture, found at the first call and kept for as long as that is alive."""
    known = _found.setdefault(source, {})
    if find not in known:
        known[find] = find(source)
    found: Found = known[find]
    return found


class Facts:
    """What a scene asks of its layers, without their pixels once it is found."""

    def find_once(self: OneLayer, find: Callable[[OneLayer], Found]) -> Found:
        """`find_once` of it."""
        return find_once(self, find)

    def load(self) -> Any:
        """The View with its pixels in memory; hold it while working with it."""
        raise NotImplementedError

    def load_part(self) -> Any:
        """A View, perhaps of a smaller camera, with all that is known in it."""
        return self.load()

    @cached_property
    def origins(self) -> frozenset[int]:
        """The Origin codes of what is known in it."""
        import cv2  # late: nouns load numpy alone

        view = self.load_part()
        known = (~view.hole).view(np.uint8)
        return frozenset(np.flatnonzero(cv2.calcHist([view.origin], [0], known, [256], [0, 256])).tolist())

    @property
    def shows_source(self) -> bool:
        """True if it holds pixels that the source view itself shows (`from_source`)."""
        return bool(self.origins & {Origin.MEASURED, Origin.ESTIMATED})

    @cached_property
    def has_holes(self) -> bool:
        """True if there is a hole in it."""
        return bool(self.load().hole.any())

    @cached_property
    def has_far(self) -> bool:
        """True if a pixel of it is infinitely far."""
        return bool(self.load_part().far.any())

    @property
    def has_filled_depth(self) -> bool:
        """True if a pixel of it has a measured colour and a depth that was filled, or that another frame measured."""
        return bool(self.origins & set(DEPTH_FROM_OTHERS))

    @cached_property
    def has_errors(self) -> bool:
        """True if it has expected errors of filled pixels."""
        return self.load_part().errors is not None

    @cached_property
    def has_open_holes(self) -> bool:
        """True if it has a hole with a type."""
        view = self.load_part()
        return bool((view.hole & (view.hole_type != HoleType.NONE.value)).any())
