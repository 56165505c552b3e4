"""The options of the command line, as dataclasses with a docstring per field; every verb is made of these.

Nothing here imports what computes, so that --help is quick; a test holds the names in it to those of the library.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from dlama.apps.model_files import model_for
from dlama.completion.options import Options, options_in
from dlama.errors import InputError
from dlama.jobs import options as groups
from dlama.jobs.parameters import MASKING, is_pointed, typed


def option(metavar: str, default: str | None = "none", **others: Any) -> Any:
    """How --help shows one option: what stands for its value, and its default; None: it is required.

    others: of `tyro.conf.arg`: aliases, name; help, in place of a docstring of two lines, whose line break tyro would show.
    """
    hint = "(required)" if default is None else f"(default: {default})"
    return arg(metavar=metavar or None, help_behavior_hint=hint, **others)


DEPTH_ONLY = (".exr", ".pfm", ".npy", ".npz", ".pcd")
"""Endings of a file that is the depth where it alone follows the picture."""
Metres = Annotated[float | None, option("METRES")]
CameraFile = Annotated[Path | None, option("FILE.json")]
Image = Annotated[Path, option("IMAGE", None)]
Depth = Annotated[Path | None, option("[DEPTH]", "estimated from the picture")]
DepthAndMask = Annotated[tuple[Path, ...], option("[DEPTH] [MASK]", "depth is estimated")]
Seed = Annotated[int, option("N", "0")]
Output = Annotated[Path, option("DIR", None, aliases=["-o"])]


def typed_words(value: Any) -> list[str]:
    """A value as it would be typed, or each of a list."""
    return list(map(typed, value if isinstance(value, (list, tuple)) else (value,)))


def as_flags(group: Any, *names: str, doc: str = "") -> Any:
    """A dataclass with these options of a group (all, if none is named) as its fields, and `doc` or the group's docstring."""
    fields = []
    for name, one in options_in(group).items():
        if name in (names or (name,)):
            named = {"name": one.flag} if one.flag else {}
            shown = option(one.metavar, one.default, help=one.text, **named)
            kind = str | None if one.kind == Path | None else one.kind  # of an address a path would keep one slash
            fields.append((name, Annotated[kind, shown], one.value))
    return dataclasses.make_dataclass(group.__name__, fields, namespace={"__doc__": doc or group.__doc__}, frozen=True)


if TYPE_CHECKING:
    from dlama.completion.options import Options as Filler
    from dlama.completion.options import Options as Method
    from dlama.jobs.options import Estimating, Lens, Masking, Move, Pair, Pointing, Reading, Results
    from dlama.jobs.options import Pair as Matching
else:
    Results = as_flags(groups.Results)
    Move = as_flags(groups.Move)
    Lens = as_flags(groups.Lens)
    Reading = as_flags(groups.Reading)
    Estimating = as_flags(groups.Estimating)
    Masking = as_flags(groups.Masking)
    Pointing = as_flags(groups.Pointing)
    Pair = as_flags(groups.Pair)
    Matching = as_flags(groups.Pair, "right_view", "disparity_scale", "matcher", "max_disparity")
    Method = as_flags(Options, doc="How the scene is completed.")
    Filler = as_flags(Options, "filler", "model", "seed", doc="What fills what no frame saw.")


@dataclass(frozen=True)
class Report:
    """What the command prints."""

    quiet: Annotated[bool, option("", "off")] = False
    """Print nothing but errors, and what --json prints."""
    json: Annotated[bool, option("", "off")] = False
    """Print one JSON object instead of the summary: what was written, shares of holes, seconds, warnings."""


@dataclass(frozen=True)
class _Picture:
    """How a picture is read, and its depth."""

    lens: Lens
    reading: Reading
    estimating: Estimating


@dataclass(frozen=True)
class _Object:
    """Which object is meant."""

    masking: Masking
    pointing: Pointing


def given_options(*groups: Any) -> dict[str, Any]:
    """The options of some groups, and of groups in them, that differ from their defaults, by name; a network as the ONNX file
    that runs."""
    found: dict[str, Any] = {}
    for group in groups:
        for one in dataclasses.fields(group):
            value = getattr(group, one.name)
            if dataclasses.is_dataclass(value):
                found |= given_options(value)
            elif value != one.default:
                found[one.name] = model_for(value) if one.name == "model" else value
    return found


def split_depth_and_mask(files: Sequence[Path], given: Mapping[str, Any], named: Path | None) -> dict[str, Path | None]:
    """The depth file and the mask, where they are given: the mask comes last or is `named`, and is left away where the options
    that are given point at the object. InputError."""
    if len(files) > 2:
        raise InputError(f"{len(files)} files follow the picture; a mask, or depth and a mask are expected")
    if named is not None and len(files) == 2:
        raise InputError(f"the mask is given twice, as {files[-1]} and by --mask {named}; one is expected")
    depth, mask = (*files, None, None)[:2]
    if named is None and len(files) == 1 and not is_pointed(given) and files[0].suffix.lower() not in DEPTH_ONLY:
        depth, mask = None, files[0]
    return {"depth": depth, "mask": mask or named}


def check_of_object(given: Mapping[str, Any], *masks: Path | None) -> None:
    """InputError for options of mask files where none is given, and of clicks and boxes where neither is, or a mask file is."""
    mask = next(filter(None, masks), None)
    for name in given:
        if name in MASKING and mask is None:
            raise InputError(f"`{name}` says how a mask file is read, and none is given")
    if is_pointed(given):
        return
    for name in ("masker", "mask_model", "candidate", *(() if mask else ("with_shadow",))):
        if name in given:
            instead = f"a mask file ({mask}) is given; leave one of them away" if mask else "neither is given"
            raise InputError(f"`{name}` is for clicks and boxes, and {instead}")


@dataclass(frozen=True)
class _Completing:
    """How the scene is completed, and what is written of it."""

    method: Method
    results: Results


Together = arg(name="")
"""Groups in a group: --help shows each as if it stood alone."""
PictureOptions = Annotated[_Picture, Together]
ObjectOptions = Annotated[_Object, Together]
CompletingOptions = Annotated[_Completing, Together]
