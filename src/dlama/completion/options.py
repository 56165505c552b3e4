"""The options of a completion, defined once: keywords of the verbs, flags of the command line, columns of a job list, fields of
the page. Nothing that computes is imported before an `Options` is made, so that --help is quick."""

# ruff: noqa: RUF009  (`option` makes a field, as `dataclasses.field` does)

from __future__ import annotations

import ast
import functools
import inspect
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypedDict, TypeVar, get_type_hints

from dlama.errors import InputError, InputTypeError, marked_name
from dlama.inpainters import AUTO

if sys.version_info >= (3, 11):
    from typing import Unpack as Unpack
else:
    from typing_extensions import Unpack as Unpack

if TYPE_CHECKING:
    from dlama.completion.recipes import DepthBy, Recipe
    from dlama.geometry.rendering import Mode
    from dlama.inpainters.filling import Inpainter

F = TypeVar("F", bound=Callable[..., Any])
RECIPE_NAMES = ("dlama", "paper")
"""Names of the recipes, the default first."""
OF_RECIPE = ("mode", "dilate", "dilate_holes", "clip", "depth_by")
"""Options that replace single settings of the recipe."""


class Option(NamedTuple):
    """How an option is typed in text, and what it does: what its flag, its column and its field on the page are made from."""

    metavar: str
    """What --help shows for its value."""
    default: str
    """What --help shows as its default."""
    kind: Any
    """The type of what is typed: str, int, float, Path, bool, a Literal of its words, tuples of them, or None."""
    flag: str | None
    """Its flag, where that is not its name."""
    value: Any = None
    """Its default."""
    label: str = ""
    """What the page calls it; "": the page has no field for it."""
    text: str = ""
    """Its docstring, in one line."""


def option(
    metavar: str, default: str = "none", value: Any = None, kind: Any = None, flag: str | None = None, label: str = ""
) -> Any:
    """A field of a group of options (a dataclass in which every field has a docstring); value: its default; kind: how it is typed
    in text, where that is not the field's own type."""
    return field(default=value, metadata={"option": Option(metavar, default, kind, flag, value, label)})


@functools.cache
def options_in(group: Any) -> dict[str, Option]:
    """The options of a group, by name."""
    texts, kinds = docstrings_of_fields(group.__module__)[group.__name__], None
    found: dict[str, Option] = {}
    for one, text in zip(fields(group), texts):
        typed: Option = one.metadata["option"]
        kind = typed.kind
        if kind is None:
            kinds = kinds or get_type_hints(group)
            kind = kinds[one.name]
        found[one.name] = typed._replace(kind=kind, value=one.default, text=" ".join(text.split()))
    return found


@functools.cache
def docstrings_of_fields(module: str) -> dict[str, list[str]]:
    """The docstrings of the fields of each class of a module, in order, by the name of the class: read once, for
    `inspect.getsource` of a class parses all of its module."""
    classes = [one for one in ast.parse(inspect.getsource(sys.modules[module])).body if isinstance(one, ast.ClassDef)]
    return {
        one.name: [ast.literal_eval(line.value) for line in one.body[1:] if isinstance(line, ast.Expr)]
        for one in classes
    }


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a scene is completed; `dlama view --help` has a line on each.

    InputError names every option that cannot be, and those that contradict each other.
    """

    filler: str | Inpainter = option("NAME", AUTO, AUTO, kind=str, label="Filler")
    """What fills the holes. layered: patches of the surfaces that continue there; layered-patches: these and a network;
    patchmatch: a network and patches of any part of the picture; telea: diffusion; migan: a network that ships; lama, joint, pair
    (stereo only): the network of --model. auto: layered-patches, or patchmatch where depth is estimated. In Python also a
    function (view, context, seed) -> Fill, or a Painter."""
    model: str | Path | None = option("FILE|NAME", kind=str | None)
    """Network of a filler that runs one: an ONNX or LaMa file, or a name of `dlama models list`."""
    recipe: str | Recipe = option("|".join(RECIPE_NAMES), "dlama", "dlama", kind=str, label="Recipe")
    """dlama: surfaces, metric depth; paper: the published steps (points, 10 m clip, 8-bit depth, 3 px dilation)."""
    mode: Mode | None = option("surface|points", "surface; paper: points", kind=Literal["surface", "points"] | None)
    """Draw the pixel grid as a surface cut at depth edges, or project each pixel to the nearest one."""
    dilate: int | None = option("PX", "3", kind=int | None, label="Grow the hole")
    """Grow the mask by this many pixels before the object is removed. In proportion more by default where the longer side exceeds
    1024 pixels (paper: always 3)."""
    dilate_holes: int | None = option("PX", "0", kind=int | None)
    """Grow the holes of the new view by this many pixels."""
    clip: float | None = option("METRES", "none; paper: 10", kind=float | None)
    """Put everything at or beyond this depth, sky too, at this depth."""
    depth_by: DepthBy | None = option(
        "surfaces|filler", "surfaces; paper: filler", kind=Literal["surfaces", "filler"] | None
    )
    """Depth with telea, lama, migan, patchmatch: surfaces continued behind the hole, or the filler's own."""
    seed: int = option("N", "0", 0, kind=int, label="Seed")
    """Fillers draw their random numbers from this; the same seed gives the same pixels."""
    min_confidence: float = option("P", "0", 0.0, kind=float, label="Leave open below")
    """Leave open what is filled and right with a smaller probability (0 to 1), in pictures, clouds and meshes."""

    def __post_init__(self) -> None:
        raise_all(functools.partial(self._check, one.name) for one in fields(self))
        _ = self.settings  # contradictions

    def _check(self, name: str) -> None:
        """Raise InputError where the value of one option cannot be."""
        from dlama.arguments import check
        from dlama.completion.recipes import check_confidence, check_seed, find_recipe

        value = getattr(self, name)
        check(value, option_types()[name], name)
        if name in OF_RECIPE:
            find_recipe("dlama", **{name: value})
        rules: dict[str, Callable[[Any], Any]] = {
            "recipe": find_recipe, "seed": check_seed, "min_confidence": check_confidence
        }  # fmt: skip
        if name in rules:
            rules[name](value)

    @cached_property
    def settings(self) -> Recipe:
        """The recipe with the options that replace its settings."""
        from dlama.completion.recipes import find_recipe

        return find_recipe(self.recipe, **{name: getattr(self, name) for name in OF_RECIPE})


class OptionKeywords(TypedDict, total=False):
    """The fields of `Options` as keywords (PEP 692), for type checkers; a test holds the two equal."""

    filler: str | Inpainter
    model: str | Path | None
    recipe: str | Recipe
    mode: Mode | None
    dilate: int | None
    dilate_holes: int | None
    clip: float | None
    depth_by: DepthBy | None
    seed: int
    min_confidence: float


def take_options(verb: F) -> F:
    """Decorator of a function with `**options`: `help` and editors show each option as a keyword with its default."""
    signature = inspect.signature(verb)
    own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
    keyword = inspect.Parameter.KEYWORD_ONLY
    added = [inspect.Parameter(one.name, keyword, default=one.default, annotation=one.type) for one in fields(Options)]
    verb.__signature__ = signature.replace(parameters=[*own, *added])  # type: ignore[attr-defined]
    return verb


def options_of(given: Mapping[str, Any]) -> Options:
    """The options given as keywords. Raises InputTypeError for an unknown one, InputError as `Options`."""
    names = [one.name for one in fields(Options)]
    for name in given:
        if name not in names:
            raise InputTypeError(f"{marked_name(name)} is no parameter; the options are {', '.join(names)}")
    return Options(**given)


def raise_all(checks: Iterable[Callable[[], Any]]) -> None:
    """Run checks that may raise InputError; all that did as one error of the first one's kind."""
    wrong: list[InputError] = []
    for check in checks:
        try:
            check()
        except InputError as error:
            wrong.append(error)
    if wrong:
        raise type(wrong[0])("; ".join(dict.fromkeys(error.marked for error in wrong)))


@functools.lru_cache(None)
def option_types() -> dict[str, Any]:
    """Option -> its type."""
    from dlama.completion.recipes import DepthBy, Recipe
    from dlama.geometry.rendering import Mode
    from dlama.inpainters.filling import Inpainter

    names = {"DepthBy": DepthBy, "Recipe": Recipe, "Mode": Mode, "Inpainter": Inpainter}
    return get_type_hints(Options, localns=names)
