"""A model file in -> a network that fills planes of any size out; `dlama.models.network_file` opens and runs the file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from dlama.errors import FileError, InputError
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.networks.contract import Contract, from_metadata
from dlama.inpainters.networks.tiling import Layout, fill_crops
from dlama.models.cache import user_path
from dlama.models.network_file import NetworkFile, open_kept

BUDGET = 640 * 640
"""Pixels of the largest crop that goes through a network at once: it bounds the memory."""


@dataclass(frozen=True, eq=False)
class Engine(NetworkFile):
    """A network file that fills: with its contract, and the crops that it takes."""

    budget: int = BUDGET

    @cached_property
    def contract(self) -> Contract:
        """The file's contract, checked against the graph. InputError and FileError."""
        found = from_metadata(self.metadata, str(self.path))
        if found is None:
            raise InputError(
                f"{self.path}: carries no contract (metadata key dlama.contract); `dlama models convert` writes files that do, "
                "docs/models.md says how to add one to a network of your own"
            )
        ends = list(self.inputs.values())
        if len(ends) != 1 or ends[0][0] != "tensor(float)" or len(ends[0][1]) != 4:
            raise FileError(f"{self.path}: inputs are {self.inputs}; one float tensor B x C x H x W is expected")
        for names, shape in ((found.in_planes, ends[0][1]), (found.out_planes, next(iter(self.outputs.values()))[1])):
            if len(shape) == 4 and isinstance(shape[1], int) and shape[1] != len(names):
                raise FileError(f"{self.path}: the graph has {shape[1]} planes where its contract has {list(names)}")
        return found

    def fill(self, planes: Float32Array, hole: BoolArray) -> Float32Array:
        """B x C x H x W planes in 0..1 with the hole (H x W) filled; what was known comes back bit for bit."""
        return fill_crops(np.asarray(planes, np.float32), hole, self.run_planes, self.layout)

    @property
    def layout(self) -> Layout:
        """How pictures are cut for this network."""
        about = self.contract
        least = Layout.call_cost if about.side is None else about.minimum**2
        return Layout(about.multiple, about.minimum, self.budget, least, about.side)

    def run_planes(self, planes: Float32Array, hole: BoolArray) -> Float32Array:
        """The network itself on planes in 0..1, of a size it takes; the hole (H x W, or one for each of its masks: masks x H x W)
        is zeroed, the masks stacked last."""
        about = self.contract
        stacked = about.network_input(planes, hole.reshape(-1, *hole.shape[-2:]))
        out = self.run({next(iter(self.inputs)): stacked})
        if out.shape != planes.shape:
            raise FileError(f"{self.path}: gave {out.shape} for {stacked.shape}; {planes.shape} is expected")
        if not np.isfinite(out).all():
            raise FileError(f"{self.path}: the network gave values that are not finite")
        return about.unit_output(out)


def open_engine(model: str | Path, *, budget: int = BUDGET, memory_pattern: bool = True) -> Engine:
    """The engine of a file, parameters as Engine's; the last few are kept open, so that methods in turn open each once.

    FileError where there is no such file, InputError as Engine.
    """
    return open_kept(Engine, user_path(model), budget=budget, memory_pattern=memory_pattern)
