"""A public function and its arguments in; a TypeError out where one of them is not of the type that the signature says.

The signature is the rule: what a parameter is annotated with is what it is checked against. Three kinds are left to the function
itself, whose message says more: the range of numbers, arrays (`as_array`, their shape and dtype), the names of a closed set.
"""

from __future__ import annotations

import difflib
import functools
import inspect
import math
import os
import sys
import types
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Sized
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from dlama.errors import InputError, InputTypeError, marked_name

ROWS = (Sequence, tuple, list)
"""Annotations that a list, a tuple or a set fits: what has a length and can be gone through."""
TO_LOOK_AT = (*ROWS, Iterable, Any)
"""Annotations that no value fits by its class alone; to some versions of Python `Any` is a class."""
UNCHECKED = (np.ndarray, object, Any)
"""Types of what the functions check themselves."""
FITTING: dict[Any, tuple[type, ...]] = {
    **dict.fromkeys((int, float), (Real,)),
    bool: (bool, np.bool_, Integral, types.NoneType),
    Literal: (str,),
}
"""Annotations -> what fits them; any other takes values of its own type."""
WORDS: dict[Any, str] = {
    **dict.fromkeys((Sequence, tuple, list, Iterable), "a list"),
    str: "a string",
    **dict.fromkeys((int, float), "a number"),
    bool: "True or False",
    Callable: "a function",
    Mapping: "a dict",
    Literal: "a name",
}
WHERE_FROM = {
    "Camera": " (`read_camera()` reads one)",
    "StereoRig": " (`read_stereo_calib()` reads one)",
    "RGBD": " (`read_rgbd()` reads a picture with depth, `estimate_depth(color).rgbd` estimates the depth of one)",
    "Scene": " (`scene()` makes one of frames, `read_scene()` reads one)",
    "View": " (`render()` gives one, `scene.frames[0].load()` the one of a frame)",
    "Completion": " (`view()`, `remove()`, `stereo()` and `complete()` give one)",
    "Law": " (`Law.of(scene)` gives one)",
    "FillContext": " (`FillContext.of(scene)` gives one)",
}
"""Name of a type -> where a user gets one from."""


def check_arguments(function: Callable[..., Any], given: Mapping[str, object]) -> None:
    """The first line of a public function: InputTypeError where one of its arguments (`locals()`) is not of its parameter's type.

    The message names the parameter, or its element (`inputs['depth']`, `cameras[1]`), the type that came and what is expected.
    """
    refuse_unknown(function, cast("Mapping[str, object]", given.get("options", {})))
    for name, annotation in _annotations(function).items():
        if name in given and not isinstance(given[name], _classes(annotation)):
            check(given[name], annotation, name)


def refuse_unknown(function: Callable[..., Any], names: Iterable[str]) -> None:
    """Raise InputTypeError for the first of the keywords that is no parameter of the function, with the one that was meant."""
    for name in names:
        known = list(inspect.signature(function).parameters)
        if name not in known:
            meant = "".join(f"did you mean {one}? It" for one in difflib.get_close_matches(name, known, 1)) or "it"
            raise InputTypeError(f"{name} is no parameter of {function.__name__}; {meant} takes {', '.join(known)}")


@functools.lru_cache(None)
def _annotations(function: Callable[..., Any]) -> dict[str, Any]:
    """Parameter -> what it is annotated with; without self, **others, and what is returned."""
    hints, parameters = get_type_hints(function), inspect.signature(function).parameters
    return {name: hints[name] for name, one in parameters.items() if name in hints and one.kind is not one.VAR_KEYWORD}


def check(value: object, annotation: Any, name: str) -> None:
    """Raise InputTypeError, which calls the value `name`, where it is not of the annotated type."""
    complaint = _complaint(value, annotation, marked_name(name))
    if complaint:
        raise InputTypeError(complaint)


@functools.lru_cache(None)
def _classes(annotation: Any) -> tuple[type, ...]:
    """The annotation, or those of its alternatives, that a value fits by its class alone: without elements to look at."""
    members = _alternatives(annotation) or (annotation,)
    return tuple(one for one in members if get_origin(one) is None and isinstance(one, type) and one not in TO_LOOK_AT)


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    """The annotations, of a union or a TypeVar, of which a value must fit one; () for any other."""
    if isinstance(annotation, TypeVar):
        return annotation.__constraints__
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else ()


def as_array(value: object, name: str, expected: str = "an array") -> np.ndarray:
    """An array, a PIL picture, a tensor of torch (in the processor's memory) or anything else that numpy knows, as an array.

    InputTypeError, which calls the value `name`, for anything else, and for a masked array that hides values; `expected`: what
    is expected, in words.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InputTypeError(
            f"{marked_name(name)} is a masked array; {expected} is expected: .filled(0) of depth, 0 = missing"
        )
    try:
        if any(hasattr(type(value), way) for way in ("__array__", "__array_interface__")):
            return np.asarray(value)
        reason = ""
    except Exception as error:  # what the object raises: a tensor on a graphics card, one with gradients
        reason = f" ({error})"
    raise InputTypeError(f"{marked_name(name)} is of type {type(value).__name__}{reason}; {expected} is expected")


def function_name(function: object) -> str:
    """The name of a function for meta.json and messages; of any other object that is called, its type's."""
    return getattr(function, "__name__", type(function).__name__)


def check_count(value: object, name: str, least: int = 1, most: float = math.inf) -> None:
    """Raise InputError, which calls the value `name`, unless it is a whole number from `least` to `most` (or None)."""
    if value is None or (isinstance(value, Integral) and least <= int(value) <= most):
        return
    expected = f"{least} or more is expected, a whole number"
    if most < math.inf:
        expected = f"a whole number from {least} to {most} is expected"
    raise (InputError if isinstance(value, Real) else InputTypeError)(f"{marked_name(name)} is {value!r}; {expected}")


def check_word(value: object, name: str, known: Collection[str]) -> None:
    """Raise InputError, which calls the value `name`, unless it is one of the known words."""
    if not isinstance(value, str) or value not in known:
        raise InputError(f"`{name}` is {value!r}; one of {', '.join(known)} is expected")


def is_finite(value: object) -> bool:
    """True for a finite number; False for nan, infinity, a whole number that no float holds, and what is no number at all."""
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except (TypeError, OverflowError):
        return False


def format_value(value: object) -> str:
    """A number for messages, in six digits; anything else as Python shows it."""
    if isinstance(value, int) and abs(value) > sys.float_info.max:
        return "beyond 1e308"
    return f"{value:g}" if isinstance(value, Real) else repr(value)


def _complaint(value: object, annotation: Any, name: str) -> str:
    """What is wrong with a value; "" where it fits."""
    if isinstance(value, _classes(annotation)):
        return ""
    if alternatives := _alternatives(annotation):
        return _complaint_of_union(value, alternatives, name)
    kind, inner = get_origin(annotation) or annotation, get_args(annotation)
    if kind in ROWS and _innermost(annotation) in (int, float) and hasattr(value, "tolist"):  # an array, a tensor
        value = value.tolist()
    if not _is_a(value, kind, inner):
        return _not_a(value, [annotation], name)
    if kind is tuple and Ellipsis not in inner and len(cast(Sized, value)) != len(inner):
        return f"{name} is {value!r}; {len(inner)} {_plural(inner[0])} are expected"
    unlike = (one for one in _elements(value, kind, inner, name) if not isinstance(one[0], _classes(one[1])))
    return next(filter(None, (_complaint(*one) for one in unlike)), "")


def _complaint_of_union(value: object, members: Sequence[Any], name: str) -> str:
    """As `_complaint`, of a value that one of several types must fit."""
    found = [_complaint(value, member, name) for member in members]
    if "" in found:
        return ""
    inner = [one for one, member in zip(found, members) if one != _not_a(value, [member], name)]  # of its elements
    return inner[0] if inner else _not_a(value, [member for member in members if member is not types.NoneType], name)


def _innermost(annotation: Any) -> Any:
    """What a list, or a list of lists, is of; any other annotation itself."""
    inner = get_args(annotation)
    return _innermost(inner[0]) if inner else annotation


def _not_a(value: object, expected: Sequence[Any], name: str) -> str:
    came = repr(value) if value is None or set(expected) <= {int, float} else f"of type {type(value).__name__}"
    where_from = next((WHERE_FROM[one.__name__] for one in expected if getattr(one, "__name__", "") in WHERE_FROM), "")
    return f"{name} is {came}; {describe_types(expected)} is expected{where_from}"


def _is_a(value: object, kind: Any, inner: tuple[Any, ...]) -> bool:
    """Whether a value is of a type; its elements are looked at by themselves."""
    if kind in ROWS:
        return _is_list(value, inner)
    if kind in FITTING:
        return isinstance(value, FITTING[kind])
    if kind is Iterable and isinstance(value, np.ndarray) and value.ndim == 0:
        return False
    return kind in UNCHECKED or not isinstance(kind, type) or isinstance(value, kind)


def _is_list(value: object, inner: tuple[Any, ...]) -> bool:
    if isinstance(value, str):
        return inner[:1] == (str,)  # one name in place of a list of one
    has_rows = isinstance(value, Sized) and isinstance(value, Iterable)
    return has_rows and not isinstance(value, (bytes, Mapping, np.ndarray))


def _elements(value: Any, kind: Any, inner: tuple[Any, ...], name: str) -> Iterator[tuple[object, Any, str]]:
    """What a list or dict holds: each value, its annotation, and its name in messages."""
    if kind is Mapping:
        yield from ((key, inner[0], f"the key {key!r} of {name}") for key in value)
        yield from ((element, inner[1], f"{name}[{key!r}]") for key, element in value.items())
    elif kind in ROWS and inner and not isinstance(value, str):
        yield from ((element, inner[0], f"{name}[{i}]") for i, element in enumerate(value))


def describe_types(expected: Sequence[Any]) -> str:
    """Types for people: `an RGBD or a Scene`, `a path`, `a list of Cameras`."""
    kinds = [get_origin(one) or one for one in expected]
    is_path = os.PathLike in kinds or Path in kinds
    left = [one for one, kind in zip(expected, kinds) if not (is_path and kind in (str, os.PathLike, Path))]
    words = [*(["a path"] if is_path else []), *dict.fromkeys(_word(one) for one in left)]
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _word(annotation: Any) -> str:
    kind, inner = get_origin(annotation) or annotation, get_args(annotation)
    if kind in ROWS and inner:
        return "a list of " + " or ".join(map(_plural, _alternatives(inner[0]) or inner[:1]))
    if kind in WORDS:
        return WORDS[kind]
    name = str(getattr(kind, "__name__", kind))
    return f"{'an' if name[0] in 'AEIO' or name.startswith('RGB') else 'a'} {name}"


def _plural(annotation: Any) -> str:
    """As `_word`, of several: `Cameras`, `numbers`, `lists`."""
    return "lists" if get_origin(annotation) in ROWS else _word(annotation).partition(" ")[2] + "s"
