"""What a visitor asks for (camera, method) in; the same checked, and as keyword arguments of the verbs, out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dlama.completion.verbs import target_camera
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.geometry.trajectories import PIVOT_M
from dlama.inpainters import AUTO, FILLERS
from dlama.web.failures import PageError
from dlama.web.inputs import number

RECIPES = ("dlama", "paper")
PAGE_FILLERS = (AUTO, *(name for name, record in FILLERS.items() if not record.needs_model or record.shipped))
"""Fillers that run without a file of the user's."""
LIMITS = {"yaw": 180.0, "pitch": 89.0, "dolly": 1000.0, "pivot": 10_000.0}


@dataclass(frozen=True)
class CompletionRequest:
    """Where the camera is to stand, and how the scene is to be completed."""

    yaw: float = 0.0
    pitch: float = 0.0
    dolly: float = 0.0
    pivot: float | str = PIVOT_M
    """Metres, or "auto"."""
    method: Mapping[str, Any] = field(default_factory=dict)
    """Keyword arguments of the verbs that differ from their defaults: filler, recipe, dilate, seed, min_confidence."""

    @property
    def move(self) -> dict[str, Any]:
        """Keyword arguments of `view` and `remove`."""
        return {"yaw": self.yaw, "pitch": self.pitch, "pivot": self.pivot, "dolly": self.dolly}

    def camera(self, rgbd: RGBD) -> Camera:
        """Where it stands. InputError."""
        return target_camera(rgbd, **self.move)


def read_request(fields: Mapping[str, Any]) -> CompletionRequest:
    """What the page asked for. PageError."""
    values: dict[str, Any] = {}
    for name, most in LIMITS.items():
        given = fields.get(name)
        if given in (None, ""):
            continue
        if name == "pivot" and given == "auto":
            values[name] = "auto"
            continue
        values[name] = number(name, given, "move")
        if not (0 if name == "pivot" else -most) <= values[name] <= most:
            raise PageError(
                f"{name} is {values[name]:g}; {0 if name == 'pivot' else -most:g} to {most:g} is expected", "move"
            )
    return CompletionRequest(**values, method=read_method(fields))


def read_method(fields: Mapping[str, Any]) -> dict[str, Any]:
    """How the scene is to be completed, as far as it differs from the defaults. PageError."""
    method: dict[str, Any] = {}
    for name, known in (("filler", PAGE_FILLERS), ("recipe", RECIPES)):
        given = fields.get(name) or known[0]
        if given not in known:
            raise PageError(f"{name} is {str(given)[:40]!r}; one of {', '.join(known)} is expected", "method")
        if given != known[0]:
            method[name] = given
    for name, default, most in (("dilate", None, 200), ("seed", 0, 2**31)):
        if fields.get(name) not in (None, ""):
            whole = round(number(name, fields[name], "method"))
            if not 0 <= whole <= most:
                raise PageError(f"{name} is {whole}; 0 to {most} is expected", "method")
            if whole != default:
                method[name] = whole
    if fields.get("min_confidence") not in (None, "", 0):
        sure = number("min_confidence", fields["min_confidence"], "method")
        if not 0 <= sure <= 1:
            raise PageError(f"min_confidence is {sure:g}; 0 to 1 is expected", "method")
        if sure:
            method["min_confidence"] = sure
    return method
