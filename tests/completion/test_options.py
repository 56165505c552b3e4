"""One definition of the options (oracles: the fields of `Options`; the signatures, flags, columns and fields made from them)."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Literal, get_args, get_type_hints

import pytest

import dlama
from dlama.apps.options import Method
from dlama.apps.terminal.flags import flags_of
from dlama.completion.options import OF_RECIPE, OptionKeywords, Options, options_in, options_of
from dlama.completion.recipes import RECIPES, DepthBy, Recipe
from dlama.errors import InputError, InputTypeError
from dlama.geometry.rendering import MODES
from dlama.jobs.parameters import METHOD
from dlama.web.form import describe_form

NAMES = [one.name for one in fields(Options)]


def test_keywords_flags_columns_and_the_page_have_the_fields_of_options() -> None:
    assert OptionKeywords.__annotations__.keys() == Options.__annotations__.keys() == set(NAMES)
    for name, annotation in Options.__annotations__.items():
        assert annotation == OptionKeywords.__annotations__[name].__forward_arg__
    assert list(options_in(Options)) == list(flags_of(Method)) == list(METHOD) == NAMES
    assert {name: getattr(Method(), name) for name in NAMES} == {one.name: one.default for one in fields(Options)}
    for field in describe_form()["method"]:
        one = options_in(Options)[field["name"]]
        assert field["label"].startswith(one.label) and field["help"] == one.text


def test_help_shows_what_the_docstrings_of_the_fields_say() -> None:
    """Oracle: the source text of two fields."""
    texts = {name: one.text for name, one in options_in(Options).items()}
    assert texts["seed"].startswith("Fillers draw their random numbers from this")
    assert texts["dilate_holes"] == "Grow the holes of the new view by this many pixels."
    assert get_type_hints(Method, include_extras=True)["seed"].__metadata__[0].help == texts["seed"]


def test_the_closed_words_are_those_of_the_library() -> None:
    typed = options_in(Options)
    assert typed["mode"].kind == Literal[MODES] | None and typed["mode"].metavar == "|".join(MODES)
    assert typed["depth_by"].kind == DepthBy | None and typed["depth_by"].metavar == "|".join(get_args(DepthBy))
    assert typed["recipe"].metavar == "|".join(RECIPES)


@pytest.mark.parametrize("verb", [dlama.view, dlama.remove, dlama.stereo, dlama.complete])
def test_verbs_show_each_option_as_a_keyword(verb: Callable[..., object]) -> None:
    parameters = inspect.signature(verb).parameters
    shown = {name: one.default for name, one in parameters.items() if name in NAMES}
    assert shown == {one.name: one.default for one in fields(Options)}
    assert all(one.kind is not one.VAR_KEYWORD for one in parameters.values())
    assert all(parameters[name].kind is inspect.Parameter.KEYWORD_ONLY for name in NAMES)


def test_options_of_a_recipe_have_the_types_of_its_settings() -> None:
    """Oracle: the fields of Recipe; each may be None, which leaves the recipe's."""
    for name in OF_RECIPE:
        types = (str(cls.__annotations__[name]).split(" | ") for cls in (Options, Recipe))
        assert set(next(types)) == {*next(types), "None"}


def test_every_wrong_option_is_named_once() -> None:
    with pytest.raises(InputError) as caught:
        Options(seed=-1, min_confidence=2.0, mode="mesh", dilate=-3)  # type: ignore[arg-type]
    parts = str(caught.value).split("; ")
    assert sum(part.startswith(("mode is", "dilate is", "seed is", "min_confidence is")) for part in parts) == 4
    assert str(caught.value).count("seed") == 1


def test_contradictions_and_unknown_names() -> None:
    """The paper's depth is 8-bit, which needs a clip depth and the filler's own depth."""
    with pytest.raises(InputError, match="depth_by 'filler' is expected"):
        Options(recipe="paper", depth_by="surfaces")
    assert Options(recipe="paper", clip=5.0).settings.clip == 5.0
    with pytest.raises(InputTypeError, match="fillr is no parameter; the options are filler, model"):
        options_of({"fillr": "telea"})
    with pytest.raises(InputTypeError, match="seed is"):
        options_of({"seed": "0"})
