"""The options of a completion, defined once: keywords of the verbs, flags of the command line, columns of a job list, fields of
the page. Nothing that computes is imported before an `Options` is made, so that --help is quick."""

from __future__ import annotations

import ast
import functools
import inspect
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, TypeVar, get_type_hints

from dlama.errors import InputError, InputTypeError, marked_name
from dlama.inpainters import AUTO

if sys.version_info >= (3, 11):
    from typing import Unpack as Unpack
else:
    from typing_extensions import Unpack as Unpack

if TYPE_CHECKING:
    from pathlib import Path

    from dlama.completion.recipes import DepthBy, Recipe
    from dlama.geometry.rendering import Mode
    from dlama.inpainters.filling import Inpainter

F = TypeVar("F", bound=Callable[..., Any])
RECIPE_NAMES = ("dlama", "paper")
"""Names of the recipes, the default first."""
MODES, DEPTH_BY = ("surface", "points"), ("surfaces", "filler")
"""Names of the ways of rendering, and of filling depth."""
OF_RECIPE = ("mode", "dilate", "dilate_holes", "clip", "depth_by")
"""Options that replace single settings of the recipe."""


class Typed(NamedTuple):
    """How an option is typed in text."""

    kind: type | tuple[str, ...]
    """str, int, float, or the closed set of its words."""
    metavar: str
    """What --help shows for its value."""
    default: str
    """What --help shows as its default."""


def _typed(kind: type | tuple[str, ...], metavar: str, default: str) -> dict[str, Typed]:
    return {"typed": Typed(kind, metavar, default)}


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a scene is completed. InputError names every option that cannot be, and those that contradict each other."""

    filler: str | Inpainter = field(default=AUTO, metadata=_typed(str, "NAME", AUTO))
    """What fills the holes: layered continues planes and sky from behind, telea diffuses; migan runs a network that comes with
    the package, patchmatch adds patches of the picture to what that one guesses, layered-patches mixes it with layered and with
    patches; auto is layered-patches, or patchmatch where depth is estimated; lama, joint and pair (stereo only) run that of
    model. In Python also a function (view, context, seed) -> Fill."""
    model: str | Path | None = field(default=None, metadata=_typed(str, "FILE|NAME", "none"))
    """Network of a filler that runs one: an ONNX or LaMa file, or a name of `dlama models list`."""
    recipe: str | Recipe = field(default="dlama", metadata=_typed(str, "|".join(RECIPE_NAMES), "dlama"))
    """dlama: surfaces, metric depth; paper: as published (points, 10 m clip, 8-bit depth, 3 px dilation)."""
    mode: Mode | None = field(default=None, metadata=_typed(MODES, "|".join(MODES), "the recipe's"))
    """Draw the pixel grid as a surface cut at depth edges, or project each pixel to the nearest one."""
    dilate: int | None = field(default=None, metadata=_typed(int, "PX", "the recipe's"))
    """Grow the mask by this many pixels before the object is removed (both recipes: 3; dlama: 6 in a depth camera's picture)."""
    dilate_holes: int | None = field(default=None, metadata=_typed(int, "PX", "the recipe's"))
    """Grow the holes of the new view by this many pixels (both recipes: 0)."""
    clip: float | None = field(default=None, metadata=_typed(float, "METRES", "the recipe's"))
    """Put everything at or beyond this depth, sky too, at this depth (paper: 10)."""
    depth_by: DepthBy | None = field(default=None, metadata=_typed(DEPTH_BY, "|".join(DEPTH_BY), "the recipe's"))
    """Depth with telea, lama, migan, patchmatch: surfaces continued behind the hole, or the filler's own."""
    seed: int = field(default=0, metadata=_typed(int, "N", "0"))
    """Fillers draw their random numbers from this; the same seed gives the same pixels."""
    min_confidence: float = field(default=0.0, metadata=_typed(float, "P", "0"))
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
def typed_options() -> dict[str, tuple[Typed, Any, str]]:
    """Option -> how it is typed in text, its default, and what it does, for the command line."""
    texts = field_texts(Options)
    return {one.name: (one.metadata["typed"], one.default, texts[one.name]) for one in fields(Options)}


def field_texts(group: type[Any]) -> dict[str, str]:
    """Field -> its docstring in one line, of a dataclass in which every field has one."""
    (cls,) = ast.parse(inspect.getsource(group)).body
    texts = [ast.literal_eval(one.value) for one in cls.body[1:] if isinstance(one, ast.Expr)]  # type: ignore[attr-defined]
    return {one.name: " ".join(text.split()) for one, text in zip(fields(group), texts)}


@functools.lru_cache(None)
def option_types() -> dict[str, Any]:
    """Option -> its type."""
    from pathlib import Path

    from dlama.completion.recipes import DepthBy, Recipe
    from dlama.geometry.rendering import Mode
    from dlama.inpainters.filling import Inpainter

    names = {"Path": Path, "DepthBy": DepthBy, "Recipe": Recipe, "Mode": Mode, "Inpainter": Inpainter}
    return get_type_hints(Options, localns=names)
