"""A message of the library, which names parameters in backticks, in; the same with the flags of the command line, out.

`depth_range` is 0.5 m becomes --depth-range is 0.5 m. And words of the command line that cannot be, before tyro sees them.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import itertools
import re
import types
import typing
from collections.abc import Callable, Sequence
from typing import Any

from tyro.conf import Positional

from dlama.errors import name_parameters, plain_name

FLAG = re.compile("--|-[a-z]", re.IGNORECASE)
"""How a flag begins, and no negative number."""
EXPECTED = {float: "a number", int: "a whole number"}


def flags_of(verb: Callable[..., Any]) -> dict[str, str]:
    """Parameter -> flag, of all options of a verb; what is positional has none."""
    return {name: flag for name, flag, _ in _flags(verb)}


def repeated_list(verb: Callable[..., Any], words: Sequence[str]) -> str | None:
    """The flag of an option with several values that is given twice, of which only the last values would count; None: none is."""
    for _, flag, hint in _flags(verb):
        kind = typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
        named = any(str(getattr(note, "metavar", "")).endswith(",...") for note in getattr(hint, "__metadata__", ()))
        if (named or typing.get_origin(kind) is tuple) and sum(word.partition("=")[0] == flag for word in words) > 1:
            return flag
    return None


def wrong_value(verb: Callable[..., Any], words: Sequence[str]) -> str | None:
    """What is wrong with the first value that is no number, or no word of those that there are: a line; None: nothing is."""
    hints = {flag: _without_notes(hint) for _, flag, hint in _flags(verb)}
    for place, word in enumerate(words):
        name, equals, value = word.partition("=")
        flag = name.replace("_", "-")
        if flag not in hints:
            continue
        several = typing.get_origin(hints[flag]) is tuple
        kinds = _kinds(typing.get_args(hints[flag])[0] if several else hints[flag])
        behind = itertools.takewhile(lambda one: not FLAG.match(one), words[place + 1 :])
        for given in [value] if equals else itertools.islice(behind, None if several else 1):
            if not any(_fits(given, kind) for kind in kinds):
                return f"{flag} is {given!r}; {_describe(kinds)} is expected"
    return None


def _describe(kinds: Sequence[Any]) -> str:
    names = [EXPECTED[kind] if kind in EXPECTED else str(kind) for kind in kinds if kind is not type(None)]
    return f"{', '.join(names[:-1])}{' or ' if names[1:] else ''}{names[-1]}"


def _without_notes(hint: Any) -> Any:
    return typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint


def _kinds(hint: Any) -> list[Any]:
    """What one value may be: types, and words."""
    hint = _without_notes(hint)
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return [kind for part in typing.get_args(hint) for kind in _kinds(part)]
    return list(typing.get_args(hint)) if typing.get_origin(hint) is typing.Literal else [hint]


def _fits(value: str, kind: Any) -> bool:
    if kind not in EXPECTED:
        return value == kind if isinstance(kind, str) else kind is not type(None) or value == "None"
    try:
        kind(value)
    except ValueError:
        return False
    return True


@functools.cache
def _flags(taker: Callable[..., Any]) -> list[tuple[str, str, Any]]:
    """Name, flag and type of each option."""
    hints, found = typing.get_type_hints(taker, include_extras=True), []
    for name, parameter in inspect.signature(taker).parameters.items():
        hint = hints[name]
        notes = getattr(hint, "__metadata__", ())
        inner: list[Any] = [kind for kind in _classes(hint) if dataclasses.is_dataclass(kind)]
        if inner:
            found += [one for kind in inner for one in _flags(kind)]
        elif Positional not in notes:
            flag = f"{'no-' if parameter.default is True else ''}{name.replace('_', '-')}"
            named = next((note.name for note in notes if getattr(note, "name", None)), flag)
            found.append((name, f"--{named}", hint))
    return found


def _classes(hint: Any) -> list[Any]:
    """The classes in a type hint: itself, or those of its union."""
    if inspect.isclass(hint):
        return [hint]
    return [kind for part in typing.get_args(hint) for kind in _classes(part)]


def with_flags(message: str, flags: dict[str, str]) -> str:
    """The message with flags in place of the parameters that it has in backticks; one without a flag keeps its name."""

    def call(name: str, value: str) -> str:
        own = name.removeprefix("loop.").removeprefix("network.")  # `train` sets fields of these two
        flag = flags.get(own) or flags.get(own.removesuffix("s"))  # `clicks` takes what --click gives, one by one
        return plain_name(name, value) if flag is None else f"{flag} {value}".rstrip()

    return name_parameters(message, call)
