"""Batches in -> generator and discriminator trained by one step each per batch, out: the Lightning module."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor, nn

from dlama.errors import DlamaError, InputError
from dlama.models.cache import user_path
from dlama.nets.checkpoints import read_generator, widen
from dlama.nets.generator import Discriminator, Generator, generator_from_state
from dlama.training.data.batches import Batch
from dlama.training.losses.perceptual import LpipsLoss, PerceptualLoss, perceptual_loss
from dlama.training.losses.pixels import widen_half
from dlama.training.losses.terms import LossInputs, Terms, discriminator_terms, generator_terms
from dlama.training.settings import NetworkSettings, TrainSettings

GUARD_EVERY = 50
"""Steps between two copies in memory that the run returns to after a gradient that is not finite."""
MOST_RESTORED = 20
"""Batches in a row without a finite gradient, after which the run gives up."""


class TrainingModule(pl.LightningModule):
    """The generator, its moving average, the discriminator, the losses, and the guard against gradients that are not finite.

    Counts steps (`step`) and samples of all processes (`samples`) by itself; `latest` has the terms of the last step.
    """

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.settings = settings
        torch.manual_seed(settings.loop.seed)
        self.generator: Generator = initial_generator(settings.network)
        self.discriminator = Discriminator(settings.network.discriminator) if settings.loss.uses_discriminator else None
        self.average = copy.deepcopy(self.generator).eval().requires_grad_(False)
        self.perceptual: PerceptualLoss | LpipsLoss | None = (
            perceptual_loss(settings.loss) if settings.loss.perceptual else None
        )
        self.step, self.samples, self.restored, self.bad_in_a_row = 0, 0, 0, 0
        self.latest: dict[str, Tensor] = {}
        self.saved_optimisers: list[dict[str, Any]] | None = None
        self.guard = Guard()
        self._compiled: list[Any] = [torch.compile(self.generator)] if settings.loop.compiled else []

    @property
    def networks(self) -> dict[str, nn.Module]:
        """The networks that a checkpoint keeps, by their names there."""
        kept: dict[str, nn.Module] = {"generator": self.generator, "average": self.average}
        return kept | ({} if self.discriminator is None else {"discriminator": self.discriminator})

    @property
    def raw_optimisers(self) -> list[torch.optim.Optimizer]:
        """Torch's optimisers: the generator's, then the discriminator's."""
        return self.trainer.optimizers

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """Adam for each network; in a resumed run with the state of the checkpoint."""
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
        """Train mode, and the first state of the guard."""
        self.train()
        self.guard.keep(self)

    def train(self, mode: bool = True) -> TrainingModule:
        """The average stays in eval mode."""
        super().train(mode)
        self.average.eval()
        return self

    def forward(self, planes: Tensor) -> Tensor:
        """B x C x H x W -> B x P x H x W, through the generator (not its average)."""
        return self._compiled[0](planes) if self._compiled else self.generator(planes)

    def training_step(self, batch: Batch, batch_index: int) -> None:
        """One step of the generator, then one of the discriminator on the same output; undone where gradients are not finite."""
        optimisers = self.raw_optimisers
        self._set_rates(optimisers)
        output = self(batch["input"])
        terms = self._generator_terms(output, batch)
        norms = {"gradient_norm": self._descend(optimisers[0], self.generator, terms)}
        good = bool(norms["gradient_norm"].isfinite())
        if good:
            self._take_step(0)
            update_average(self.average, self.generator, self.settings.optimiser.average, self.step)
        if good and self.discriminator is not None:
            own = discriminator_terms(self.discriminator, output, batch, self._penalty())
            norms["discriminator_norm"] = self._descend(optimisers[1], self.discriminator, own)
            good = bool(norms["discriminator_norm"].isfinite())
            if good:
                self._take_step(1)
            terms |= own
        self.latest = {name: value.detach() for name, value in (terms | norms).items()}
        self._count(batch, good)

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

    def _descend(self, optimiser: torch.optim.Optimizer, network: nn.Module, terms: Terms) -> Tensor:
        """Compute the gradients of the sum of terms and clip them; their norm before clipping, the same on all devices."""
        optimiser.zero_grad(set_to_none=True)
        self.manual_backward(torch.stack([widen_half(term) for term in terms.values()]).sum())
        return nn.utils.clip_grad_norm_(network.parameters(), self.settings.optimiser.clip or math.inf)

    def _take_step(self, which: int) -> None:
        """Step of the generator's (0) or the discriminator's (1) optimiser, by Lightning, for its precision plugin."""
        found = self.optimizers()
        (found if isinstance(found, list) else [found])[which].step()

    def _set_rates(self, optimisers: list[torch.optim.Optimizer]) -> None:
        """Learning rates of the coming step."""
        s = self.settings.optimiser
        factor = rate_factor(self.settings, self.step)
        for optimiser, rate in zip(optimisers, (s.generator_rate, s.discriminator_rate)):
            optimiser.param_groups[0]["lr"] = rate * factor

    def _penalty(self) -> float:
        """Weight of R1 in this step."""
        every = self.settings.loss.penalty_every
        return self.settings.loss.gradient_penalty * every if self.step % every == 0 else 0.0

    def _count(self, batch: Batch, good: bool) -> None:
        """Count the step; where it was not good, restore the state that the guard kept last."""
        self.step += 1
        self.samples += len(batch["input"]) * self.trainer.world_size
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


def initial_generator(network: NetworkSettings) -> Generator:
    """The generator in train mode: new weights drawn from torch's random numbers, or those of the file `network.start`.

    Raises:
        FileError: `network.start` is no file with one generator in it.
        InputError: it is another network than the settings describe, planes apart.
    """
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

    def keep(self, module: TrainingModule) -> None:
        """Copy the module's present state, on the device where it lies."""
        self._networks = {name: copy.deepcopy(network.state_dict()) for name, network in module.networks.items()}
        self._optimisers = [copy.deepcopy(optimiser.state_dict()) for optimiser in module.raw_optimisers]

    def restore(self, module: TrainingModule) -> None:
        """Put the state that was kept last back; `on_train_start` keeps the first."""
        for name, network in module.networks.items():
            network.load_state_dict(self._networks[name])
        for optimiser, state in zip(module.raw_optimisers, self._optimisers):
            optimiser.load_state_dict(copy.deepcopy(state))  # Adam would keep writing into the kept tensors
