"""Canvas: a picture with filled inverse depth and surface labels in; what is known of each surface, in full and in cells, out."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

Int32Array = NDArray[np.int32]

Bases = tuple[Float32Array, Float32Array]
"""Two smooth colour fields on the cell grid (rows x cols x 3): one true to the rim, one much smoother."""

WORK_SIZE = 256
"""Longer side, in cells, of the grid on which texture is compared."""


@dataclass(frozen=True)
class Surface:
    """One piece of the hole and the cells that may give it colour."""

    kind: int
    """Label: -1 non-planar, 0 sky, k >= 1 a plane."""
    pixels: NDArray[np.int64]
    """Flat indices of the hole pixels."""
    sources: BoolArray
    """Work grid, True where a cell is known and belongs to the surface."""


class Canvas:
    """What is known, in full and on the work grid; built once per picture."""

    def __init__(
        self, color: UInt8Array, hole: BoolArray, inverse_depth: Float32Array, label: Int32Array, camera: Camera
    ) -> None:
        from dlama.inpainters.layered.kernels import cells as texture_cell_kernels
        from dlama.inpainters.layered.kernels import patch_offsets as texture_kernels

        self.kernels: ModuleType = texture_kernels
        self.color, self.hole, self.inverse_depth, self.label = color, hole, inverse_depth, label
        self.camera = camera
        self.factor = max(1, -(-max(hole.shape) // WORK_SIZE))
        self.cell = 2 * self.factor
        self.source = self._trusted()
        self.colors, self.depths, self.sources = texture_cell_kernels.shrink(
            color, inverse_depth, self.source, self.factor
        )

    def _trusted(self) -> Int32Array:
        """Label of every pixel that may be copied, -2 elsewhere; surfaces with hardly any such pixel get a closer look."""
        from dlama.inpainters.layered.kernels.cells import trusted_sources

        args = (self.hole, self.inverse_depth, self.label)
        source = np.where(trusted_sources(*args, 2), self.label, -2).astype(np.int32)
        wanted, known = np.unique(self.label[self.hole]), np.unique(source)
        for reach in (1, 0):
            poor = np.setdiff1d(wanted, known)
            if len(poor):
                near = np.isin(self.label, poor) & trusted_sources(*args, reach)
                source[near] = self.label[near]
                known = np.unique(source)
        return source
