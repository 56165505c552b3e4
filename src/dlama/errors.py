"""What can go wrong, as one small tree; a message says what came, what was expected, and which file or field.

A parameter of a public function stands in the message in backticks (`mask`, `depth_scale=1000`): so an error carries what it is
about, Python's users read the plain name, and the command line puts its flag there, the page its field.

DlamaError
├── InputError          what the user gave cannot be used (the command line ends with exit code 2)
│   ├── FileError       a file is missing, unreadable, truncated or of the wrong kind
│   ├── InputTypeError  a parameter is of another type than its function takes (a TypeError, too)
│   ├── ShapeError      sizes or dtypes that do not fit together
│   ├── DepthError      depth that cannot be metres: empty, negative, wrong scale
│   ├── CameraError     intrinsics or a pose that no camera has
│   └── MaskError       a mask that is empty, full, grey, or of the wrong size
├── OutputError         a result cannot be written where it was asked for
└── MissingExtraError   an optional dependency is not installed; the message carries the pip line
"""

from __future__ import annotations

import importlib.util
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar

LONGEST = 1200
"""Characters of a message."""
PARAMETER = re.compile(r"`([A-Za-z_][\w.]*)(?:=([^`]*))?`")
"""A parameter in a message, with the value it is to have, if any."""


def name_parameters(message: str, call: Callable[[str, str], str]) -> str:
    """The message with `call(name, value)` in place of each parameter in backticks; value: the one it is to have, or ""."""
    return PARAMETER.sub(lambda found: call(found[1], found[2] or ""), message)


def plain_name(name: str, value: str = "") -> str:
    """A parameter as Python has it."""
    return f"{name}={value}" if value else name


def marked_name(name: str) -> str:
    """A name in backticks if it is a parameter's, as it is if it is words (`job 3`)."""
    return f"`{name}`" if name.isidentifier() else name


class DlamaError(Exception):
    """Root of everything dlama raises on purpose. A message that shows a very long value is shortened in its middle."""

    guide: ClassVar[str] = ""
    """The page that explains this kind of error, which the command line names; "": none does."""

    @property
    def marked(self) -> str:
        """The whole message with parameters in backticks, for an error that passes it on."""
        return super().__str__()

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters that the message names, in its order: the first is the one it is about."""
        return tuple(found[1] for found in PARAMETER.finditer(self.marked))

    def __str__(self) -> str:
        text = name_parameters(self.marked, plain_name)
        return text if len(text) <= LONGEST else f"{text[: 2 * LONGEST // 3]} ... {text[-LONGEST // 4 :]}"

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), self.args, self.__dict__)  # __init__ may take other parameters than the message


def _again(kind: type[DlamaError], args: tuple[Any, ...], attributes: dict[str, Any]) -> DlamaError:
    """An error as another process raised it."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(attributes)
    return error


class InputError(DlamaError, ValueError):
    """What the user gave cannot be used; the message names the field or file, what came and what was expected."""


class InputTypeError(InputError, TypeError):
    """A parameter is of another type than its function takes; the message begins with its name."""


class FileError(InputError):
    """A file is missing, unreadable, truncated or of the wrong kind."""


class ShapeError(InputError):
    """Array sizes or dtypes that do not fit together."""


class DepthError(InputError):
    """Depth that cannot be metres: all empty, negative, or on the wrong scale."""

    guide = "docs/concepts/conventions.md"


class CameraError(InputError):
    """Intrinsics that no camera has, or a pose that is not a rigid motion."""

    guide = "docs/concepts/conventions.md"


class MaskError(InputError):
    """A mask that is empty, full, grey where it must not be, or of the wrong size."""

    guide = "docs/guides/remove.md"


class OutputError(DlamaError, OSError):
    """A result cannot be written where it was asked for."""


class MissingExtraError(DlamaError, ImportError):
    """An optional dependency is not installed."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        super().__init__(f"{what} needs the package '{package}': pip install 'dlama[{extra}]'")


def import_extra(module: str, what: object, package: str, extra: str) -> Any:
    """A module of an optional dependency. MissingExtraError, which says what needs it, where it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(str(what), package, extra) from error


def require_extra(what: str, extra: str, packages: Mapping[str, str]) -> None:
    """MissingExtraError for the first of the packages (name -> its module) of an extra that is not installed."""
    for package, module in packages.items():
        if importlib.util.find_spec(module) is None:
            raise MissingExtraError(what, package, extra)


def first_line(error: BaseException) -> str:
    """What an error says, or its name where it says nothing."""
    return next(iter(str(error).splitlines()), type(error).__name__)


def system_reason(error: OSError) -> str:
    """Why, in words: "no space left on device"."""
    return (error.strerror or str(error)).lower()


def describe_system_error(error: OSError) -> str:
    """The files that an error of the system is about, if it names any, and why."""
    names = [str(name) for name in (error.filename, error.filename2) if name is not None]
    return ": ".join([*names, system_reason(error)])


@contextmanager
def system_errors(kind: type[DlamaError]) -> Iterator[None]:
    """Decorator, or context: an error of the system (no permission, no space, a broken disk) becomes one of `kind`.

    It names file and reason. Errors of dlama pass.
    """
    try:
        yield
    except OSError as error:
        if isinstance(error, DlamaError):
            raise
        raise kind(describe_system_error(error)) from error


@contextmanager
def any_error(kind: type[DlamaError], message: str) -> Iterator[None]:
    """Context: what a decoder raises, which can be anything, becomes one of `kind`: `message (its first line)`.

    Errors of dlama pass, and MemoryError, for which no file is to blame.
    """
    try:
        yield
    except (DlamaError, MemoryError):
        raise
    except Exception as error:
        raise kind(f"{message} ({first_line(error)})") from error


def warn(message: str) -> None:
    """A doubt about what was given, as a UserWarning; it is of the line outside dlama from where it came."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).startswith(("dlama.", "contextlib")):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, UserWarning, stacklevel=level)


def format_size(hw: Sequence[int]) -> str:
    """WIDTHxHEIGHT, for people, of (height, width) or the shape of a picture."""
    return "x".join(map(str, hw[1::-1]))


def check_same_size(
    what: str, hw: Sequence[int], of: str, other_hw: Sequence[int], kind: type[InputError] = ShapeError
) -> None:
    """Raise an error of that kind unless `what` has the (height, width), or the shape of a picture, that `of` has."""
    if tuple(hw[:2]) != tuple(other_hw[:2]):
        raise kind(f"{what} is {format_size(hw)} and {of} {format_size(other_hw)}; both must have the same size")


def format_count(count: int, noun: str) -> str:
    """A count with its noun, for people: `1 layer`, `2 layers`; `noun` takes an s."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
