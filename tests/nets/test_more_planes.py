"""Widened weights fill colour exactly as before, whatever the new planes hold."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dlama.errors import ShapeError
from dlama.nets.architecture import GeneratorSettings, settings_from_state
from dlama.nets.checkpoints import widen
from dlama.nets.generator import generator_from_state

SMALL = GeneratorSettings(width=8, blocks=1)


@pytest.mark.parametrize(("planes_in", "planes_out"), [(5, 4), (7, 6), (5, 3)])
def test_colour_is_the_same_at_step_0(random_state, planes_in, planes_out):
    """Oracle: the network before surgery."""
    state = random_state(SMALL)
    picture = torch.rand(2, 4, 32, 48)
    new = torch.rand(2, planes_in - 4, 32, 48)
    with torch.inference_mode():
        before = generator_from_state(state)(picture)
        after = generator_from_state(widen(state, planes_in, planes_out))(
            torch.cat([picture[:, :3], new, picture[:, 3:]], dim=1)
        )
    assert after.shape[1] == planes_out and before.std() > 0.1
    torch.testing.assert_close(after[:, :3], before, rtol=0, atol=1e-7)
    assert (after[:, 3:] == 0.5).all()


def test_new_planes_learn_from_the_first_step(random_state):
    """Oracle: law; zero weights, but no zero gradient."""
    net = generator_from_state(widen(random_state(SMALL), 5, 4))
    net(torch.rand(1, 5, 32, 32)).square().mean().backward()
    assert net.model[1].ffc.convl2l.weight.grad[:, 3].abs().sum() > 0
    assert net.model[-2].weight.grad[3].abs().sum() > 0


def test_the_mask_stays_last_and_nothing_else_changes(random_state):
    """Oracle: the tensors before surgery, which are left as they were."""
    state = random_state(SMALL)
    kept = {name: array.copy() for name, array in state.items()}
    wide = widen(state, 7, 6)
    assert settings_from_state({name: array.shape for name, array in wide.items()}) == GeneratorSettings(7, 6, 8, 3, 1)
    stem = "model.1.ffc.convl2l.weight"
    np.testing.assert_array_equal(wide[stem][:, -1], state[stem][:, 3])
    np.testing.assert_array_equal(wide[stem][:, :3], state[stem][:, :3])
    assert not wide[stem][:, 3:6].any()
    differing = {name for name in state if wide[name].shape != state[name].shape or (wide[name] != state[name]).any()}
    assert differing == {stem, "model.17.weight", "model.17.bias"}
    assert all((state[name] == kept[name]).all() for name in kept)


def test_planes_are_never_taken_away(random_state):
    """Oracle: the documentation."""
    with pytest.raises(ShapeError, match="4 -> 3 planes cannot become 3 -> 3"):
        widen(random_state(SMALL), 3, 3)
