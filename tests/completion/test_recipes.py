"""Recipes: what the two names stand for, and every contradiction refused with a message that says what was wanted."""

from __future__ import annotations

import dataclasses

import pytest

from dlama.completion.pipeline import find_recipe
from dlama.completion.recipes import RECIPES, Recipe, recipe
from dlama.errors import InputError


def test_the_two_recipes_are_what_the_docs_say() -> None:
    """Frozen: ours draws surfaces, fills the source first, clips nothing; the paper's draws points, clips at 10 m, writes
    8-bit depth, adds the footprint; both dilate masks by 3 px and crack-free holes by none."""
    assert list(RECIPES) == ["dlama", "paper"] and all(name == one.name for name, one in RECIPES.items())
    assert dataclasses.asdict(recipe("dlama")) == {
        "name": "dlama",
        "mode": "surface",
        "dilate": 3,
        "dilate_holes": 0,
        "clip_m": None,
        "eight_bit_depth": False,
        "depth_by": "surfaces",
        "law": True,
        "footprint": False,
        "source_first": True,
    }
    assert dataclasses.asdict(recipe("paper")) == {
        "name": "paper",
        "mode": "points",
        "dilate": 3,
        "dilate_holes": 0,
        "clip_m": 10.0,
        "eight_bit_depth": True,
        "depth_by": "filler",
        "law": True,
        "footprint": True,
        "source_first": False,
    }


def test_changes_replace_and_none_does_not() -> None:
    """Law: a change of None (an option nobody gave) leaves the recipe as it is; the named recipe itself never changes."""
    changed = recipe("dlama", mode="points", dilate=0, clip_m=None)
    assert (changed.mode, changed.dilate, changed.clip_m) == ("points", 0, None)
    assert recipe("paper", clip_m=None).clip_m == 10.0
    assert RECIPES["dlama"] == Recipe("dlama")
    own = Recipe("mine", dilate=7)
    assert recipe(own) == own and recipe(own, dilate=2).dilate == 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mode": "voxels"}, "mode is 'voxels'; one of surface, points is wanted"),
        ({"dilate": -1}, "dilate is -1 px; 0 or more"),
        ({"dilate_holes": -2}, "dilate_holes is -2 px; 0 or more"),
        ({"clip_m": 0.0}, "clip_m is 0.0 m; more than 0"),
        ({"clip_m": float("nan")}, "clip_m is nan m; more than 0"),
        ({"eight_bit_depth": True}, "8-bit depth needs clip_m"),
        ({"eight_bit_depth": True, "clip_m": 10.0}, "8-bit depth is the filler's; depth_by 'filler'"),
        ({"depth_by": "luck"}, "depth_by is 'luck'; surfaces or filler"),
    ],
)
def test_contradictions_are_refused(changes: dict, message: str) -> None:
    """Message: names the setting, what came and what was wanted."""
    with pytest.raises(InputError, match=message):
        recipe("dlama", **changes)


def test_unknown_names_list_the_known_ones() -> None:
    """Message: an unknown recipe lists the recipes, an unknown setting all settings."""
    with pytest.raises(InputError, match="recipe is 'lama'; one of dlama, paper is wanted"):
        recipe("lama")
    with pytest.raises(InputError, match="'dilation' is no setting of a recipe") as error:
        find_recipe("dlama", {"dilation": 3})
    assert all(field.name in str(error.value) for field in dataclasses.fields(Recipe))
