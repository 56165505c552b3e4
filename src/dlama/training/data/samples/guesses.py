"""Crops with guesses in a folder in -> samples of planes `choice`, see `batches.Batch`, out.

Light, mirror and the order of the guesses are drawn anew for each sample. The target's known pixels are the view's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from dlama.errors import FileError, InputError, any_error
from dlama.geometry.rgbd import UInt8Array
from dlama.training.data.augment import random_light
from dlama.training.settings import NetworkSettings

SIDE = 256
"""Height and width of a crop in pixels."""
LEVELS = 65535
"""Of depth planes in files."""
INDEX = "guesses.txt"
"""Marks a folder of crops; names the guesses, one a line."""


@dataclass(frozen=True, eq=False)
class GuessCrop:
    """A square of a view, with its guesses and the truth; planes as in `inpainters.choice.planes`."""

    context: UInt8Array
    """C x S x S in 0..255; the depth plane is in `depth`."""
    color: UInt8Array
    """K x 3 x S x S, guesses."""
    depth: np.ndarray
    """(1 + K) x S x S uint16, 0..LEVELS: known depth, then the guesses'."""
    true_color: UInt8Array
    """3 x S x S."""
    true_depth: np.ndarray
    """S x S uint16."""
    true_known: UInt8Array
    """S x S: 1 where the truth of depth is known."""


def holds_crops(folder: Path) -> bool:
    """Whether a path is a folder of crops, as `benchmarks/choice.py crops` writes them."""
    return (folder / "train" / INDEX).is_file()


def read_crop(path: Path) -> GuessCrop:
    """FileError where the file is none."""
    damaged = any_error(FileError, f"{path}: is no crop with guesses")
    with damaged, path.open("rb") as stream, np.load(stream) as arrays:
        return GuessCrop(**{one.name: arrays[one.name] for one in fields(GuessCrop)})


class GuessSamples:
    """Kind `guesses`, see `sources.SampleSource`. InputError: planes that are no guesses. FileError: folders without crops."""

    def __init__(self, folders: Sequence[Path], network: NetworkSettings, split: str, size: int = SIDE) -> None:
        if not network.kind.guesses:
            raise InputError(f"data.mixture has 'guesses', which trains planes 'choice'; they are {network.planes!r}")
        if size > SIDE:
            raise InputError(f"data.size is {size} and crops with guesses have {SIDE}; {SIDE} at most is expected")
        self.paths = tuple(path for folder in folders for path in sorted((folder / split).glob("*.npz")))
        self.count, self.size = network.kind.guesses, size
        if not self.paths:
            raise FileError(f"{', '.join(map(str, folders))}: no crop with guesses in the folder {split}")
        for folder in folders:
            names = (folder / split / INDEX).read_text("utf-8").split()
            if len(names) != self.count:
                raise FileError(f"{folder / split / INDEX}: names {len(names)} guesses; {self.count} are expected")

    def __len__(self) -> int:
        return len(self.paths)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One crop as a sample. FileError: a file that is damaged, or a crop without a hole or without anything known."""
        made = planes_of_crop(read_crop(self.paths[index]), rng.permutation(self.count), random_light(rng))
        if not 0 < made["mask"].mean() < 1:
            raise FileError(
                f"{self.paths[index]}: its hole is {'full' if made['mask'].any() else 'empty'}; neither is expected"
            )
        box = self.square(made["mask"][0], rng)
        made = {name: planes[:, box[0], box[1]] for name, planes in made.items()}
        if rng.random() < 0.5:
            return {name: np.ascontiguousarray(planes) for name, planes in made.items()}
        return {name: np.ascontiguousarray(planes[..., ::-1]) for name, planes in made.items()}

    def square(self, hole: np.ndarray, rng: np.random.Generator) -> tuple[slice, slice]:
        """Rows and columns of a random square of the crop, of the run's size, whose hole is neither empty nor full."""
        while True:
            top, left = (int(start) for start in rng.integers(0, SIDE - self.size + 1, 2))
            box = slice(top, top + self.size), slice(left, left + self.size)
            if 0 < hole[box].mean() < 1:
                return box


def planes_of_crop(crop: GuessCrop, order: np.ndarray, light: np.ndarray) -> dict[str, np.ndarray]:
    """The sample of a crop, its guesses in the given order, its colours through `light` (3 x 256)."""
    context = crop.context / np.float32(255)
    hole = (crop.context[-1:] > 0).astype(np.float32)
    known, *depths = crop.depth / np.float32(LEVELS)
    color = np.stack([change_light(one, light) for one in crop.color[order]])
    guesses = np.concatenate([color, np.stack(depths)[order][:, None]], 1)
    seen = np.concatenate([change_light(crop.context[:3], light), known[None]]) * (1 - hole)
    target = np.concatenate([change_light(crop.true_color, light), (crop.true_depth / np.float32(LEVELS))[None]])
    return {
        "input": np.concatenate([seen, hole]).astype(np.float32),
        "context": context[4:-1],
        "guesses": guesses.reshape(-1, *hole.shape[1:]).astype(np.float32),
        "target": target.astype(np.float32),
        "mask": hole,
        "known_depth": crop.true_known[None].astype(np.float32),
        "limit": np.full(hole.shape, np.inf, np.float32),
    }


def change_light(color: np.ndarray, light: np.ndarray) -> np.ndarray:
    """3 x H x W uint8 through 3 x 256."""
    return np.stack([table[levels] for table, levels in zip(light, color)])
