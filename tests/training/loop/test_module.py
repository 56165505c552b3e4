"""Parts of one training step: the weight of R1, and what the guard keeps (oracles: closed forms, laws)."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import torch
from toy_runs import toy

from dlama.training.loop.module import Guard, TrainingModule


def test_r1_every_fourth_step_is_four_times_as_strong():
    """Closed form: over a round of steps its weights add up to those of every step."""
    chosen = toy()
    module = TrainingModule(replace(chosen, loss=replace(chosen.loss, gradient_penalty=0.25, penalty_every=4)))
    weights = []
    for module.step in range(8):
        weights.append(module._penalty())
    assert weights == [1.0, 0, 0, 0, 1.0, 0, 0, 0]


def learn(module, steps):
    """Some steps of Adam towards other numbers."""
    (optimiser,) = module.raw_optimisers
    for _ in range(steps):
        optimiser.zero_grad()
        sum((weight - 3).square().sum() for weight in module.networks["one"].parameters()).backward()
        optimiser.step()
        module.step += 1


def numbers(module):
    """All weights, and Adam's running means."""
    (optimiser,) = module.raw_optimisers
    means = [value.clone() for state in optimiser.state_dict()["state"].values() for value in state.values()]
    return [value.clone() for value in module.networks["one"].state_dict().values()] + means


def same(one, other):
    """Bit for bit."""
    return len(one) == len(other) and all(torch.equal(a, b) for a, b in zip(one, other))


def test_the_guard_gives_back_what_it_kept_as_often_as_it_is_asked():
    """Law: learning on, before or after it was given back, leaves what was kept as it was; the last state kept counts."""
    network = torch.nn.Linear(2, 2)
    module = SimpleNamespace(
        networks={"one": network}, raw_optimisers=[torch.optim.Adam(network.parameters(), lr=0.1)], step=0
    )
    guard = Guard()
    learn(module, 2)
    guard.keep(module)
    learn(module, 1)
    first = numbers(module)
    guard.keep(module)
    for _ in range(3):
        learn(module, 3)
        assert not same(numbers(module), first)
        guard.restore(module)
        assert same(numbers(module), first)
