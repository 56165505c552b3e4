"""A message of the library, which names parameters in backticks, in; the same with the flags of the command line, out.

`depth_range` is 0.5 m becomes --depth-range is 0.5 m. And words of the command line that cannot be, before tyro sees them.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import itertools
import re
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from tyro.conf import Positional

from dlama.errors import InputError, name_parameters, plain_name

FLAG = re.compile("--|-[a-z]", re.IGNORECASE)
"""How a flag begins, and no negative number."""
EXPECTED = {float: "a number", int: "a whole number"}


class Flag(NamedTuple):
    """An option of a verb."""

    name: str
    """Of its parameter."""
    flag: str
    kinds: tuple[Any, ...]
    """What one value may be: types, and words."""
    several: bool
    """Whether it takes several values."""
    listed: bool
    """Whether its value is a list of names."""


def flags_of(verb: Callable[..., Any]) -> dict[str, str]:
    """Parameter -> flag, of all options of a verb; what is positional has none."""
    return {one.name: one.flag for one in _flags(verb)}


def check_words(verb: Callable[..., Any], words: Sequence[str]) -> None:
    """Raise InputError for what tyro takes silently, or refuses at length: an empty word, several values that are given in two
    places, of which only the last would count, and a value that is no number, or no word of those that there are."""
    if "" in words:
        before = ["an argument", *words][words.index("")]
        raise InputError(f"{before if before.startswith('-') else 'an argument'} is empty; a value is expected")
    flags, given = {one.flag: one for one in _flags(verb)}, [word.partition("=")[0] for word in words]
    for flag, one in flags.items():
        if (one.several or one.listed) and given.count(flag) > 1:
            raise InputError(f"{flag} is given twice; all its values behind one {flag} are expected")
    _check_values(flags, words)


def _check_values(flags: Mapping[str, Flag], words: Sequence[str]) -> None:
    for place, word in enumerate(words):
        name, equals, value = word.partition("=")
        one = flags.get(name.replace("_", "-"))
        if one is None:
            continue
        behind = itertools.takewhile(lambda word: not FLAG.match(word), words[place + 1 :])
        for given in [value] if equals else itertools.islice(behind, None if one.several else 1):
            if not any(_fits(given, kind) for kind in one.kinds):
                raise InputError(f"{one.flag} is {given!r}; {_describe(one.kinds)} is expected")


def _describe(kinds: Sequence[Any]) -> str:
    names = [EXPECTED[kind] if kind in EXPECTED else str(kind) for kind in kinds if kind is not type(None)]
    return f"{', '.join(names[:-1])}{' or ' if names[1:] else ''}{names[-1]}"


def _parts(hint: Any) -> list[Any]:
    """The types and words in a type hint: those of a union, of a list, of a Literal, and of what is annotated."""
    if typing.get_origin(hint) is typing.Literal:
        return list(typing.get_args(hint))
    inner = typing.get_args(hint)[: 1 if hasattr(hint, "__metadata__") else None]
    return [kind for part in inner if part is not Ellipsis for kind in _parts(part)] if inner else [hint]


def _fits(value: str, kind: Any) -> bool:
    if kind not in EXPECTED:
        return value == kind if isinstance(kind, str) else kind is not type(None) or value == "None"
    try:
        kind(value)
    except ValueError:
        return False
    return True


@functools.cache
def _flags(taker: Callable[..., Any]) -> list[Flag]:
    """Each option, those of its groups, too."""
    hints, found = typing.get_type_hints(taker, include_extras=True), list[Flag]()
    for name, parameter in inspect.signature(taker).parameters.items():
        hint = hints[name]
        notes, kinds = getattr(hint, "__metadata__", ()), _parts(hint)
        groups: list[Any] = [kind for kind in kinds if dataclasses.is_dataclass(kind)]
        if groups:
            found += [one for group in groups for one in _flags(group)]
        elif Positional not in notes:
            found.append(_flag_of(parameter, hint))
    return found


def _flag_of(parameter: inspect.Parameter, hint: Any) -> Flag:
    """The option that a parameter with that annotation is."""
    notes = getattr(hint, "__metadata__", ())
    flag = f"{'no-' if parameter.default is True else ''}{parameter.name.replace('_', '-')}"
    named = next((note.name for note in notes if getattr(note, "name", None)), flag)
    several = typing.get_origin(typing.get_args(hint)[0] if notes else hint) is tuple
    listed = any(str(getattr(note, "metavar", "")).endswith(",...") for note in notes)
    return Flag(parameter.name, f"--{named}", tuple(_parts(hint)), several, listed)


def with_flags(message: str, flags: dict[str, str]) -> str:
    """The message with flags in place of the parameters that it has in backticks; one without a flag keeps its name."""

    def call(name: str, value: str) -> str:
        own = name.removeprefix("loop.").removeprefix("network.")  # `train` sets fields of these two
        flag = flags.get(own) or flags.get(own.removesuffix("s"))  # `clicks` takes what --click gives, one by one
        return plain_name(name, value) if flag is None else f"{flag} {value}".rstrip()

    return name_parameters(message, call)
