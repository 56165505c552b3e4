"""The options of the command line, as dataclasses with a docstring per field; every verb is made of these.

Nothing here imports what computes, so that --help is quick; a test holds the names in it to those of the library.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_type_hints

from tyro.conf import arg

import dlama
from dlama.apps.model_files import model_for
from dlama.completion.options import field_texts, typed_options
from dlama.errors import InputError
from dlama.jobs import options as groups
from dlama.jobs.options import Shown
from dlama.jobs.parameters import (
    check_move,
    check_one_target,
    is_pointed,
    known_depths,
    mask_and_pointing,
    mask_settings,
)


def option(metavar: str, default: str | None = "none", **others: Any) -> Any:
    """How --help shows one option: what stands for its value, and its default; None: it is required.

    others: of `tyro.conf.arg`: aliases, name; help, in place of a docstring of two lines, whose line break tyro would show.
    """
    hint = "(required)" if default is None else f"(default: {default})"
    return arg(metavar=metavar, help_behavior_hint=hint, **others)


DEPTH_ONLY = (".exr", ".pfm", ".npy", ".npz")
"""Endings of depth files that no mask has."""
Metres = Annotated[float | None, option("METRES")]
CameraFile = Annotated[Path | None, option("FILE.json")]
Image = Annotated[Path, option("IMAGE", None)]
Depth = Annotated[Path | None, option("[DEPTH]", "estimated from the picture")]
DepthAndMask = Annotated[tuple[Path, ...], option("[DEPTH] [MASK]", "depth is estimated")]
Seed = Annotated[int, option("N", "0")]
Output = Annotated[Path, option("DIR", None, aliases=["-o"])]


def names_in(listed: str | None) -> tuple[str, ...] | None:
    """The names in a list with commas; None: none is given."""
    return None if listed is None else tuple(name.strip() for name in listed.split(",") if name.strip())


T = TypeVar("T")


def as_flags(cls: type[T]) -> type[T]:
    """Decorator: the class as a dataclass whose fields are the options of its base, a group of `dlama.jobs.options`."""
    group: Any = cls.__bases__[0]
    texts, kinds, annotations = field_texts(group), get_type_hints(group), {}
    for one in dataclasses.fields(group):
        shown: Shown = one.metadata["shown"]
        named = {"name": shown.flag} if shown.flag else {}
        annotations[one.name] = Annotated[
            kinds[one.name], option(shown.metavar, shown.default, help=texts[one.name], **named)
        ]
        setattr(cls, one.name, one.default)
    cls.__annotations__ = annotations
    cls.__doc__ = group.__doc__
    return dataclass(frozen=True)(cls)


@as_flags
class Results(groups.Results):
    """Which files are written."""

    def settings(self) -> dict[str, tuple[str, ...]]:
        """As keyword arguments of `write`: those that are given."""
        given = {"only": names_in(self.only), "also": names_in(self.also)}
        return {name: names for name, names in given.items() if names is not None}


@dataclass(frozen=True)
class Report:
    """What the command prints."""

    quiet: Annotated[bool, option("", "off")] = False
    """Print nothing but errors, and what --json prints."""
    json: Annotated[bool, option("", "off")] = False
    """Print one JSON object instead of the summary: what was written, shares of holes, seconds, warnings."""


@as_flags
class Move(groups.Move):
    """Where the new camera stands."""

    def required(self) -> Move:
        """The move, if there is one; raises InputError."""
        check_move(to=self.to, yaw=self.yaw, pitch=self.pitch, dolly=self.dolly)
        return self

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of the verbs in Python; raises InputError when --to and an orbit were both given."""
        check_one_target(self.to, yaw=self.yaw, pitch=self.pitch, dolly=self.dolly)
        return {
            "camera": self.target(),
            "yaw": self.yaw or 0.0,
            "pitch": self.pitch or 0.0,
            "pivot": self.pivot,
            "dolly": self.dolly or 0.0,
        }

    def target(self) -> dlama.Camera | None:
        """The camera of --to."""
        return None if self.to is None else dlama.read_camera(self.to)


@as_flags
class Lens(groups.Lens):
    """The camera that took the picture."""


@as_flags
class Reading(groups.Reading):
    """How the depth file is read."""


def changed_options(group: Any) -> list[str]:
    """Names of the options of a group that are not at their defaults."""
    default = type(group)()
    return [name for name, value in vars(group).items() if value != getattr(default, name)]


def split_depth_and_mask(
    files: Sequence[Path], pointed: bool = False, named: Path | None = None
) -> tuple[Path | None, Path | None]:
    """The depth file, if there is one, and the mask, which comes last or is `named`; no mask where the object is pointed at.
    InputError."""
    if named is not None:
        if pointed:
            raise mask_and_pointing(named)
        if len(files) > 1:
            raise InputError(f"the mask is given twice, as {files[-1]} and by --mask {named}; one is expected")
        return (files[0] if files else None), named
    if pointed:
        if len(files) > 1:
            raise mask_and_pointing(files[1])
        return (files[0] if files else None), None
    if not files or (len(files) == 1 and files[0].suffix.lower() in DEPTH_ONLY):
        raise InputError("no object to remove is given: give a mask file, --click X,Y on the object, or --box X,Y,W,H")
    if not 1 <= len(files) <= 2:
        raise InputError(f"{len(files)} files follow the picture; a mask, or depth and a mask are expected")
    return (files[0] if len(files) == 2 else None), files[-1]


@as_flags
class Estimating(groups.Estimating):
    """Depth of a picture that comes without."""

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of read_rgbd."""
        return super().settings() | {"metres_at": known_depths(self.metres_at)}


@as_flags
class Masking(groups.Masking):
    """How a mask file is read."""

    def check_with(self, *masks: Path | None) -> None:
        """InputError for an option of mask files where none is given."""
        if any(mask is not None for mask in masks):
            return
        for name in changed_options(self):
            raise InputError(f"`{name}` says how a mask file is read, and none is given")


@as_flags
class Pointing(groups.Pointing):
    """Points at the object, in place of a mask file."""

    @property
    def given(self) -> bool:
        """Whether anything is pointed at. InputError, before anything is read, for words that are no pixels."""
        self.settings()
        return is_pointed(dataclasses.asdict(self))

    def check_with(self, mask: Path | None) -> None:
        """InputError for options of clicks and boxes where neither is given, or a mask file is."""
        of_clicks = ("masker", "mask_model", "candidate", *(() if mask else ("with_shadow",)))
        for name in changed_options(self):
            if name in of_clicks:
                instead = f"a mask file ({mask}) is given; leave one of them away" if mask else "neither is given"
                raise InputError(f"`{name}` is for clicks and boxes, and {instead}")

    @property
    def needs_depth(self) -> bool:
        """Whether the object is found in depth."""
        by_color = self.salient or self.object_class is not None or self.masker not in (None, "rgbd")
        return self.with_shadow or not by_color

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of find_mask; raises InputError."""
        return mask_settings(super().settings())


def options_as_fields(*names: str) -> Callable[[type[T]], type[T]]:
    """Decorator: the class as a dataclass with these options of the library (all, if none is named) as its fields."""

    def decorate(cls: type[T]) -> type[T]:
        found, annotations = typed_options(), {}
        for name in names or found:
            typed, default, text = found[name]
            kind: Any = Literal[typed.kind] if isinstance(typed.kind, tuple) else typed.kind
            kind = kind | None if default is None else kind
            annotations[name] = Annotated[kind, option(typed.metavar, typed.default, help=text)]
            setattr(cls, name, default)
        cls.__annotations__ = annotations
        return dataclass(frozen=True)(cls)

    return decorate


class LibraryOptions:
    """Options of the library, as they are typed."""

    if TYPE_CHECKING:
        filler: str
        model: str | None

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of the verbs in Python."""
        return vars(self) | {"model": self.network()}

    def network(self) -> Path | None:
        """The ONNX file of --model; a checkpoint is converted once, into the cache."""
        return None if self.model is None else model_for(self.model)


@options_as_fields()
class Method(LibraryOptions):
    """How the scene is completed."""


@options_as_fields("filler", "model", "recipe", "dilate", "seed", "min_confidence")
class SequenceMethod(LibraryOptions):
    """How a sequence is completed."""


@options_as_fields("filler", "model", "seed")
class Filler(LibraryOptions):
    """What fills what no frame saw."""
