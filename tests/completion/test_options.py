"""One definition of the options (oracles: the fields of `Options`; the signatures, flags, columns and fields made from them), and
recipes: what the two names stand for, and every contradiction refused with a message that says what was expected."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Literal, get_args

import numpy as np
import pytest
from small_street import CAMERA, street

import dlama
from dlama.apps.options import Method
from dlama.apps.terminal.flags import flags_of
from dlama.completion.options import OF_RECIPE, OptionKeywords, Options, options_in, options_of
from dlama.completion.recipes import RECIPES, DepthBy, Recipe, check_seed, find_recipe
from dlama.completion.start import filler_of_recipe
from dlama.errors import InputError, InputTypeError
from dlama.evaluation.protocols import methods
from dlama.geometry.camera import StereoRig
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rendering import MODES
from dlama.jobs.parameters import METHOD
from dlama.web.form import describe_form
from worlds import moved

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


def test_auto_takes_no_model_whatever_the_picture() -> None:
    """Message: a model goes with a filler's name; which one `auto` chooses depends on the picture. Everywhere the same."""
    frame, aside = street(), orbit(CAMERA, 14)
    estimated = dataclasses.replace(frame, estimate={"model": "any"})
    scene = dlama.scene([frame])
    rig = StereoRig(CAMERA, moved(CAMERA, shift=(0.1, 0, 0)))
    for run in (
        lambda: dlama.view(frame, yaw=5, model="any.onnx"),
        lambda: dlama.view(estimated, yaw=5, model="any.onnx"),
        lambda: dlama.render_path(scene, [aside], model="any.onnx"),
        lambda: dlama.stereo(frame.color, frame.color, rig, model="any.onnx"),
    ):
        with pytest.raises(InputError, match=r"model is any.onnx and filler 'auto', which chooses by the depth"):
            run()


def test_changes_replace_and_none_does_not() -> None:
    """Law: a change of None (an option nobody gave) leaves the recipe as it is; the named recipe itself never changes."""
    changed = find_recipe("dlama", mode="points", dilate=0, clip=None)
    assert (changed.mode, changed.dilate, changed.clip) == ("points", 0, None)
    assert find_recipe("paper", clip=None).clip == 10.0
    assert RECIPES["dlama"] == Recipe("dlama")
    own = Recipe("mine", dilate=7)
    assert find_recipe(own) == own and find_recipe(own, dilate=2).dilate == 2
    with pytest.raises(InputError, match="recipe is 'lama'; one of dlama, paper is expected"):
        find_recipe("lama")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mode": "voxels"}, "mode is 'voxels'; one of surface, points is expected"),
        ({"dilate": -1}, "dilate is -1; a whole number from 0"),
        ({"dilate": 1.5}, "dilate is 1.5; a whole number from 0 to 1024 is expected"),
        ({"dilate_holes": -2}, "dilate_holes is -2; a whole number from 0"),
        ({"clip": 0.0}, "clip is 0.0 m; 0.01 or more"),
        ({"clip": float("nan")}, "clip is nan m; 0.01 or more"),
        ({"clip": "3"}, "clip is '3' m; 0.01 or more"),
        ({"dilate": "3"}, "dilate is '3'; a whole number from 0"),
        ({"eight_bit_depth": True}, "8-bit depth needs clip"),
        ({"eight_bit_depth": True, "clip": 10.0}, "8-bit depth is the filler's; depth_by 'filler'"),
        ({"depth_by": "luck"}, "depth_by is 'luck'; one of surfaces, filler is expected"),
    ],
)
def test_contradictions_are_refused(changes: dict, message: str) -> None:
    """Message: names the setting, what came and what was expected."""
    with pytest.raises(InputError, match=message):
        dataclasses.replace(find_recipe("dlama"), **changes)


def test_seeds_are_bounded_wherever_they_are_given() -> None:
    """As NumPy's generators and numba's take them; an evaluation's method refuses them before any case is run."""
    for seed in (0, 2**32 - 1, np.int64(7)):
        check_seed(seed)  # type: ignore[arg-type]
    for seed in (-1, 2**32, 1.5):
        for make in (check_seed, lambda seed: methods.Method("dlama", "telea", seed=seed)):
            with pytest.raises(InputError, match=f"seed is {seed}"):
                make(seed)


def test_a_filler_keeps_its_own_depth_where_it_is_clipped_alone() -> None:
    """8-bit depth is a matter of its own: `clip` without it leaves the filler as it is."""

    def own(*_: object) -> None: ...

    assert filler_of_recipe(own, Recipe("mine", depth_by="filler", clip=10.0)) is own  # type: ignore[arg-type]
    eight_bit = Recipe("mine", depth_by="filler", clip=10.0, eight_bit_depth=True)
    assert filler_of_recipe(own, eight_bit) is not own  # type: ignore[arg-type]
