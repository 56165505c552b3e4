"""What is known of fillers beforehand: closed forms of the two rules on made-up planes."""

from __future__ import annotations

import numpy as np

from dlama.inpainters.choice.judge import STRIDE, Verdict
from dlama.inpainters.choice.planes import CONTEXT, JudgePlanes
from dlama.inpainters.choice.priors import DEPTH_PRIORS, PRIORS, measure_invented_detail, with_priors

SIDE = 64


def planes(out_of_view: bool) -> JudgePlanes:
    """A plain picture whose middle is a hole; the first guess continues as plain, the second has stripes."""
    context = np.zeros((len(CONTEXT), SIDE, SIDE), np.float32)
    context[CONTEXT.index("hole"), 16:48, 16:48] = 1
    context[CONTEXT.index("out of view"), 16:48, 16:48] = out_of_view
    guesses = np.full((2, 4, SIDE, SIDE), 0.5, np.float32)
    guesses[1, :3, 16:48, 16:48:2] = 0.9
    return JudgePlanes(context, guesses)


def test_stripes_in_a_plain_picture_are_invented():
    """Closed form: nothing for what is as plain as its surroundings; stripes of 0.2 about their mean are log(51 +- 10) or so."""
    found = measure_invented_detail(planes(out_of_view=False))
    assert found.shape == (2, SIDE // STRIDE, SIDE // STRIDE)
    np.testing.assert_array_equal(found[0], 0)
    assert np.log(41) < found[1, 8, 8] < np.log(61) and found[1, 0, 0] < 0.01
    np.testing.assert_array_equal(measure_invented_detail(planes(out_of_view=True))[:, 6:10, 6:10], 0)


def test_which_guess_is_first_says_nothing_about_what_is_known():
    """Law of sets: guesses the other way round, bit for bit; what one paints next to the hole is not what is known there."""
    seen = planes(out_of_view=False)
    turned = JudgePlanes(seen.context, seen.guesses[::-1].copy())
    np.testing.assert_array_equal(measure_invented_detail(turned), measure_invented_detail(seen)[::-1])


def test_a_prior_goes_with_the_name():
    """Closed form: equal logits come apart by the prior of `layered`, wherever it stands; errors stay."""
    maps = np.zeros((2, SIDE // STRIDE, SIDE // STRIDE), np.float32)
    verdict = Verdict(maps, maps, maps, maps[0], maps[0])
    seen = planes(out_of_view=True)
    for names, sign in ((("layered", "telea"), 1), (("telea", "layered"), -1), (("a", "b"), 0)):
        found = with_priors(verdict, names, seen)
        for part in (found.base, found.detail):
            np.testing.assert_allclose((part[0] - part[1])[6:10, 6:10], sign * PRIORS["layered"])
        np.testing.assert_allclose(found.depth[0] - found.depth[1], sign * DEPTH_PRIORS["layered"])
        assert found.color_error is verdict.color_error
