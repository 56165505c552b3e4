"""Batches in -> generator and discriminator trained by one step each per batch, out."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor, nn

from dlama.errors import DlamaError, InputError
from dlama.models.cache import user_path
from dlama.nets.checkpoints import read_generator
from dlama.nets.generator import Discriminator, Generator, generator_from_state
from dlama.nets.judge import GuessMixer
from dlama.nets.surgery import widen
from dlama.training.data.batches import Batch, network_input
from dlama.training.losses.perceptual import perceptual_loss
from dlama.training.losses.pixels import widen_half
from dlama.training.losses.terms import LossInputs, Terms, discriminator_terms, generator_terms
from dlama.training.settings import NetworkSettings, TrainSettings

GUARD_EVERY = 50
"""Steps between two copies in memory that the run returns to after a gradient that is not finite."""
MOST_RESTORED = 20
"""Batches in a row without a finite gradient, after which the run gives up."""


class Training:
    """The generator, its moving average, the discriminator, the losses, and the guard against gradients that are not finite.

    Counts steps (`step`) and samples (`samples`); `latest` has the terms of the last step.
    """

    def __init__(self, settings: TrainSettings, device: str | torch.device = "cpu") -> None:
        self.settings, self.device = settings, torch.device(device)
        torch.manual_seed(settings.loop.seed)
        self.generator = initial_generator(settings.network).to(device)
        self.discriminator = None
        if settings.loss.uses_discriminator:
            self.discriminator = Discriminator(settings.network.discriminator).to(device)
        self.average = moving_average(self.generator)
        self.perceptual = perceptual_loss(settings.loss).to(device) if settings.loss.perceptual else None
        self.optimisers = self._optimisers()
        self.step, self.samples, self.restored, self.bad_in_a_row = 0, 0, 0, 0
        self.latest: dict[str, Tensor] = {}
        self.guard = Guard()
        self._network: Any = torch.compile(self.generator) if settings.loop.compiled else self.generator

    @property
    def networks(self) -> dict[str, nn.Module]:
        """The networks that a checkpoint keeps, by their names there."""
        kept: dict[str, nn.Module] = {"generator": self.generator, "average": self.average}
        return kept | ({} if self.discriminator is None else {"discriminator": self.discriminator})

    def train_step(self, batch: Batch) -> None:
        """One step of the generator, then one of the discriminator on the same output; undone where gradients are not finite."""
        if self.guard.is_empty:
            self.guard.keep(self)
        half = self.settings.loop.precision == "bf16"
        # without the cache: weights change within a step, and what is cached under no_grad has no gradient
        with torch.autocast(self.device.type, torch.bfloat16, enabled=half, cache_enabled=False):
            good = self._descend_both(batch)
        self._count(batch, good)

    def _descend_both(self, batch: Batch) -> bool:
        """Whether all gradients were finite."""
        self._set_rates()
        output = self._network(network_input(batch))
        terms = self._generator_terms(output, batch)
        norms = {"gradient_norm": self._gradients(0, self.generator, terms)}
        good = bool(norms["gradient_norm"].isfinite())
        if good:
            self.optimisers[0].step()
            update_average(self.average, self.generator, self.settings.optimiser.average, self.step)
        if good and self.discriminator is not None:
            own = discriminator_terms(self.discriminator, output, batch, self.settings.loss, self.penalty)
            norms["discriminator_norm"] = self._gradients(1, self.discriminator, own)
            good = bool(norms["discriminator_norm"].isfinite())
            if good:
                self.optimisers[1].step()
            terms |= own
        self.latest = {name: value.detach() for name, value in (terms | norms).items()}
        return good

    def _generator_terms(self, output: Tensor, batch: Batch) -> Terms:
        """The generator's weighted terms; the discriminator gets no gradients from them."""
        settings = self.settings
        inputs = LossInputs(output, batch, settings.network, settings.loss, self.perceptual, self.discriminator)
        if self.discriminator is None:
            return generator_terms(inputs)
        self.discriminator.requires_grad_(False)
        terms = generator_terms(inputs)
        self.discriminator.requires_grad_(True)
        return terms

    def _gradients(self, which: int, network: nn.Module, terms: Terms) -> Tensor:
        """Compute the gradients of the sum of terms and clip them; their norm before clipping."""
        self.optimisers[which].zero_grad(set_to_none=True)
        torch.stack([widen_half(term) for term in terms.values()]).sum().backward()
        return nn.utils.clip_grad_norm_(network.parameters(), self.settings.optimiser.clip or math.inf)

    def _optimisers(self) -> list[torch.optim.Optimizer]:
        """Adam for the generator, then for the discriminator where there is one."""
        s = self.settings.optimiser
        return [
            torch.optim.Adam(network.parameters(), lr=rate, betas=(s.beta1, s.beta2))
            for network, rate in ((self.generator, s.generator_rate), (self.discriminator, s.discriminator_rate))
            if network is not None
        ]

    def _set_rates(self) -> None:
        """Learning rates of the coming step."""
        s = self.settings.optimiser
        factor = rate_factor(self.settings, self.step)
        for optimiser, rate in zip(self.optimisers, (s.generator_rate, s.discriminator_rate)):
            optimiser.param_groups[0]["lr"] = rate * factor

    @property
    def penalty(self) -> float:
        """Weight of R1 in this step."""
        every = self.settings.loss.penalty_every
        return self.settings.loss.gradient_penalty * every if self.step % every == 0 else 0.0

    def _count(self, batch: Batch, good: bool) -> None:
        """Count the step; where it was not good, restore the state that the guard kept last."""
        self.step += 1
        self.samples += len(batch["input"])
        self.bad_in_a_row = 0 if good else self.bad_in_a_row + 1
        if not good:
            self.guard.restore(self)
            self.restored += 1
        elif self.step % GUARD_EVERY == 0:
            self.guard.keep(self)
        if self.bad_in_a_row > MOST_RESTORED:
            raise DlamaError(f"step {self.step}: {MOST_RESTORED} batches in a row gave gradients that are no numbers")


def rate_factor(settings: TrainSettings, step: int) -> float:
    """Factor of both learning rates in the step after `step` steps: warm-up times decay."""
    s, steps = settings.optimiser, settings.loop.steps
    rise = min(1.0, (step + 1) / (s.warm_up + 1))
    if s.decay == "none":
        return rise
    share = min(step / steps, 1.0)
    return rise * (0.01 + 0.99 * (1 + math.cos(math.pi * share)) / 2)


def initial_generator(network: NetworkSettings) -> Generator | GuessMixer:
    """The generator in train mode: new weights drawn from torch's random numbers, or those of the file `network.start`.

    Raises:
        FileError: `network.start` is no file with one generator in it.
        InputError: it is another network than the settings describe, planes apart.
    """
    if network.kind.guesses:
        return GuessMixer(network.judge, network.kind.guesses)
    if network.start is None:
        return Generator(network.generator)
    weights = read_generator(user_path(network.start))
    found = replace(
        weights.settings, in_channels=network.generator.in_channels, out_channels=network.generator.out_channels
    )
    if found != network.generator:
        raise InputError(f"{network.start}: is {weights.settings}; {network.generator} is expected by the settings")
    state = widen(weights.state, network.generator.in_channels, network.generator.out_channels)
    return generator_from_state(state).train()


def moving_average(network: nn.Module) -> nn.Module:
    """A moving average of the network's weights, at its beginning: a copy in eval mode that takes no gradient."""
    return copy.deepcopy(network).eval().requires_grad_(False)


@torch.no_grad()
def update_average(average: nn.Module, network: nn.Module, decay: float, step: int) -> None:
    """average = d x average + (1 - d) x network, d = min(decay, (1 + step) / (10 + step)): it forgets faster in the first steps.

    Batch norms' statistics are averaged as well (they forget within ten batches by themselves); counters are copied.
    """
    decay = min(decay, (1 + step) / (10 + step))
    for mine, theirs in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if mine.is_floating_point():
            mine.lerp_(theirs.to(mine.dtype), 1 - decay)
        else:
            mine.copy_(theirs)


class Guard:
    """Keeps one good state: networks, moving average, optimisers. Counters and random numbers are not part of it."""

    def __init__(self) -> None:
        self._networks: dict[str, Any] = {}
        self._optimisers: list[Any] = []

    @property
    def is_empty(self) -> bool:
        """Whether nothing was kept yet."""
        return not self._networks

    def keep(self, training: Training) -> None:
        """Copy the present state, on the device where it lies."""
        self._networks = {name: copy.deepcopy(network.state_dict()) for name, network in training.networks.items()}
        self._optimisers = [copy.deepcopy(optimiser.state_dict()) for optimiser in training.optimisers]

    def restore(self, training: Training) -> None:
        """Put the state that was kept last back."""
        for name, network in training.networks.items():
            network.load_state_dict(self._networks[name])
        for optimiser, state in zip(training.optimisers, self._optimisers):
            optimiser.load_state_dict(copy.deepcopy(state))  # Adam would keep writing into the kept tensors
