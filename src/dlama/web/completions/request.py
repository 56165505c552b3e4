"""What a visitor asks for (camera, method) in; the same checked, and as keyword arguments of the verbs, out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dlama.completion.options import RECIPE_NAMES, Options, options_of
from dlama.completion.verbs import target_camera
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.inpainters import AUTO, FILLERS
from dlama.jobs.parameters import METHOD
from dlama.web.answers import PageError
from dlama.web.inputs import number

PAGE_FILLERS = (AUTO, *(name for name, record in FILLERS.items() if not record.needs_model or record.shipped))
"""Fillers that run without a file of the user's."""
PAGE_OPTIONS = ("filler", "recipe", "dilate", "seed", "min_confidence")
"""Options of the library that the page has."""
MOST_DILATION = 200
LIMITS = {"yaw": 180.0, "pitch": 89.0, "dolly": 1000.0, "pivot": 10_000.0}


@dataclass(frozen=True)
class CompletionRequest:
    """Where the camera is to stand, and how the scene is to be completed: keyword arguments of the verbs that differ from their
    defaults."""

    move: Mapping[str, Any]
    """yaw, pitch, dolly, pivot."""
    method: Mapping[str, Any]
    """Options (PAGE_OPTIONS)."""

    def camera(self, rgbd: RGBD) -> Camera:
        """Where it stands. InputError."""
        return target_camera(rgbd, **self.move)


def read_request(fields: Mapping[str, Any]) -> CompletionRequest:
    """What the page asked for. PageError."""
    move: dict[str, Any] = {}
    for name, most in LIMITS.items():
        given = fields.get(name)
        if given in (None, "", "auto"):
            continue
        move[name] = number(name, given, "move")
        if not (0 if name == "pivot" else -most) <= move[name] <= most:
            raise PageError(
                f"`{name}` is {move[name]:g}; {0 if name == 'pivot' else -most:g} to {most:g} is expected", "move"
            )
    return CompletionRequest({name: value for name, value in move.items() if value}, read_method(fields))


def read_method(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The options that differ from their defaults. PageError."""
    given = {name: fields[name] for name in PAGE_OPTIONS if fields.get(name) not in (None, "")}
    try:
        found = {name: METHOD[name](name, value) for name, value in given.items()}
        options = options_of(found)
    except InputError as error:
        raise PageError(error.marked, "method") from None
    for name, known in (("filler", PAGE_FILLERS), ("recipe", RECIPE_NAMES)):
        if getattr(options, name) not in known:
            raise PageError(f"`{name}` is {found[name]!r}; one of {', '.join(known)} is expected", "method")
    if (options.dilate or 0) > MOST_DILATION:
        raise PageError(f"`dilate` is {options.dilate}; 0 to {MOST_DILATION} is expected", "method")
    return {name: value for name, value in found.items() if value != getattr(Options, name, None)}
