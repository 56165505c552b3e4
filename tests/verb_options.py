"""A verb in; its options, those of its groups too, out."""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable, Iterator
from typing import Any


def fields_of(taker: Callable[..., Any]) -> Iterator[tuple[str, Any, Any]]:
    """Name, type hint with its notes, and default of each option of a verb, those of its dataclasses too."""
    hints = typing.get_type_hints(taker, include_extras=True)
    for name, parameter in inspect.signature(taker).parameters.items():
        group = group_in(hints[name])
        if group is not None:
            yield from fields_of(group)
        elif name != "task":
            yield name, hints[name], parameter.default


def group_in(hint: Any) -> Any:
    """The group of options that a parameter takes; None: it is an option itself."""
    kind = typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
    return kind if dataclasses.is_dataclass(kind) else None


def groups_in(taker: Callable[..., Any]) -> Iterator[Any]:
    """The groups of options of a verb, and those in them."""
    for group in filter(None, map(group_in, typing.get_type_hints(taker, include_extras=True).values())):
        yield group
        yield from groups_in(group)
