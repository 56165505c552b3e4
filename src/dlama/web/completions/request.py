"""What a visitor asks for (camera, method) in; the same checked, and as keyword arguments of the verbs, out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dlama.completion.options import Options
from dlama.completion.verbs import target_camera
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.jobs.early import check_options
from dlama.jobs.parameters import MOVE
from dlama.web.answers import PageError
from dlama.web.form import parsers_of, read_fields

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

    def camera(self, rgbd: RGBD) -> Camera:
        """Where it stands. InputError."""
        return target_camera(rgbd, **self.move)


def read_request(fields: Mapping[str, Any]) -> CompletionRequest:
    """What the page asked for; what differs from its default. InputError."""
    given = read_fields(MOVES | parsers_of("method"), fields)
    check_options(given)
    if given.get("dilate", 0) > MOST_DILATION:
        raise PageError(f"`dilate` is {given['dilate']}; 0 to {MOST_DILATION} is expected", "method")
    move = {name: value for name, value in given.items() if name in MOVES and value not in (0, "auto")}
    method = {name: one for name, one in given.items() if name not in MOVES and one != getattr(Options, name)}
    return CompletionRequest(move, method)
