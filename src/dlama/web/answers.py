"""What a page sends and what answers it, as types; an error of the library in, what the page shows and at which field, out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dlama.completion.options import Options, options_in
from dlama.errors import CameraError, DepthError, DlamaError, InputError, MaskError, name_parameters, plain_name
from dlama.jobs.options import Estimating, Lens, Move, Reading

Fields = Mapping[str, Any]
"""What the page sent: JSON."""


@dataclass(frozen=True)
class Blob:
    """Bytes that are no JSON."""

    data: bytes
    kind: str
    """Media type."""
    name: str = ""
    """What a download of it is called."""
    headers: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Limits:
    """What the page takes."""

    megabytes: int = 64
    """Of one file."""
    megapixels: float = 16.0
    """Of one picture."""
    visits: int = 8
    """Pages open at once."""

    @property
    def bytes(self) -> int:
        """Of one file."""
        return self.megabytes * 2**20


FIELDS: dict[str, str] = {
    **dict.fromkeys(options_in(Options), "method"),
    **dict.fromkeys(options_in(Lens), "camera"),
    **dict.fromkeys(options_in(Reading), "scale"),
    **dict.fromkeys(options_in(Estimating), "known"),
    **dict.fromkeys(options_in(Move), "move"),
    **dict.fromkeys(("calib", "baseline"), "calib"),
    **dict.fromkeys(("clicks", "not_clicks", "box", "mask", "dilate", "mark", "radius", "grow"), "marks"),
}
"""Parameter that a message names -> field of the page."""
WORDS = {
    "camera": "a camera file",
    "camera=FILE.json": "a camera file",
    "depth_model": "network of depth (on the command line)",
    "clicks": "a click",
    "not_clicks": "a click outside the object",
    **{
        named: f"“{one.label}”"
        for group in (Options, Lens, Reading, Estimating)
        for name, one in options_in(group).items()
        if one.label
        for named in (name, plain_name(name, one.metavar))
    },
}
"""Parameter that a message of the library names, alone or with what stands for its value -> what the page calls it."""
KINDS: tuple[tuple[type[DlamaError], str], ...] = ((CameraError, "camera"), (DepthError, "depth"), (MaskError, "marks"))
"""Kind of an error -> the field it is about where nothing else names it."""


class PageError(InputError):
    """What the page sent cannot be used; `field` names the part of the page that the message is about."""

    def __init__(self, message: str, field: str = "", status: int = 400) -> None:
        super().__init__(message)
        self.field = field
        self.status = status


def field_of(error: DlamaError, files: Mapping[str, Path]) -> str:
    """The field of the page that an error is about: the file it names, else the parameter, else its kind; "": none.

    files: role -> where that upload lies.
    """
    if isinstance(error, PageError):
        return error.field
    about = FIELDS.get(next(iter(error.parameters), ""), "")
    if about in ("camera", "scale"):
        return about
    named = [role for role, path in files.items() if str(error).startswith(str(path))]
    return next((field for field in (*named, about) if field), "") or next(
        (field for kind, field in KINDS if isinstance(error, kind)), ""
    )


def hide_paths(message: str, names: Mapping[Path, str]) -> str:
    """A message with the visitor's own names of the files (`names`: our path -> theirs) in place of ours."""
    words = {str(path): name for path, name in names.items()} | {path.name: name for path, name in names.items()}
    if not words:
        return message
    longest_first = "|".join(re.escape(word) for word in sorted(words, key=len, reverse=True))
    return re.sub(rf"(?<![\w.-])(?:{longest_first})(?![\w-])", lambda match: words[match[0]], message)


def use_page_words(message: str) -> str:
    """A message of the library, which names parameters in backticks, with what the page calls them."""

    def call(name: str, value: str) -> str:
        return WORDS.get(plain_name(name, value)) or plain_name(WORDS.get(name, name), value)

    return name_parameters(message, call)
