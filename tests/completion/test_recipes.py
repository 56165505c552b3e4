"""Recipes: what the two names stand for, and every contradiction refused with a message that says what was wanted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dlama.completion.recipes import RECIPES, Recipe, check_seed, find_recipe
from dlama.completion.start import filler_of_recipe
from dlama.errors import InputError
from dlama.evaluation.protocols.methods import Method


def test_the_two_recipes_are_what_the_docs_say() -> None:
    """Frozen: ours draws surfaces, fills the source first, clips nothing; the paper's draws points, clips at 10 m, writes
    8-bit depth, adds the footprint; masks grow by 3 px, ours by what the depth
    asks for, and crack-free holes by none."""
    assert list(RECIPES) == ["dlama", "paper"] and all(name == one.name for name, one in RECIPES.items())
    ours = Recipe(
        "dlama", mode="surface", dilate=None, dilate_holes=0, clip=None, eight_bit_depth=False, depth_by="surfaces",
        law=True, footprint=False, source_first=True,
    )  # fmt: skip
    papers = Recipe(
        "paper", mode="points", dilate=3, dilate_holes=0, clip=10.0, eight_bit_depth=True, depth_by="filler",
        law=True, footprint=True, source_first=False,
    )  # fmt: skip
    assert (find_recipe("dlama"), find_recipe("paper")) == (ours, papers)


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
    """Message: names the setting, what came and what was wanted."""
    with pytest.raises(InputError, match=message):
        dataclasses.replace(find_recipe("dlama"), **changes)


def test_seeds_are_bounded_wherever_they_are_given() -> None:
    """As NumPy's generators and numba's take them; an evaluation's method refuses them before any case is run."""
    for seed in (0, 2**32 - 1, np.int64(7)):
        check_seed(seed)  # type: ignore[arg-type]
    for seed in (-1, 2**32, 1.5):
        for make in (check_seed, lambda seed: Method("dlama", "telea", seed=seed)):
            with pytest.raises(InputError, match=f"seed is {seed}"):
                make(seed)


def test_a_filler_keeps_its_own_depth_where_it_is_clipped_alone() -> None:
    """8-bit depth is a matter of its own: `clip` without it leaves the filler as it is."""

    def own(*_: object) -> None: ...

    assert filler_of_recipe(own, Recipe("mine", depth_by="filler", clip=10.0)) is own  # type: ignore[arg-type]
    eight_bit = Recipe("mine", depth_by="filler", clip=10.0, eight_bit_depth=True)
    assert filler_of_recipe(own, eight_bit) is not own  # type: ignore[arg-type]
