"""The filler `choice`: what it takes from its guesses, what it says of them, what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.completion.recipes import RECIPES
from dlama.completion.start import filler_of_recipe
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters import find_filler
from dlama.inpainters.choice.filler import JUDGE, fill_by_choice, make_choice_filler
from dlama.inpainters.choice.guesses import GUESSES, Guess, guess_of_filler, make_guesses, makers_of
from dlama.inpainters.choice.judge import open_judge
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, inpaint
from worlds import Box, Plane, Sphere, World, moved

CHEAP = ("telea", "pull-push")


def moved_view(width: int = 96, height: int = 72) -> tuple[View, FillContext]:
    """A floor, a wall, sky, a ball and a sensor hole seen from 60 cm aside: every kind of hole."""
    world = World((Plane((0, 1, 0), (0, 1, 0)), Box((-9, -0.5, 6), (9, 1, 7)), Sphere((0, 0.3, 3), 0.4)))
    frame = world.rgbd(Camera.from_fov(width, height, 70))
    depth = frame.depth.copy()
    depth[-12:-6, 20:30] = 0
    source = View.from_rgbd(RGBD(frame.color, depth, frame.camera))
    return render(source, moved(frame.camera, (0, -8, 0), (0.6, 0, 0))), FillContext.of(Scene((source,)))


@pytest.mark.parametrize("size", [(96, 72), (61, 47), (5, 130)])
def test_every_size_is_filled_lawfully(size):
    """Law: known pixels bit for bit, every hole filled, the visibility law kept, the same bits again."""
    view, context = moved_view(*size)
    filled, report = inpaint(view, make_choice_filler(open_judge(JUDGE), guesses=CHEAP), context)
    again, _ = inpaint(view, make_choice_filler(open_judge(JUDGE), guesses=CHEAP), context)
    known = ~view.hole
    for field in ("color", "depth", "origin", "confidence"):
        np.testing.assert_array_equal(getattr(filled, field)[known], getattr(view, field)[known])
        np.testing.assert_array_equal(getattr(filled, field), getattr(again, field))
    assert not filled.hole.any() and (filled.depth > 0).all() and report.law_violations == 0


@pytest.mark.slow
def test_the_guesses_that_ship_all_run():
    """Oracle: the closed list; known pixels of every guess are the view's; the notes name them and their shares add up to 1."""
    view, context = moved_view()
    made = make_guesses(view, context, 0, makers_of(tuple(GUESSES)))
    assert [one.name for one in made] == list(GUESSES)
    for one in made:
        np.testing.assert_array_equal(one.color[~view.color_hole], view.color[~view.color_hole])
        assert (one.inverse_depth >= 0).all() and np.isfinite(one.inverse_depth).all()
    notes = fill_by_choice(view, context.law, made, open_judge(JUDGE)).notes
    assert notes["guesses"] == list(GUESSES)
    for part in ("color", "detail", "depth"):
        assert sum(share[part] for share in notes["guess_shares"].values()) == pytest.approx(1, abs=1e-3)


def test_order_of_guesses_changes_nothing():
    """Law of sets: colours within a level, depth bit for bit."""
    view, context = moved_view()
    made = make_guesses(view, context, 0, makers_of(("layered", "telea", "pull-push")))
    one, other = (fill_by_choice(view, context.law, guesses, open_judge(JUDGE)) for guesses in (made, made[::-1]))
    assert np.abs(one.color.astype(int) - other.color).max() <= 1
    np.testing.assert_array_equal(one.depth, other.depth)


def test_a_single_guess_is_the_fill():
    """Law: K = 1 gives that guess back."""
    view, context = moved_view()
    (made,) = make_guesses(view, context, 0, makers_of(("layered",)))
    fill = fill_by_choice(view, context.law, (made,), open_judge(JUDGE))
    np.testing.assert_array_equal(fill.color, made.color)
    with np.errstate(divide="ignore"):
        np.testing.assert_allclose(fill.depth[view.hole], 1 / made.inverse_depth[view.hole], rtol=1e-6)


def test_where_all_guesses_agree_the_answer_is_theirs():
    """Closed form: equal guesses, whatever the weights; out of view they are hedged besides."""
    view, context = moved_view()
    (made,) = make_guesses(view, context, 0, makers_of(("telea",)))
    fill = fill_by_choice(view, context.law, (made, Guess("twin", made.color, made.inverse_depth)), open_judge(JUDGE))
    plain = view.hole_type != HoleType.OUT_OF_VIEW
    assert np.abs(fill.color.astype(int) - made.color)[plain].max() <= 1


def test_any_filler_becomes_a_guess():
    """Oracle: a filler that paints red at 2 m; its guess is red, and lawful."""
    view, context = moved_view()

    def red(view, context, seed):
        return Fill(np.full_like(view.color, (255, 0, 0)), np.full(view.hole.shape, 2, np.float32))

    (guess,) = make_guesses(view, context, 0, [guess_of_filler("red", red)])
    assert guess.name == "red" and (guess.color[view.color_hole] == (255, 0, 0)).all()
    away = 1 / guess.inverse_depth[view.hole & (guess.inverse_depth > 0)]
    assert away.min() >= 2 * (1 - 1e-6) and not np.allclose(away, 2), "moved behind what was measured"


def test_depth_alone_is_chosen_where_colours_are_known():
    """Law: a sensor hole keeps its measured colours."""
    depth = np.full((40, 50), 3, np.float32)
    depth[10:20, 10:30] = 0
    color = np.random.default_rng(0).integers(0, 256, (40, 50, 3), np.uint8)
    view = View.from_rgbd(RGBD(color, depth, Camera.from_fov(50, 40, 60)))
    filled, _ = inpaint(view, make_choice_filler(open_judge(JUDGE)), FillContext(Law(())))
    np.testing.assert_array_equal(filled.color, color)
    np.testing.assert_allclose(filled.depth, 3, rtol=0.01)
    assert (filled.hole_type == HoleType.SENSOR).sum() == 200


def test_unknown_guesses_are_refused():
    """Oracle: the message lists the known ones."""
    with pytest.raises(InputError, match="guess is 'magic'; one of layered, migan, telea, pull-push is expected"):
        makers_of(("layered", "magic"))
    with pytest.raises(InputError, match="each once"):
        makers_of(("telea", "telea"))
    with pytest.raises(InputError, match="guesses are none"):
        makers_of(())


def test_both_recipes_take_it():
    """Law: by surfaces it fills as it is, in 8-bit steps its depth is rounded."""
    filler = find_filler("choice")
    assert filler_of_recipe(filler, RECIPES["dlama"]) is filler
    view, context = moved_view()
    fill = filler_of_recipe(make_choice_filler(open_judge(JUDGE), guesses=CHEAP), RECIPES["paper"])(view, context, 0)
    assert len(np.unique(fill.depth)) <= 255
