"""A data set in; the rows of the protocol `sequence` of all its scenes, of held-out frames and of removals, out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from dlama.datasets.frames import Dataset, Frame, RemovalTruth
from dlama.errors import InputError
from dlama.evaluation.protocols.methods import ProtocolSettings
from dlama.evaluation.protocols.sequence import COUNTS, METHODS, Row, score_sequence
from dlama.evaluation.protocols.sequence_removal import score_removal
from dlama.geometry.frames.alignment import align_frames
from dlama.geometry.rgbd import RGBD

HELD_OUT = 5
"""Frames of a scene, evenly over the sequence, unless a limit says otherwise."""
DENSE, APART = 30, 2
"""From so many frames on, a held-out frame's sources are so many places away and more; of fewer its neighbours are sources."""
Progress = Callable[[int, int, str], None]
"""Called before each part: how many are done, of how many, and what comes next."""


class ReadFrames(Sequence[RGBD]):
    """Frames of a data set by place, each read when it is asked for."""

    def __init__(self, loaders: Sequence[Callable[[], RGBD]]) -> None:
        self._loaders = loaders

    def __len__(self) -> int:
        return len(self._loaders)

    def __getitem__(self, place):  # type: ignore[no-untyped-def]
        """The frame, read; or some of them, not read."""
        return ReadFrames(self._loaders[place]) if isinstance(place, slice) else self._loaders[place]()


def rows_of(dataset: Dataset, limit: int | None, settings: ProtocolSettings, progress: Progress) -> Iterator[Row]:
    """Scene after scene: held-out frames made of others, then removals, where there are any. InputError: too few frames."""
    named = dict.fromkeys(one.scene for one in dataset.frames)
    scenes = {name: sort_along_orbit([one for one in dataset.frames if one.scene == name]) for name in named}
    if not any(len(frames) > source_distance(frames) for frames in scenes.values()):
        raise InputError(f"{dataset.name}: no scene of it has {APART + 1} posed frames; so many or more are expected")
    parts = [(name, place) for name, frames in scenes.items() for place in held_out_places(len(frames), limit)]
    removals = [name for name in scenes if any(case.scene == name for case in dataset.of("ori"))]
    read = {name: ReadFrames(align_frames([frame.load for frame in frames])) for name, frames in scenes.items()}
    for done, (name, place) in enumerate(parts):
        frames = scenes[name]
        names = [f"{name}/{frame.name}" if len(scenes) > 1 else frame.name for frame in frames]
        progress(done, len(parts) + len(removals), names[place])
        yield from score_sequence(read[name], [place], names, settings, METHODS, COUNTS, apart=source_distance(frames))
    for done, name in enumerate(removals, len(parts)):
        progress(done, len(parts) + len(removals), f"{name}, removal")
        cases = sorted((case for case in dataset.of("ori") if case.scene == name), key=lambda case: abs(case.yaw or 0))
        views = [truth for truth in (case.load() for case in cases[: COUNTS[-1]]) if isinstance(truth, RemovalTruth)]
        yield from score_removal(views, name, settings)


def sort_along_orbit(frames: Sequence[Frame]) -> list[Frame]:
    """The frames of a scene along its orbit, where it has one, else as listed."""
    if all(frame.yaw is not None for frame in frames):
        return sorted({frame.yaw: frame for frame in frames}.values(), key=lambda frame: frame.yaw or 0)
    return list(frames)


def held_out_places(count: int, limit: int | None) -> list[int]:
    """Places of the frames that are held out, evenly over so many."""
    most = min(limit or HELD_OUT, count)
    return sorted({round((number + 0.5) * count / most - 0.5) for number in range(most)})


def source_distance(frames: Sequence[Frame]) -> int:
    """Places between a held-out frame and its nearest sources."""
    return APART if len(frames) >= DENSE else 1
