"""A view's known surfaces on a coarse grid, as a noun: what is known of each cell, and which of them the source never saw."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import BoolArray, Float32Array

NEAR_CELLS = 2
"""Cells up to which a plane is next to the hole out of view."""


@dataclass(frozen=True, eq=False)
class CoarseCells:
    """Cells of a grid, h x w: one sample of each. Labels: -1 none, 0 sky, k >= 1 planes."""

    camera: Camera
    """Of the grid."""
    hole: BoolArray
    """h x w, True in cells that hold a hole pixel."""
    hole_in_view: BoolArray
    """h x w, True in the part of the hole that is inside the source's view."""
    inverse_depth: Float32Array
    """h x w, 1/m, of the known cells."""
    label: NDArray[np.int8]
    """h x w, of the known cells."""
    candidates: Float32Array
    """L x h x w inverse depth (1/m) that each label would give: no plane, sky, planes."""

    @cached_property
    def unseen(self) -> BoolArray:
        """h x w, True in the part of the hole that is out of the source's view."""
        return self.hole & ~self.hole_in_view

    @cached_property
    def near_unseen(self) -> BoolArray:
        """h x w, True within NEAR_CELLS of `unseen` cells, and in them."""
        return cells_near(self.unseen)

    @cached_property
    def plane_cells(self) -> NDArray[np.int64]:
        """How many known cells each plane (K) holds."""
        return np.bincount(self.label[~self.hole].clip(0), minlength=len(self.candidates) - 1)[1:]


def cells_near(unseen: BoolArray) -> BoolArray:
    """h x w, True within NEAR_CELLS of `unseen` cells."""
    return dilate_mask(unseen, NEAR_CELLS)
