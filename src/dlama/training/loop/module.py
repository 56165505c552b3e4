"""Batches in -> two networks trained against each other, one step each per batch: what Lightning runs."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor, nn

from dlama.errors import DlamaError, InputError
from dlama.nets.checkpoints import read_generator
from dlama.nets.discriminator import Discriminator
from dlama.nets.generator import Generator, generator_from_state
from dlama.nets.surgery import widen
from dlama.training.data.batches import Batch
from dlama.training.loop.random_state import seed_everything
from dlama.training.losses import (
    Terms,
    discriminator_terms,
    judged_terms,
    perceptual_term,
    pixel_terms,
)
from dlama.training.perceptual import PerceptualLoss, perceptual_loss
from dlama.training.precision import precise
from dlama.training.settings import NetworkSettings, TrainSettings

MOST_BAD = 20
"""Batches in a row without a finite gradient, after which the run gives up."""


class TrainingModule(pl.LightningModule):
    """The generator, its moving average, the discriminator and the losses; counts steps and samples by itself."""

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.settings = settings
        seed_everything(settings.loop.seed)
        self.generator: Generator = started(settings.network)
        self.discriminator = Discriminator(settings.network.discriminator) if settings.loss.judged else None
        self.average = average_of(self.generator)
        self.perceptual: PerceptualLoss | None = perceptual_loss(settings.loss) if settings.loss.perceptual else None
        self.step, self.samples, self.restored, self.bad_in_a_row = 0, 0, 0, 0
        self.latest: dict[str, Tensor] = {}
        self.saved_optimisers: list[dict[str, Any]] | None = None
        self.guard = Guard()
        self._compiled: list[Any] = [torch.compile(self.generator)] if settings.loop.compiled else []

    @property
    def networks(self) -> dict[str, nn.Module]:
        """What a checkpoint keeps, by the names it has there."""
        kept: dict[str, nn.Module] = {"generator": self.generator, "average": self.average}
        return kept | ({} if self.discriminator is None else {"discriminator": self.discriminator})

    @property
    def raw_optimisers(self) -> list[torch.optim.Optimizer]:
        """Torch's own: the generator's, then the discriminator's."""
        found = self.optimizers(use_pl_optimizer=False)
        return list(found) if isinstance(found, list) else [found]

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """Adam for each network, with the state of a checkpoint where the run goes on."""
        s = self.settings.optimiser
        made: list[torch.optim.Optimizer] = [
            torch.optim.Adam(network.parameters(), lr=rate, betas=(s.beta1, s.beta2))
            for network, rate in ((self.generator, s.generator_rate), (self.discriminator, s.discriminator_rate))
            if network is not None
        ]
        for optimiser, state in zip(made, self.saved_optimisers or []):
            optimiser.load_state_dict(state)
        self.saved_optimisers = None
        return made

    def on_train_start(self) -> None:
        """Modes, memory order, and the first state to go back to."""
        self.train()
        if self.settings.loop.channels_last:
            for network in self.networks.values():
                network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.guard.keep(self)

    def train(self, mode: bool = True) -> TrainingModule:
        """The average and the trunk stay in eval mode, and all batch norms where they are frozen."""
        super().train(mode)
        self.average.eval()
        if self.settings.network.frozen_norms:
            for part in self.modules():
                if isinstance(part, nn.modules.batchnorm._BatchNorm):
                    part.eval()
        return self

    def forward(self, planes: Tensor) -> Tensor:
        """B x C x H x W -> B x P x H x W, by the generator that is being trained."""
        if self.settings.loop.channels_last:
            planes = planes.contiguous(memory_format=torch.channels_last)
        return self._compiled[0](planes) if self._compiled else self.generator(planes)

    def training_step(self, batch: Batch, batch_index: int) -> None:
        """Generator, then discriminator, each judged by the other as it was before this batch."""
        optimisers = self.raw_optimisers
        self._set_rates(optimisers)
        output = self(batch["input"])
        terms = self._generator_terms(output, batch)
        norms = {"gradient_norm": self._descend(optimisers[0], self.generator, terms)}
        good = bool(norms["gradient_norm"].isfinite())
        if good:
            self._take_step(0)
            follow(self.average, self.generator, self.settings.optimiser.average, self.step)
        if good and self.discriminator is not None:
            judged = discriminator_terms(self.discriminator, output, batch, self.settings.loss, self._penalty())
            norms["discriminator_norm"] = self._descend(optimisers[1], self.discriminator, judged)
            good = bool(norms["discriminator_norm"].isfinite())
            if good:
                self._take_step(1)
            terms |= judged
        self.latest = {name: value.detach() for name, value in (terms | norms).items()}
        self._count(batch, good)

    def _generator_terms(self, output: Tensor, batch: Batch) -> Terms:
        weights, network = self.settings.loss, self.settings.network
        terms = pixel_terms(output, batch, weights, network)
        if self.perceptual is not None:
            terms |= perceptual_term(output, batch, weights, network, self.perceptual)
        if self.discriminator is not None:
            self.discriminator.requires_grad_(False)  # its gradients of this pass are nobody's
            terms |= judged_terms(self.discriminator, output, batch, weights)
            self.discriminator.requires_grad_(True)
        return terms

    def _descend(self, optimiser: torch.optim.Optimizer, network: nn.Module, terms: Terms) -> Tensor:
        """Gradients of the sum of terms, clipped; their norm before that. It is the same on all devices."""
        optimiser.zero_grad(set_to_none=True)
        self.manual_backward(torch.stack([precise(term) for term in terms.values()]).sum())
        return nn.utils.clip_grad_norm_(network.parameters(), self.settings.optimiser.clip or math.inf)

    def _take_step(self, which: int) -> None:
        found = self.optimizers()
        (found if isinstance(found, list) else [found])[which].step()

    def _set_rates(self, optimisers: list[torch.optim.Optimizer]) -> None:
        s = self.settings.optimiser
        factor = rate_factor(self.settings, self.step)
        for optimiser, rate in zip(optimisers, (s.generator_rate, s.discriminator_rate)):
            optimiser.param_groups[0]["lr"] = rate * factor

    def _penalty(self) -> float:
        every = self.settings.loss.penalty_every
        return self.settings.loss.gradient_penalty * every if self.step % every == 0 else 0.0

    def _count(self, batch: Batch, good: bool) -> None:
        """The step is over; a bad one is undone, and so are the good ones since the last state that was kept."""
        self.step += 1
        self.samples += len(batch["input"]) * self.trainer.world_size
        self.bad_in_a_row = 0 if good else self.bad_in_a_row + 1
        if not good:
            self.guard.restore(self)
            self.restored += 1
        elif self.step % self.settings.loop.guard_every == 0:
            self.guard.keep(self)
        if self.bad_in_a_row > MOST_BAD:
            raise DlamaError(f"step {self.step}: {MOST_BAD} batches in a row gave gradients that are no numbers")


def rate_factor(settings: TrainSettings, step: int) -> float:
    """What the learning rates are multiplied by in the step after `step` steps: warm-up times decay."""
    s, steps = settings.optimiser, settings.loop.steps
    rise = min(1.0, (step + 1) / (s.warm_up + 1))
    if s.decay == "none":
        return rise
    share = min(step / steps, 1.0)
    return rise * (0.01 + 0.99 * (1 + math.cos(math.pi * share)) / 2)


def started(network: NetworkSettings) -> Generator:
    """The generator in train mode; new weights are drawn from torch's current random numbers.

    Raises:
        FileError: `network.start` is no file with one generator in it.
        InputError: it is another network than the settings describe, planes apart.
    """
    if network.start is None:
        return Generator(network.generator)
    weights = read_generator(Path(network.start).expanduser())
    had = replace(
        weights.settings, in_channels=network.generator.in_channels, out_channels=network.generator.out_channels
    )
    if had != network.generator:
        raise InputError(f"{network.start}: is {weights.settings}; the settings say {network.generator}")
    state = widen(weights.state, network.generator.in_channels, network.generator.out_channels)
    return generator_from_state(state).train()


def average_of(network: nn.Module) -> nn.Module:
    """A copy in eval mode that takes no gradient."""
    return copy.deepcopy(network).eval().requires_grad_(False)


@torch.no_grad()
def follow(average: nn.Module, network: nn.Module, memory: float, step: int) -> None:
    """One step: average = memory x average + (1 - memory) x network, with a shorter memory in the first steps.

    Batch norms' statistics are averaged as well (they forget within ten batches by themselves); counters are copied.
    """
    memory = min(memory, (1 + step) / (10 + step))
    for mine, theirs in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if mine.is_floating_point():
            mine.lerp_(theirs.to(mine.dtype), 1 - memory)
        else:
            mine.copy_(theirs)


class Guard:
    """Holds one good state: networks, moving average, optimisers. Counters and random numbers are not turned back."""

    def __init__(self) -> None:
        self._state: dict[str, Any] | None = None
        self.step = 0

    def keep(self, module: TrainingModule) -> None:
        """Copy the state as it is, on the device where it lies."""
        self._state = {
            "networks": {name: _copied(network.state_dict()) for name, network in module.networks.items()},
            "optimisers": [_copied(optimiser.state_dict()) for optimiser in module.raw_optimisers],
        }
        self.step = module.step

    def restore(self, module: TrainingModule) -> None:
        """Back to the state that was kept last."""
        assert self._state is not None  # `on_train_start` keeps the first
        for name, network in module.networks.items():
            network.load_state_dict(self._state["networks"][name])
        for optimiser, state in zip(module.raw_optimisers, self._state["optimisers"]):
            optimiser.load_state_dict(_copied(state))  # Adam would go on writing into the kept tensors


def _copied(state: dict[str, Any]) -> dict[str, Any]:
    return copy.deepcopy(dict(state))
