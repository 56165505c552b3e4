"""A data set in -> what its cases give training, by kind of sample, and which of it is held out, out."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from dlama.datasets.frames import Case, Dataset, StereoTruth
from dlama.errors import InputError
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.training.data.photos import held_out_of

KINDS = {"vpi": "frame", "ori": "removal", "sii": "stereo"}
"""Protocol of a case -> the kind of sample that is made of it."""
WORDS = {"frame": "pairs of posed frames", "removal": "removals", "stereo": "stereo pairs"}
"""The takes of a kind, for people."""
ARROW = "_to_"
"""Between the names of two frames in the name of a case."""


@dataclass(frozen=True, eq=False)
class Take:
    """What a data set has for one sample: question and answer, not yet read."""

    kind: str
    """frame, removal or stereo."""
    scene: str
    """With the data set's name before it."""
    name: str
    frames: frozenset[str]
    """The names of its frames, as far as they are known, so that no frame is trained on and held out."""
    load: Callable[[], Any]
    """Reads a ViewTruth (frame), a RemovalTruth (removal) or a StereoPair (stereo); picklable."""


@dataclass(frozen=True, eq=False)
class StereoPair:
    """A rectified pair, as far as networks for pairs learn from it: they see no metres, so there is no rig."""

    left: UInt8Array
    """H x W x 3."""
    right: UInt8Array
    disparity: Float32Array
    """H x W px in the left picture, 0 = unknown: right column = left column - disparity."""
    masks: tuple[BoolArray, BoolArray] | None = None
    """H x W, left and right, True = the thing that is gone from `without`; None where nothing is."""
    without: tuple[UInt8Array, UInt8Array] | None = None
    """Both pictures without it."""


def takes_of(dataset: Dataset) -> tuple[Take, ...]:
    """All that a data set has for training, in its order."""
    return tuple(_take(case) for case in dataset.cases)


def _take(case: Case) -> Take:
    load = functools.partial(read_stereo, case.load) if case.protocol == "sii" else case.load  # type: ignore[arg-type]
    names = frozenset(case.frame.split(ARROW))
    return Take(KINDS[case.protocol], f"{case.dataset}/{case.scene}", case.frame, names, load)


def read_stereo(load: Callable[[], StereoTruth]) -> StereoPair:
    """A case of protocol `sii`; raises what reading its files does."""
    truth = load()
    masks = without = None
    if truth.mask_left is not None and truth.mask_right is not None and truth.without_left and truth.without_right:
        masks = truth.mask_left, truth.mask_right
        without = truth.without_left.color, truth.without_right.color
    return StereoPair(truth.left, truth.right, truth.disparity_left, masks, without)


def split_takes(takes: Sequence[Take], split: str) -> tuple[Take, ...]:
    """The takes of one split (`train`, `held_out`): by scene where there are several; else no frame is on both sides.

    InputError where a kind would have nothing to train on, or nothing held out.
    """
    several = len({take.scene for take in takes}) > 1
    held = _held_scenes(takes) if several else _held_frames(takes)
    chosen = tuple(take for take in takes if take in held)
    if split == "held_out":
        return chosen
    taken = frozenset[str]() if several else frozenset().union(*(take.frames for take in chosen))
    rest = tuple(take for take in takes if take not in held and not take.frames & taken)
    for kind, own in _by_kind(takes).items():
        if not any(take.kind == kind for take in rest):
            raise InputError(
                f"all {len(own)} {WORDS[kind]} of {own[0].scene} share frames or scenes with the held-out ones; "
                "more scenes are wanted"
            )
    return rest


def _held_scenes(takes: Sequence[Take]) -> set[Take]:
    """Scenes are held out of all kinds at once, and each kind has one at least."""
    scenes: set[str] = set()
    for kind, own in _by_kind(takes).items():
        scenes |= held_out_of({take.scene for take in own}, f"scenes with {WORDS[kind]}")
    return {take for take in takes if take.scene in scenes}


def _held_frames(takes: Sequence[Take]) -> set[Take]:
    found: set[Take] = set()
    for kind, own in _by_kind(takes).items():
        names = held_out_of({take.name for take in own}, WORDS[kind])
        found |= {take for take in own if take.name in names}
    return found


def _by_kind(takes: Iterable[Take]) -> dict[str, list[Take]]:
    found: dict[str, list[Take]] = {}
    for take in takes:
        found.setdefault(take.kind, []).append(take)
    return found
