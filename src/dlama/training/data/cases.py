"""A dataset in -> its cases as training uses them, by kind of sample, and the split into trained and held-out ones, out."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from dlama.datasets.frames import Case, Dataset, StereoTruth
from dlama.errors import InputError
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.training.data.photos import held_out_names

KIND_OF_PROTOCOL = {"vpi": "frame", "ori": "removal", "sii": "stereo"}
"""Protocol of a dataset case -> kind of training case."""
KIND_NAMES = {"frame": "pairs of posed frames", "removal": "removals", "stereo": "stereo pairs"}
"""Kinds of training cases in messages."""
FRAME_SEPARATOR = "_to_"
"""Between the names of two frames in the name of a case."""


@dataclass(frozen=True, eq=False)
class TrainingCase:
    """A dataset case that samples are made of; its files are read by `load`."""

    kind: str
    """frame, removal or stereo."""
    scene: str
    """dataset/scene."""
    name: str
    """Of the frame, or of both frames with FRAME_SEPARATOR between them."""
    frames: frozenset[str]
    """Names of the frames it shows, so that no frame is both trained on and held out."""
    load: Callable[[], Any]
    """Reads a ViewTruth (frame), a RemovalTruth (removal) or a StereoPair (stereo); picklable."""


@dataclass(frozen=True, eq=False)
class StereoPair:
    """A rectified pair without its rig: networks for pairs are given no metres."""

    left: UInt8Array
    """H x W x 3 RGB."""
    right: UInt8Array
    """H x W x 3 RGB."""
    disparity: Float32Array
    """H x W px in the left picture, 0 = unknown: right column = left column - disparity."""
    masks: tuple[BoolArray, BoolArray] | None = None
    """H x W, left and right, True = the object that is missing from `without`; None where there is no such object."""
    without: tuple[UInt8Array, UInt8Array] | None = None
    """Both pictures without the object, H x W x 3 RGB."""


def training_cases(dataset: Dataset) -> tuple[TrainingCase, ...]:
    """All cases of a dataset, in its order."""
    return tuple(_training_case(case) for case in dataset.cases)


def _training_case(case: Case) -> TrainingCase:
    load = functools.partial(read_stereo, case.load) if case.protocol == "sii" else case.load  # type: ignore[arg-type]
    frames = frozenset(case.frame.split(FRAME_SEPARATOR))
    return TrainingCase(KIND_OF_PROTOCOL[case.protocol], f"{case.dataset}/{case.scene}", case.frame, frames, load)


def read_stereo(load: Callable[[], StereoTruth]) -> StereoPair:
    """The pair of a case of protocol `sii`; raises what `load` raises."""
    truth = load()
    masks = without = None
    if truth.mask_left is not None and truth.mask_right is not None and truth.without_left and truth.without_right:
        masks = truth.mask_left, truth.mask_right
        without = truth.without_left.color, truth.without_right.color
    return StereoPair(truth.left, truth.right, truth.disparity_left, masks, without)


def split_cases(cases: Sequence[TrainingCase], split: str) -> tuple[TrainingCase, ...]:
    """The cases of one split (`train` or `held_out`).

    Where there are several scenes, whole scenes are held out; of one scene, cases are, and no case that shares a frame with a
    held-out one is trained on. InputError where a kind would have no case in one of the splits.
    """
    several = len({case.scene for case in cases}) > 1
    held = _held_out(cases, several)
    chosen = tuple(case for case in cases if case in held)
    if split == "held_out":
        return chosen
    held_frames = frozenset[str]() if several else frozenset().union(*(case.frames for case in chosen))
    rest = tuple(case for case in cases if case not in held and not case.frames & held_frames)
    left = {case.kind for case in rest}
    for kind, own in _by_kind(cases).items():
        if kind not in left:
            raise InputError(
                f"all {len(own)} {KIND_NAMES[kind]} of {own[0].scene} share frames or scenes with the held-out ones; "
                "more scenes are expected"
            )
    return rest


def _held_out(cases: Sequence[TrainingCase], whole_scenes: bool) -> set[TrainingCase]:
    """Of each kind one case at least; or all cases of the scenes of which each kind has one at least."""
    found: set[TrainingCase] = set()
    for kind, own in _by_kind(cases).items():
        if whole_scenes:
            scenes = held_out_names({case.scene for case in own}, f"scenes with {KIND_NAMES[kind]}")
            found |= {case for case in cases if case.scene in scenes}
        else:
            names = held_out_names({case.name for case in own}, KIND_NAMES[kind])
            found |= {case for case in own if case.name in names}
    return found


def _by_kind(cases: Iterable[TrainingCase]) -> dict[str, list[TrainingCase]]:
    found: dict[str, list[TrainingCase]] = {}
    for case in cases:
        found.setdefault(case.kind, []).append(case)
    return found
