"""The verbs of a job list and their parameters, as they are typed or stand in JSON, in; checked values out.

Names and types are those of `dlama.jobs.options`, of which the command line is made too.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from dlama.completion.options import Options, options_in, raise_all
from dlama.errors import InputError
from dlama.inpainters import FILLER_NAMES
from dlama.jobs import options

Parse = Callable[[str, Any], Any]
"""(name, value as typed or from JSON) -> value. Raises InputError."""
YES, NO = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


def text(name: str, value: Any) -> str:
    """Any text; of a path its text."""
    found = os.fspath(value) if isinstance(value, os.PathLike) else value
    if not isinstance(found, str) or "\0" in found:
        raise InputError(f"`{name}` is {value!r}; a text is expected")
    return found


def number(name: str, value: Any) -> float:
    """A finite number."""
    try:
        if isinstance(value, bool):
            raise ValueError
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"`{name}` is {value!r}; a number is expected") from None
    if not math.isfinite(found):
        raise InputError(f"`{name}` is {value!r}; a finite number is expected")
    return found


def whole_number(name: str, value: Any) -> int:
    """A whole number."""
    found = number(name, value)
    if found != int(found):
        raise InputError(f"`{name}` is {value!r}; a whole number is expected")
    return int(found)


def switch(name: str, value: Any) -> bool:
    """True or false, also in words."""
    word = str(value).lower()
    if word not in YES + NO:
        raise InputError(f"`{name}` is {value!r}; true or false is expected")
    return word in YES


def one_of(*names: str) -> Parse:
    """One of these words."""

    def parse(name: str, value: Any) -> str:
        if not isinstance(value, str) or value not in names:
            raise InputError(f"`{name}` is {value!r}; one of {', '.join(names)} is expected")
        return str(value)

    return parse


def pivot(name: str, value: Any) -> float | str:
    """Metres, or auto."""
    return "auto" if isinstance(value, str) and value == "auto" else number(name, value)


def numbers(name: str, value: Any, count: int, expected: str) -> list[float]:
    """So many numbers, separated by commas or as a list; raises InputError that says what is `expected`."""
    parts = value.split(",") if isinstance(value, str) else value
    try:
        found = [float(part) for part in parts]
    except (TypeError, ValueError, OverflowError):
        found = []
    if len(found) != count:
        raise InputError(f"`{name}` is {value!r}; {expected} in pixels is expected")
    return found


def points(name: str, value: Any) -> list[list[float]]:
    """`X,Y X,Y`, a list of pairs, or one pair."""
    if isinstance(value, (list, tuple)) and len(value) == 2 and all(isinstance(one, (int, float)) for one in value):
        value = [value]
    return [numbers(name, one, 2, "X,Y") for one in _split_values(name, value, "X,Y")]


def box(name: str, value: Any) -> list[float]:
    """`X,Y,W,H`, or a list of four."""
    return numbers(name, value, 4, "X,Y,W,H")


def metres_at(name: str, value: Any) -> tuple[tuple[float, float, float], ...]:
    """`X,Y=D X,Y=D`, or a list of such texts or of threes."""
    return tuple(_known_depth(name, one) for one in _split_values(name, value, "X,Y=D"))


def _known_depth(name: str, value: Any) -> tuple[float, float, float]:
    """(x, y, metres) of `X,Y=D`, or of a list of three."""
    word = value if isinstance(value, str) else "{},{}={}".format(*_split_values(name, value, "X,Y=D", 3))
    try:
        pixel, metres = word.split("=")
        x, y = pixel.split(",")
        return float(x), float(y), float(metres)
    except ValueError:
        raise InputError(
            f"`{name}` is {word!r}; X,Y=D is expected: a pixel and its depth in metres, such as 320,400=2.5"
        ) from None


def results(name: str, value: Any) -> tuple[str, ...]:
    """`NAME,NAME`, or a list of names; `write` knows which there are."""
    names = value.split(",") if isinstance(value, str) else _split_values(name, value, "NAME,NAME")
    return tuple(str(one).strip() for one in names if str(one).strip())


def _split_values(name: str, value: Any, expected: str, count: int | None = None) -> Sequence[Any]:
    """A list (of `count`), or the words of a text; InputError, which says what is `expected`, for what is neither."""
    try:
        found = value.split() if isinstance(value, str) else list(value)
    except TypeError:
        found = None
    if found is None or (count is not None and len(found) != count):
        raise InputError(f"`{name}` is {value!r}; {expected} is expected, or a list")
    return found


KINDS: dict[Any, Parse] = {str: text, Path: text, int: whole_number, float: number, bool: switch}
OWN_FORM: dict[str, Parse] = {
    "pivot": pivot, "metres_at": metres_at, "click": points, "not_click": points, "box": box, "only": results, "also": results,
    "filler": one_of(*FILLER_NAMES),
}  # fmt: skip
"""Options that are more than one value of such a kind."""


def parsers(group: Any) -> dict[str, Parse]:
    """The options of a group, with what reads each."""
    return {name: OWN_FORM.get(name) or parser_of(one.kind) for name, one in options_in(group).items()}


def parser_of(kind: Any) -> Parse:
    """What reads a value of that type; None in it means that the option may be left out."""
    if get_origin(kind) is Literal:
        return one_of(*get_args(kind))
    return KINDS[kind] if kind in KINDS else parser_of(next(one for one in get_args(kind) if one is not type(None)))


MOVE, LENS, READING = parsers(options.Move), parsers(options.Lens), parsers(options.Reading)
ESTIMATING, MASKING, POINTING = parsers(options.Estimating), parsers(options.Masking), parsers(options.Pointing)
RESULTS = parsers(options.Results)
METHOD = parsers(Options)
PAIR: dict[str, Parse] = {
    **dict.fromkeys(("left", "right", "calib", "mask", "mask_right", "disparity"), text),
    **parsers(options.Pair),
    "far": number,
}
PICTURE: dict[str, Parse] = {"image": text, "depth": text, **MOVE, **LENS, **READING, **ESTIMATING, **METHOD}

VERBS: dict[str, dict[str, Parse]] = {
    "view": {**PICTURE, **RESULTS},
    "remove": {**PICTURE, "mask": text, **MASKING, **POINTING, **RESULTS},
    "stereo": {**PAIR, **MOVE, **MASKING, **POINTING, **METHOD, **RESULTS},
    "depth": {"image": text, "far": number, **LENS, **ESTIMATING},
}
"""Verb -> its parameters."""
NEEDED: dict[str, tuple[str, ...]] = {
    "view": ("image",),
    "remove": ("image",),
    "stereo": ("left", "right", "calib"),
    "depth": ("image",),
}
FILES = ("image", "depth", "mask", "camera", "to", "left", "right", "calib", "mask_right", "disparity")
"""Parameters that name input files."""
NETWORKS = ("model", "depth_model", "matcher")
"""Parameters that name a network file, or a network by its name."""
EXCLUDED: dict[str, tuple[str, ...]] = {
    "camera": ("fov", "fx", "fy", "cx", "cy", "pixel_center"), "fov": ("camera", "fx", "fy"), "fx": ("camera", "fov"),
    "fy": ("camera",), "cx": ("camera",), "cy": ("camera",), "pixel_center": ("camera",),
    "to": ("yaw", "pitch", "pivot", "dolly"), "yaw": ("to",), "pitch": ("to",), "dolly": ("to",),
}  # fmt: skip
"""Parameter -> the others that say the same in another way: where a row has the one, defaults of the others do not count."""
KNOWN = tuple(dict.fromkeys(name for names in VERBS.values() for name in names))
"""Every parameter of every verb."""


def check_parameters(
    verb: str, given: Mapping[str, Any], loaded: bool = False, *further: Callable[[dict[str, Any]], object]
) -> dict[str, Any]:
    """The values of a job's parameters. InputError: an unknown verb or parameter, one that is missing; and, all of them in one
    message, values that cannot be, contradictions, and what `further` checks of the values raise.

    loaded: its inputs come from a data set, so none need be named.
    """
    one_of(*VERBS)("verb", verb)
    known = VERBS[verb]
    for name in given:
        if name not in known:
            raise InputError(f"`{name}` does not apply to {verb}; its parameters are {', '.join(known)}")
    for name in NEEDED[verb]:
        if name not in given and not loaded:
            raise InputError(f"`{name}` is missing; {verb} needs {', '.join(NEEDED[verb])}")
    return read_parameters(known, given, lambda _: _check_target(verb, given), _check_object, *further)


def read_parameters(
    known: Mapping[str, Parse], given: Mapping[str, Any], *checks: Callable[[dict[str, Any]], object]
) -> dict[str, Any]:
    """The values of parameters of the `known` names, which the checks take; InputError, which says all that is wrong."""
    found: dict[str, Any] = {}

    def read(name: str) -> None:
        found[name] = known[name](name, given[name])

    raise_all([*(partial(read, name) for name in given), *(partial(check, found) for check in checks)])
    return found


def _check_target(verb: str, given: Mapping[str, Any]) -> None:
    """InputError where no camera move is given, or a target camera and an orbit were both given."""
    moves = [name for name in ("yaw", "pitch", "dolly") if name in given]
    if verb == "view" and not moves and "to" not in given:
        raise InputError(
            "no camera move is given: give `yaw=DEG` (positive: to the right), `pitch=DEG`, `dolly=METRES` or `to=TARGET.json`"
        )
    if "to" in given and moves:
        raise InputError(f"`to=TARGET.json` and `{moves[0]}` contradict each other; give one of them")


def _check_object(found: Mapping[str, Any]) -> None:
    """InputError where a mask file was given with clicks or a box."""
    if "mask" in found and is_pointed(found):
        raise InputError(f"a mask file ({found['mask']}) and clicks or a box were both given; one of them is expected")


def typed(value: Any) -> str:
    """A number, to its last digit, or a name, as it is typed."""
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def is_pointed(given: Mapping[str, Any]) -> bool:
    """Whether these options say which object is meant."""
    words = ("click", "not_click", "box", "salient", "object_class")
    return any(given.get(name) for name in words) or given.get("masker") == "salient"


def is_moved(given: Mapping[str, Any]) -> bool:
    """Whether these options move the camera."""
    return any(given.get(name) for name in ("yaw", "pitch", "dolly", "to"))


def mask_settings(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of `options.Pointing` as keyword arguments of find_mask, which has no `object_class`; raises InputError."""
    pointing = options.Pointing(**given)
    if pointing.salient and pointing.masker not in (None, "salient"):
        raise InputError(f"`salient=True` and `masker={pointing.masker}` contradict each other; give one of them")
    return {
        "clicks": points("click", pointing.click),
        "not_clicks": points("not_click", pointing.not_click),
        "box": None if pointing.box is None else POINTING["box"]("box", pointing.box),
        "masker": "salient" if pointing.salient else pointing.masker,
        "mask_model": pointing.mask_model,
        "candidate": pointing.candidate,
        "with_shadow": pointing.with_shadow,
    }
