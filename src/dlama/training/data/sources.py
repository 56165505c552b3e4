"""Settings and paths of training data in -> the source that a run's samples come from, out."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from dlama.datasets.layouts import LAYOUTS, SeveralLayoutsError, detect, open_dataset
from dlama.errors import FileError, InputError, system_errors
from dlama.training.data.cases import KIND_NAMES, TrainingCase, split_cases, training_cases
from dlama.training.data.pack_format import read_pack
from dlama.training.data.photos import Photo, folder_photos, split_photos
from dlama.training.data.samples.dataset import case_pair, case_removal, case_view
from dlama.training.data.samples.toy_scenes import ToyScenes
from dlama.training.data.samples.views import PairExample, Samples, ViewExample
from dlama.training.data.samples.world_views import WorldSet
from dlama.training.data.samples.worlds import world_pair, world_removal, world_view
from dlama.training.kinds import SAMPLES
from dlama.training.settings import TrainSettings

LOG = logging.getLogger("dlama")
Split = Literal["train", "held_out"]


class SampleSource(Protocol):
    """Makes samples. Must be picklable, since it is sent to worker processes, and hold no state that a sample changes.

    It may have an attribute `group_size`: so many consecutive indices (n group_size ... (n + 1) group_size - 1) share what is
    costly to make.
    """

    def __len__(self) -> int:
        """Number of different indices (worlds, photos, dataset cases)."""

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample, see `batches.Batch`: the same for the same index and the same state of `rng`."""


class Mixture:
    """A SampleSource that draws from several by their shares. As long as the longest of them; the others begin again."""

    def __init__(self, parts: Mapping[str, tuple[SampleSource, float]]) -> None:
        total = sum(share for _, share in parts.values())
        self.kinds = tuple(parts)
        self.sources = tuple(source for source, _ in parts.values())
        self.thresholds = np.cumsum([share / total for _, share in parts.values()])
        self.group_size = max(int(getattr(source, "group_size", 1)) for source in self.sources)

    def __len__(self) -> int:
        return max(len(source) for source in self.sources)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample of one of the kinds."""
        number = min(int(np.searchsorted(self.thresholds, rng.random(), "right")), len(self.sources) - 1)
        return self.sources[number].sample(index % len(self.sources[number]), rng)


@dataclass(frozen=True)
class TrainingData:
    """Photos and dataset cases that were found in folders and packs; their pictures are not read yet."""

    photos: tuple[Photo, ...] = ()
    cases: tuple[TrainingCase, ...] = ()

    def of(self, kind: str) -> tuple[TrainingCase, ...]:
        """The cases of one kind: frame, removal, stereo."""
        return tuple(case for case in self.cases if case.kind == kind)


def source_for(settings: TrainSettings, data: Sequence[Path], split: Split) -> SampleSource:
    """The source of a run's samples; held-out samples share no world, photo or frame with those trained on.

    Args:
        data: folders of pictures, datasets or packs; none: procedural worlds alone.
    Raises:
        InputError: `data` names nothing that can be read or is of use, or the mixture needs files that `data` lacks.
        FileError: a file of `data` cannot be read.
    """
    kinds = set(settings.data.mixture)
    found = find_training_data(data)
    _check_use(kinds, data, found)
    used = _split(found, kinds, split)
    if data:
        LOG.info("%s: %s", split, usage_summary(used, settings))
    made = {kind: (MAKERS[kind](settings, used, split), share) for kind, share in settings.data.mixture.items()}
    if len(made) == 1:
        return next(iter(made.values()))[0]
    return Mixture(made)


def usage_summary(found: TrainingData, settings: TrainSettings) -> str:
    """What of the data is used, and how kinds are divided between dataset cases and worlds; one line for the log."""
    counts = {"photos": len(found.photos)} | {words: len(found.of(kind)) for kind, words in KIND_NAMES.items()}
    parts = [", ".join(f"{count} {words}" for words, count in counts.items() if count)]
    for kind in sorted(settings.data.mixture):
        if SAMPLES[kind].cases and not SAMPLES[kind].cases_required:
            share = settings.data.cases if found.of(kind) else 0.0
            parts.append(f"{share:.0%} of kind '{kind}' are made of them, {1 - share:.0%} of worlds")
    return "; ".join(parts)


@system_errors(FileError)
def find_training_data(data: Sequence[Path]) -> TrainingData:
    """The photos and cases of folders of pictures, datasets and packs. InputError, FileError."""
    photos: list[Photo] = []
    cases: list[TrainingCase] = []
    for path in map(Path, data):
        more_photos, more_cases = read_pack(path) if path.is_file() else _in_folder(path)
        photos += more_photos
        cases += more_cases
    return TrainingData(tuple(photos), tuple(cases))


def _in_folder(path: Path) -> tuple[Sequence[Photo], Sequence[TrainingCase]]:
    """The cases of a dataset of a known layout, or else the pictures of the folder."""
    if not path.is_dir():
        raise FileError(f"{path}: no such file or folder; pictures, a data set or a pack is expected")
    try:
        layout = detect(path)
    except SeveralLayoutsError:
        raise
    except InputError:  # of no layout
        return folder_photos(path), ()
    cases = training_cases(open_dataset(path, layout))
    if not cases:
        raise InputError(
            f"{path}: has no two frames of one scene with depth and poses ({LAYOUTS[layout].looked_for}), no frame with and "
            "without an object and no stereo pair; for its pictures alone, name the folder that holds nothing else"
        )
    return (), cases


def _check_use(kinds: set[str], data: Sequence[Path], found: TrainingData) -> None:
    """Refuse kinds without their files, and files without a kind."""
    named = ", ".join(map(str, data)) or "no file"
    for kind in sorted(kinds):
        if SAMPLES[kind].cases_required and not found.of(str(SAMPLES[kind].cases)):
            raise InputError(f"data.mixture has {kind!r}, which needs a posed data set, but `data` names {named}")
    if data and not (_takes_photos(found, kinds) or _cases_of_kinds(found, kinds)):
        raise InputError(f"data.mixture is {', '.join(sorted(kinds))}, which has no use for `data`: {named}")


def _takes_photos(found: TrainingData, kinds: set[str]) -> bool:
    return bool(found.photos) and any(SAMPLES[kind].photos for kind in kinds)


def _cases_of_kinds(found: TrainingData, kinds: set[str]) -> tuple[TrainingCase, ...]:
    """The cases that samples of these kinds are made of."""
    case_kinds = {SAMPLES[kind].cases for kind in kinds}
    return tuple(case for case in found.cases if case.kind in case_kinds)


def _split(found: TrainingData, kinds: set[str], split: Split) -> TrainingData:
    """The photos and cases of one split that these kinds use."""
    photos = split_photos(found.photos, split) if _takes_photos(found, kinds) else ()
    used = _cases_of_kinds(found, kinds)
    return TrainingData(photos, split_cases(used, split) if used else ())


def _of_worlds(
    example: Callable[..., ViewExample | PairExample], settings: TrainSettings, found: TrainingData, split: Split
) -> Samples:
    worlds = WorldSet(split, settings.data.size, found.photos)
    return Samples(functools.partial(example, worlds), len(worlds), settings.network, worlds.group_size)


def _of_cases(
    kind: str, example: Callable[..., ViewExample | PairExample], settings: TrainSettings, found: TrainingData
) -> Samples:
    cases = found.of(kind)
    return Samples(functools.partial(example, cases, settings.data.size), len(cases), settings.network)


def _of_both(
    kind: str,
    of_cases: Callable[..., ViewExample | PairExample],
    of_worlds: Callable[..., ViewExample | PairExample],
    settings: TrainSettings,
    found: TrainingData,
    split: Split,
) -> SampleSource:
    """Samples of dataset cases of a kind and of worlds, by the share `data.cases`; of worlds alone without cases."""
    worlds, share = _of_worlds(of_worlds, settings, found, split), settings.data.cases
    if not found.of(kind):
        return worlds
    cases = _of_cases(kind, of_cases, settings, found)
    return Mixture({"cases": (cases, share), "worlds": (worlds, 1 - share)}) if share < 1 else cases


MAKERS: dict[str, Callable[[TrainSettings, TrainingData, Split], SampleSource]] = {
    "sketch": lambda settings, _, split: ToyScenes(settings.network, settings.data.size, split),
    "world": lambda *run: _of_worlds(world_view, *run),
    "frame": lambda settings, found, _: _of_cases("frame", case_view, settings, found),
    "removal": lambda *run: _of_both("removal", case_removal, world_removal, *run),
    "stereo": lambda *run: _of_both("stereo", case_pair, world_pair, *run),
}
"""Source of each kind in `kinds.SAMPLES`."""
