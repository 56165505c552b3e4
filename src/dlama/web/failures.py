"""An error of the library in; what the page shows, and the field that it belongs beside, out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from dlama.errors import CameraError, DepthError, DlamaError, InputError, MaskError

FIELDS = (
    ("camera", ("fov", "fx", "fy", "cx", "cy", "camera", "pixel_center")),
    ("calib", ("calib", "baseline")),
    ("scale", ("depth_scale", "depth_range", "channel", "far", "resize_depth")),
    ("known", ("metres_at", "camera_height", "depth_model")),
    ("marks", ("clicks", "not_clicks", "box", "mask", "dilate")),
    ("move", ("yaw", "pitch", "dolly", "pivot")),
    ("method", ("filler", "model", "recipe", "seed", "min_confidence", "mode", "clip", "depth_by")),
)
"""Field of the page -> parameters that a message may name."""
KINDS: tuple[tuple[type[DlamaError], str], ...] = ((CameraError, "camera"), (DepthError, "depth"), (MaskError, "marks"))
"""Kind of an error -> the field it is about where nothing else says so."""


class PageError(InputError):
    """What the page sent cannot be used; `field` names the part of the page that the message belongs beside."""

    def __init__(self, message: str, field: str = "", status: int = 400) -> None:
        super().__init__(message)
        self.field = field
        self.status = status


def field_of(error: DlamaError, files: Mapping[str, Path]) -> str:
    """The field of the page that an error belongs beside: the file it names, else the parameter, else its kind; "": none.

    files: role -> where that upload lies.
    """
    if isinstance(error, PageError):
        return error.field
    message = str(error)
    asked = next((name for name, words in FIELDS if re.search(rf"\bgive `?({'|'.join(words)})\b", message)), "")
    named = [role for role, path in files.items() if message.startswith(str(path))]
    if named or asked:
        return asked if asked in ("camera", "scale") else named[0] if named else asked
    for name, words in FIELDS:
        if re.match(rf"`?({'|'.join(words)})`?( is | hold|=| and )", message):
            return name
    return next((field for kind, field in KINDS if isinstance(error, kind)), "")


def shown(message: str, names: Mapping[Path, str]) -> str:
    """A message with the visitor's own names of the files (`names`: our path -> theirs) in place of ours."""
    words = {str(path): name for path, name in names.items()} | {path.name: name for path, name in names.items()}
    if not words:
        return message
    longest_first = "|".join(re.escape(word) for word in sorted(words, key=len, reverse=True))
    return re.sub(rf"(?<![\w.-])(?:{longest_first})(?![\w-])", lambda match: words[match[0]], message)
