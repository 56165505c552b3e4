"""Settings and paths of training data in -> the source that a run's samples come from, out."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import numpy as np

from dlama.datasets.frames import Case
from dlama.datasets.frames import Protocol as CaseProtocol
from dlama.datasets.layouts import LAYOUTS, SeveralLayoutsError, layout_of, open_dataset
from dlama.datasets.text_tables import pictures_below
from dlama.errors import FileError, InputError, system_errors
from dlama.training.data.cases import CASES, split_cases
from dlama.training.data.photos import split_photos
from dlama.training.data.samples.dataset import case_pair, case_removal, case_view
from dlama.training.data.samples.views import PairExample, Samples, ViewExample
from dlama.training.data.samples.world_views import WorldSet
from dlama.training.data.samples.worlds import world_pair, world_removal, world_view
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


Example = Callable[..., ViewExample | PairExample]


class SampleKind(NamedTuple):
    """What samples of a kind are made of."""

    cases: CaseProtocol | None = None
    """The protocol of the dataset's cases that samples can be made of,"""
    of_case: Example | None = None
    """and what makes an example of one."""
    of_world: Example | None = None
    """What makes an example of a procedural world, with photos of the data as textures: of all where there is no case, else of
    the share that is `data.cases` less than 1."""


KINDS = {
    "world": SampleKind(of_world=world_view),
    "frame": SampleKind("vpi", case_view),
    "removal": SampleKind("ori", case_removal, world_removal),
    "stereo": SampleKind("sii", case_pair, world_pair),
}
"""Those of `kinds.SAMPLES`."""


@dataclass(frozen=True)
class TrainingData:
    """Photos and dataset cases that were found in a folder or several; their pictures are not read yet."""

    photos: tuple[Path, ...] = ()
    cases: tuple[Case, ...] = ()

    def of(self, protocol: CaseProtocol | None) -> tuple[Case, ...]:
        """The cases of one protocol."""
        return tuple(case for case in self.cases if case.protocol == protocol)


def source_for(settings: TrainSettings, data: Sequence[Path], split: Split) -> SampleSource:
    """The source of a run's samples; held-out samples share no world, photo or frame with those trained on.

    Args:
        data: folders of pictures or datasets; none: procedural worlds alone.
    Raises:
        InputError: `data` names nothing that can be read or is of use, or the mixture needs files that `data` lacks.
        FileError: a file of `data` cannot be read.
    """
    kinds = set(settings.data.mixture)
    found = {path: find_training_data(path) for path in map(Path, data)}
    _check_use(kinds, found)
    used = select_useful(found, kinds)
    used = TrainingData(
        split_photos(used.photos, split) if used.photos else (), split_cases(used.cases, split) if used.cases else ()
    )
    if data:
        LOG.info("%s: %s", split, usage_summary(used, settings))
    return mix(
        {kind: (samples_of(kind, settings, used, split), share) for kind, share in settings.data.mixture.items()}
    )


def usage_summary(found: TrainingData, settings: TrainSettings) -> str:
    """What of the data is used, and how kinds are divided between dataset cases and worlds; one line for the log."""
    counts = {"photos": len(found.photos)} | {words: len(found.of(protocol)) for protocol, words in CASES.items()}
    parts = [", ".join(f"{count} {words}" for words, count in counts.items() if count)]
    for kind in sorted(settings.data.mixture):
        if KINDS[kind].of_case and KINDS[kind].of_world:
            share = settings.data.cases if found.of(KINDS[kind].cases) else 0.0
            parts.append(f"{share:.0%} of kind '{kind}' are made of them, {1 - share:.0%} of worlds")
    return "; ".join(parts)


@system_errors(FileError)
def find_training_data(path: Path) -> TrainingData:
    """The cases of a dataset of a known layout, or else the pictures of the folder. InputError, FileError."""
    try:
        layout = layout_of(path, None)
    except (SeveralLayoutsError, FileError):
        raise
    except InputError:  # of no layout
        return TrainingData(tuple(pictures_below(path, " and is no data set of a known layout")))
    cases = open_dataset(path, layout).cases
    if not cases:
        raise InputError(
            f"{path}: has no two frames of one scene with depth and poses ({LAYOUTS[layout].looked_for}), no frame with and "
            "without an object and no stereo pair; for its pictures alone, name the folder that holds nothing else"
        )
    return TrainingData(cases=tuple(cases))


def select_useful(found: Mapping[Path, TrainingData], kinds: set[str]) -> TrainingData:
    """The photos and cases that samples of these kinds are made of. InputError where a folder has none."""
    protocols, has_worlds = {KINDS[kind].cases for kind in kinds}, any(KINDS[kind].of_world for kind in kinds)
    photos: list[Path] = []
    cases: list[Case] = []
    for path, own in found.items():
        useful = own.photos if has_worlds else (), [case for case in own.cases if case.protocol in protocols]
        if not any(useful):
            raise InputError(f"data.mixture is {', '.join(sorted(kinds))}, which has no use for {_describe(path, own)}")
        photos += useful[0]
        cases += useful[1]
    return TrainingData(tuple(photos), tuple(cases))


def _describe(path: Path, found: TrainingData) -> str:
    """A folder, what it has, and the kinds of samples that are made of it."""
    has = [words for protocol, words in CASES.items() if found.of(protocol)] or ["photos"]
    kinds = [name for name, kind in KINDS.items() if (found.of(kind.cases) if found.cases else kind.of_world)]
    return f"`data` {path} ({', '.join(has)}); a mixture with {' or '.join(kinds)} is expected"


def _check_use(kinds: set[str], found: Mapping[Path, TrainingData]) -> None:
    """Refuse kinds without their files."""
    for kind in sorted(kinds):
        if not KINDS[kind].of_world and not any(one.of(KINDS[kind].cases) for one in found.values()):
            named = ", ".join(map(str, found)) or "no file"
            raise InputError(f"data.mixture has {kind!r}, which needs a posed data set, but `data` names {named}")


def samples_of(kind: str, settings: TrainSettings, found: TrainingData, split: Split) -> SampleSource:
    """Samples of one kind: of dataset cases by the share `data.cases` where there are any, the rest of worlds."""
    protocol, of_case, of_world = KINDS[kind]
    cases, parts = found.of(protocol), dict[str, tuple[SampleSource, float]]()
    if of_case is not None and cases:
        example = functools.partial(of_case, cases, settings.data.size)
        parts["cases"] = Samples(example, len(cases), settings.network), settings.data.cases
    if of_world is not None and not (parts and settings.data.cases == 1):
        worlds = WorldSet(split, settings.data.size, found.photos)
        example = functools.partial(of_world, worlds)
        made = Samples(example, len(worlds), settings.network, worlds.group_size)
        parts["worlds"] = made, 1 - settings.data.cases if parts else 1.0
    return mix(parts)


def mix(parts: Mapping[str, tuple[SampleSource, float]]) -> SampleSource:
    """A Mixture, or the one source that there is."""
    return Mixture(parts) if len(parts) > 1 else next(iter(parts.values()))[0]
