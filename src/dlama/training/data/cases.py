"""Cases of data sets in -> those of one split out, so that no scene or frame is both trained on and held out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dlama.datasets.frames import Case, Protocol
from dlama.errors import InputError
from dlama.training.data.photos import held_out_names

CASES: dict[Protocol, str] = {"vpi": "pairs of posed frames", "ori": "removals", "sii": "stereo pairs"}
"""Protocols whose cases samples are made of, as messages call them."""
FRAME_SEPARATOR = "_to_"
"""Between the names of two frames in the name of a case."""


def frames_of(case: Case) -> frozenset[str]:
    """Names of the frames that a case shows."""
    return frozenset(case.frame.split(FRAME_SEPARATOR))


def scene_of(case: Case) -> str:
    """data set/scene."""
    return f"{case.dataset}/{case.scene}"


def split_cases(cases: Sequence[Case], split: str) -> tuple[Case, ...]:
    """The cases of one split (`train` or `held_out`).

    Where there are several scenes, whole scenes are held out; of one scene, cases are, and no case that shares a frame with a
    held-out one is trained on. InputError where a protocol would have no case in one of the splits.
    """
    several = len({scene_of(case) for case in cases}) > 1
    held = _held_out(cases, several)
    chosen = tuple(case for case in cases if case in held)
    if split == "held_out":
        return chosen
    held_frames = frozenset[str]() if several else frozenset().union(*map(frames_of, chosen))
    rest = tuple(case for case in cases if case not in held and not frames_of(case) & held_frames)
    left = {case.protocol for case in rest}
    for protocol, own in _by_protocol(cases).items():
        if protocol not in left:
            raise InputError(
                f"all {len(own)} {CASES[protocol]} of {scene_of(own[0])} share frames or scenes with the held-out ones; "
                "more scenes are expected"
            )
    return rest


def _held_out(cases: Sequence[Case], whole_scenes: bool) -> set[Case]:
    """Of each protocol one case at least; or all cases of the scenes of which each protocol has one at least."""
    found: set[Case] = set()
    for protocol, own in _by_protocol(cases).items():
        if whole_scenes:
            scenes = held_out_names({scene_of(case) for case in own}, f"scenes with {CASES[protocol]}")
            found |= {case for case in cases if scene_of(case) in scenes}
        else:
            names = held_out_names({case.frame for case in own}, CASES[protocol])
            found |= {case for case in own if case.frame in names}
    return found


def _by_protocol(cases: Iterable[Case]) -> dict[Protocol, list[Case]]:
    found: dict[Protocol, list[Case]] = {}
    for case in cases:
        found.setdefault(case.protocol, []).append(case)
    return found
