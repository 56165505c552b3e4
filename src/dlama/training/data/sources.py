"""Settings and --data in -> where samples come from, out."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from dlama.errors import FileError, InputError
from dlama.training.settings import TrainSettings

if TYPE_CHECKING:
    from dlama.training.data.cases import Take
    from dlama.training.data.photo_samples import Shapes
    from dlama.training.data.photos import Photo

LOG = logging.getLogger("dlama")
Split = Literal["train", "held_out"]
PHOTO_KINDS = {"photo", "warped-photo"}
USES_PHOTOS = {"photo", "warped-photo", "world", "removal", "stereo"}
USES_TAKES = {"frame": "frame", "warped-photo": "frame", "removal": "removal", "stereo": "stereo"}
"""Kind of sample -> kind of take that it can be made of."""


class SampleSource(Protocol):
    """Makes samples. Picklable, since it travels to worker processes; holds no state that a sample changes.

    May say `run`: so many indices that follow each other (n run ... n run + run - 1) share what is costly to make.
    """

    def __len__(self) -> int:
        """How many different indices there are (worlds, photos, frames)."""

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample, see `batches.Batch`: the same for the same index and the same state of `rng`, on any day."""


class Mixture:
    """A SampleSource. As long as the longest of its sources; the others begin again."""

    def __init__(self, parts: Mapping[str, tuple[SampleSource, float]]) -> None:
        total = sum(share for _, share in parts.values())
        self.kinds = tuple(parts)
        self.sources = tuple(source for source, _ in parts.values())
        self.until = np.cumsum([share / total for _, share in parts.values()])
        self.run = max(int(getattr(source, "run", 1)) for source in self.sources)

    def __len__(self) -> int:
        return max(len(source) for source in self.sources)

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample of one of the kinds."""
        number = self.drawn(rng)
        return self.sources[number].sample(index % len(self.sources[number]), rng)

    def drawn(self, rng: np.random.Generator) -> int:
        """Which source the next sample is of."""
        return min(int(np.searchsorted(self.until, rng.random(), "right")), len(self.sources) - 1)


@dataclass(frozen=True)
class Found:
    """What lies behind --data, not yet read."""

    photos: tuple[Photo, ...] = ()
    takes: tuple[Take, ...] = ()

    def of(self, kind: str) -> tuple[Take, ...]:
        """The takes of one kind: frame, removal, stereo."""
        return tuple(take for take in self.takes if take.kind == kind)


def source_for(settings: TrainSettings, data: Sequence[Path], split: Split) -> SampleSource:
    """The source of a run's samples; the held-out ones share no world, photo or frame with the trained ones.

    Raises:
        InputError: `data` names nothing that can be read or is of use, or the mixture needs files and there are none.
    """
    kinds = set(settings.data.mixture)
    found = gathered(data)
    _check_use(kinds, data, found)
    ours = _split(found, kinds, split)
    if data:
        LOG.info("%s: %s", split, told(ours, settings))
    made = {kind: (MAKERS[kind](settings, ours, split), share) for kind, share in settings.data.mixture.items()}
    if len(made) == 1:
        return next(iter(made.values()))[0]
    return Mixture(made)


def told(found: Found, settings: TrainSettings) -> str:
    """What of --data is used, and what feeds the kinds that worlds can feed too."""
    from dlama.training.data.cases import WORDS

    counts = {"photos": len(found.photos)} | {words: len(found.of(kind)) for kind, words in WORDS.items()}
    parts = [", ".join(f"{count} {words}" for words, count in counts.items() if count)]
    for kind in sorted({"removal", "stereo"} & set(settings.data.mixture)):
        share = settings.data.cases if found.of(kind) else 0.0
        parts.append(f"{share:.0%} of kind '{kind}' are made of them, {1 - share:.0%} of worlds")
    return "; ".join(parts)


def gathered(data: Sequence[Path]) -> Found:
    """The photos and takes of folders of pictures, data sets and packs. InputError, FileError."""
    if not data:
        return Found()
    photos: list[Photo] = []
    takes: list[Take] = []
    for path in map(Path, data):
        more_photos, more_takes = _of_file(path) if path.is_file() else _of_folder(path)
        photos += more_photos
        takes += more_takes
    return Found(tuple(photos), tuple(takes))


def _of_file(path: Path) -> tuple[Sequence[Photo], Sequence[Take]]:
    from dlama.training.data.pack_reader import read_pack

    return read_pack(path)


def _of_folder(path: Path) -> tuple[Sequence[Photo], Sequence[Take]]:
    """A data set of a known layout, or else a folder of pictures."""
    from dlama.datasets.layouts import LAYOUTS, detect, open_dataset
    from dlama.training.data.cases import takes_of
    from dlama.training.data.photos import folder_photos

    if not path.is_dir():
        raise FileError(f"{path}: no such file or folder; pictures, a data set or a pack is wanted")
    try:
        layout = detect(path)
    except InputError as error:
        if " may be " in str(error):  # a data set, but of two layouts: no folder of pictures
            raise
        return folder_photos(path), ()
    takes = takes_of(open_dataset(path, layout))
    if not takes:
        raise InputError(
            f"{path}: has no two frames of one scene with depth and poses ({LAYOUTS[layout].looked_for}), no frame with and "
            "without a thing and no stereo pair; for its pictures alone, name the folder that holds nothing else"
        )
    return (), takes


def _check_use(kinds: set[str], data: Sequence[Path], found: Found) -> None:
    """Refuse kinds without their files, and files without a kind."""
    named = ", ".join(map(str, data)) or "no file"
    for kind in sorted(kinds & PHOTO_KINDS):
        if not found.photos:
            raise InputError(f"data.mixture has {kind!r}, which needs photos, but --data names {named}")
    if "frame" in kinds and not found.of("frame"):
        raise InputError(f"data.mixture has 'frame', which needs a posed data set, but --data names {named}")
    if data and not (found.photos and kinds & USES_PHOTOS) and not _used(found, kinds):
        raise InputError(f"data.mixture is {', '.join(sorted(kinds))}, which has no use for --data {named}")


def _used(found: Found, kinds: set[str]) -> tuple[Take, ...]:
    """The takes that these kinds of samples are made of."""
    wanted = {USES_TAKES[kind] for kind in kinds & set(USES_TAKES)}
    return tuple(take for take in found.takes if take.kind in wanted)


def _split(found: Found, kinds: set[str], split: Split) -> Found:
    """The photos and takes of one split that these kinds use."""
    from dlama.training.data.cases import split_takes
    from dlama.training.data.photos import split_photos

    photos = split_photos(found.photos, split) if found.photos and kinds & USES_PHOTOS else ()
    used = _used(found, kinds)
    return Found(photos, split_takes(used, split) if used else ())


def _sketches(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    from dlama.training.data.toy_scenes import Sketches

    return Sketches(settings.network, settings.data.size, split)


def _photos(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    from dlama.training.data.photo_samples import PhotoSamples

    return PhotoSamples(found.photos, settings.network, settings.data.size)


def _warped_photos(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    """Holes of the data set's depth where there is one, else of worlds'."""
    from dlama.training.data.frame_samples import FrameSamples
    from dlama.training.data.photo_samples import WarpedPhotoSamples, world_shapes

    size = settings.data.size
    shapes: Shapes = functools.partial(world_shapes, split=split)
    if found.of("frame"):
        shapes = FrameSamples(found.of("frame"), settings.network, size).shape
    return WarpedPhotoSamples(found.photos, settings.network, size, shapes)


def _worlds(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    from dlama.training.data.world_samples import WorldSamples
    from dlama.training.data.world_views import Galleries

    return WorldSamples(Galleries(split, settings.data.size, found.photos), settings.network)


def _removals(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    from dlama.training.data.case_samples import CaseRemovals
    from dlama.training.data.world_samples import RemovalSamples
    from dlama.training.data.world_views import Galleries

    worlds = RemovalSamples(Galleries(split, settings.data.size, found.photos), settings.network)
    takes = found.of("removal")
    return _shared(settings, CaseRemovals(takes, settings.network, settings.data.size), worlds) if takes else worlds


def _stereo(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    from dlama.training.data.case_samples import CasePairs
    from dlama.training.data.world_samples import StereoSamples
    from dlama.training.data.world_views import Galleries

    worlds = StereoSamples(Galleries(split, settings.data.size, found.photos), settings.network)
    takes = found.of("stereo")
    return _shared(settings, CasePairs(takes, settings.network, settings.data.size), worlds) if takes else worlds


def _shared(settings: TrainSettings, cases: SampleSource, worlds: SampleSource) -> SampleSource:
    """One kind, made of a data set's cases and of worlds."""
    share = settings.data.cases
    return Mixture({"cases": (cases, share), "worlds": (worlds, 1 - share)}) if share < 1 else cases


def _frames(settings: TrainSettings, found: Found, split: Split) -> SampleSource:
    from dlama.training.data.frame_samples import FrameSamples

    return FrameSamples(found.of("frame"), settings.network, settings.data.size)


MAKERS: dict[str, Callable[[TrainSettings, Found, Split], SampleSource]] = {
    "sketch": _sketches,
    "photo": _photos,
    "warped-photo": _warped_photos,
    "world": _worlds,
    "frame": _frames,
    "removal": _removals,
    "stereo": _stereo,
}
"""Every kind of `settings.SAMPLE_KINDS`."""
