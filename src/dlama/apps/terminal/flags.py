"""A message of the library, which names parameters, in; the same with the flags of the command line, out.

`depth_range is 0.5 m` becomes `--depth-range is 0.5 m`. Names that no sentence has (with an underscore, and fx, fov, yaw, ...)
are flags wherever they stand; names that are words too (mask, far, model) only where they stand as a parameter: before `is`
at the start of a clause, before `=`, in backticks, or right after give, with, without, see, choose.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import typing
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from tyro.conf import Positional

SYMBOLS = frozenset({"fx", "fy", "cx", "cy", "fov", "yaw"})
"""Parameters without an underscore that are no words."""
BEFORE = r"(?:(?<=give )|(?<=with )|(?<=without )|(?<=see )|(?<=choose )|(?<=\())"
NO_FIELD = r"(?<!\.json: )(?<!\.txt: )(?<!\.json: camera )(?<!\.txt: camera )"
"""Right after the name of such a file stands one of its fields."""
KNOWN = " is not known; known are "
"""What stands between a field that a file should not have and those that it may have."""
START = r"(?:(?<=^)|(?<=: )|(?<=; )|(?<=, ))"


def flags_of(verb: Callable[..., Any]) -> dict[str, str]:
    """Parameter -> flag, of all options of a verb; what is positional has none."""
    return {name: flag for name, flag, _ in _flags(verb)}


def repeated_list(verb: Callable[..., Any], words: Sequence[str]) -> str | None:
    """The flag of an option with several values that is given twice, of which only the last values would count; None: none is."""
    for _, flag, hint in _flags(verb):
        kind = typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
        if typing.get_origin(kind) is tuple and sum(word.partition("=")[0] == flag for word in words) > 1:
            return flag
    return None


def _flags(taker: Callable[..., Any]) -> Iterator[tuple[str, str, Any]]:
    """Name, flag and type of each option."""
    hints = typing.get_type_hints(taker, include_extras=True)
    for name, parameter in inspect.signature(taker).parameters.items():
        hint = hints[name]
        inner: list[Any] = [kind for kind in _classes(hint) if dataclasses.is_dataclass(kind)]
        if inner:
            for kind in inner:
                yield from _flags(kind)
        elif Positional not in getattr(hint, "__metadata__", ()):
            named = next((note.name for note in getattr(hint, "__metadata__", ()) if getattr(note, "name", None)), None)
            if named is not None:
                yield name, f"--{named}", hint
                continue
            yield name, f"--{'no-' if parameter.default is True else ''}{name.replace('_', '-')}", hint


def _classes(hint: Any) -> list[Any]:
    """The classes in a type hint: itself, or those of its union."""
    if inspect.isclass(hint):
        return [hint]
    return [kind for part in typing.get_args(hint) for kind in _classes(part)]


def with_flags(message: str, flags: dict[str, str]) -> str:
    """The message with flags in place of the parameters it names; what a file's fields are called, after `KNOWN`, stays."""
    message, known, fields = message.partition(KNOWN)
    for name, flag in flags.items():
        word = rf"{NO_FIELD}(?<![\w./-]){name}(?![\w./-])"
        anywhere = "_" in name or name in SYMBOLS
        message = re.sub(rf"`{name}`", flag, message)
        message = re.sub(rf"{word}=", f"{flag} ", message)
        # `train` sets fields of these two
        message = re.sub(rf"{NO_FIELD}(?<![\w./-])(?:loop|network)\.{name}(?![\w./-])", flag, message)
        several = rf"(?<![\w./-]){name}s(?![\w./-])"  # `clicks` takes what --click gives, one by one
        message = re.sub(several if "_" in name else rf"{START}{several}(?= holds | and )", flag, message)
        message = re.sub(word if anywhere else rf"{START}{word}(?= is )|{BEFORE}{word}", flag, message)
    return message + known + fields
