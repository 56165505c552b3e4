"""What a visitor typed into the page's form, or asks for, in; the options of the library, checked, out. The form itself is made
of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from dlama.completion.options import RECIPE_NAMES, Option, Options, options_in
from dlama.inpainters import AUTO, FILLERS
from dlama.jobs import options as groups
from dlama.jobs.early import check_options
from dlama.jobs.parameters import MOVE, Parse, one_of, parsers, read_parameters
from dlama.web.answers import PageError

CHOICES: dict[str, tuple[str, ...]] = {
    "filler": (AUTO, *(name for name, record in FILLERS.items() if not record.needs_model or record.shipped)),
    "recipe": RECIPE_NAMES,
}
"""Options of which the page offers these: fillers that run without a file of the user's."""
PARTS: dict[str, Any] = {
    "lens": groups.Lens, "depth": groups.Reading, "estimate": groups.Estimating, "method": Options
}  # fmt: skip
"""Part of the form -> its options, those with a label. None of them names a file."""
UNITS = {"DEG": "degrees", "METRES": "metres", "PX": "px"}
MOVES = {name: MOVE[name] for name in ("yaw", "pitch", "dolly", "pivot")}
MOST_DILATION = 200


@dataclass(frozen=True)
class CompletionRequest:
    """Where the camera is to stand, and how the scene is to be completed: keyword arguments of the verbs that differ from their
    defaults."""

    move: Mapping[str, Any]
    """yaw, pitch, dolly, pivot."""
    method: Mapping[str, Any]
    """Options of the form."""


def describe_form() -> dict[str, list[dict[str, Any]]]:
    """The fields of each part, for the page."""
    return {part: [describe_field(name, one) for name, one in labelled(part).items()] for part in PARTS}


def describe_field(name: str, one: Option) -> dict[str, Any]:
    """One field: choices of which one is chosen (or a single one, ticked or not), or else a text or a number that is typed."""
    words = next((get_args(each) for each in (one.kind, *get_args(one.kind)) if get_origin(each) is Literal), ())
    if one.kind is bool:
        words = ("true",)
    return {
        "name": name,
        "label": ", ".join(filter(None, (one.label, UNITS.get(one.metavar)))),
        "choices": list(CHOICES.get(name, words)),
        "hint": one.default if one.default != "none" else "" if one.metavar in UNITS else one.metavar,
        "help": one.text,
    }


def read_request(fields: Mapping[str, Any]) -> CompletionRequest:
    """What the page asked for; what differs from its default. InputError."""
    given = read_fields(MOVES | parsers_of("method"), fields)
    check_options(given)
    if given.get("dilate", 0) > MOST_DILATION:
        raise PageError(f"`dilate` is {given['dilate']}; 0 to {MOST_DILATION} is expected", "method")
    move = {name: value for name, value in given.items() if name in MOVES and value not in (0, "auto")}
    method = {name: one for name, one in given.items() if name not in MOVES and one != getattr(Options, name)}
    return CompletionRequest(move, method)


def labelled(part: str) -> dict[str, Option]:
    """The options of a part that the page has."""
    return {name: one for name, one in options_in(PARTS[part]).items() if one.label}


def parsers_of(part: str) -> dict[str, Parse]:
    """What reads each of them."""
    read = parsers(PARTS[part])
    return {name: one_of(*CHOICES[name]) if name in CHOICES else read[name] for name in labelled(part)}


def read_form(fields: Mapping[str, Any], *parts: str) -> dict[str, Any]:
    """The options of these parts that were filled in. InputError."""
    known = {name: parse for part in parts for name, parse in parsers_of(part).items()}
    return read_fields(known, fields)


def read_fields(known: Mapping[str, Parse], fields: Mapping[str, Any]) -> dict[str, Any]:
    """The values of the fields that were filled in, of those `known`. InputError."""
    return read_parameters(known, {name: fields[name] for name in known if fields.get(name) not in (None, "")})
