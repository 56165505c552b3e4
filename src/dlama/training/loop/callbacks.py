"""What happens between two steps: rows, sheets, checkpoints, and the question whether to stop. A Lightning callback."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch

from dlama.errors import OutputError
from dlama.training.data.batches import Batch
from dlama.training.flops import budget
from dlama.training.loop.checkpointing import LAST, checkpoint_of, write_checkpoint
from dlama.training.loop.module import TrainingModule, rate_factor
from dlama.training.loop.random_state import random_state, set_random_state
from dlama.training.loop.run_files import RunFiles
from dlama.training.loop.sample_sheets import write_sheet
from dlama.training.loop.validation import hole_metrics, metric_names
from dlama.training.settings import TrainSettings

LOG = logging.getLogger("dlama")
ALL_STEPS, TIME_IS_UP = "all steps done", "time is up"
SPEED = ("learning_rate", "samples_per_second", "waiting", "tflop_per_second", "memory_gb")
"""Columns of metrics.csv: the generator's rate; samples of all devices per second, the share of time that the training
waited for them, and TFLOP/s of both networks (see `budget`; the trunk is not counted), all three since the row before;
the first device's memory at its peak (the process's, on a CPU)."""


class Rhythm(pl.Callback):
    """Counts by the module's own step, so that a resumed run has the same rhythm.

    Args:
        deadline: when to stop, on the clock of `time.monotonic`.
        held_out: the fixed samples; None in all processes but the first.
        random_states: to go on with, by rank; None in a new run.
    """

    def __init__(
        self,
        settings: TrainSettings,
        run: Path,
        deadline: float,
        held_out: Batch | None,
        random_states: list[dict[str, Any]] | None,
        seconds: float,
    ) -> None:
        self.settings, self.run, self.deadline, self.held_out = settings, run, deadline, held_out
        self.random_states, self.seconds_before = random_states, seconds
        self.files: RunFiles | None = None
        self.device = torch.device("cpu")
        self.ended = ALL_STEPS
        self.checkpointed = -1
        self._started = self._row_began = self._batch_ended = time.monotonic()
        self._waited, self._row_samples, self._row_step = 0.0, 0, -1
        self._heard: int = 0
        self._old_handlers: dict[int, Any] = {}

    @property
    def seconds(self) -> float:
        """Trained so far, over all parts of the run."""
        return self.seconds_before + time.monotonic() - self._started

    def on_train_start(self, trainer: pl.Trainer, module: pl.LightningModule) -> None:
        """Files are opened; SIGTERM, and Ctrl-C for once, become requests to stop after the step."""
        assert isinstance(module, TrainingModule)
        self.device = module.device
        if trainer.is_global_zero:
            held_out = [f"held_out_{name}" for name in metric_names(self.settings.network)]
            self.files = RunFiles(self.run, [*SPEED, *_term_names(self.settings), *held_out], module.step)
            LOG.info("%s", module.perceptual.note if module.perceptual else "no perceptual term")
        if threading.current_thread() is threading.main_thread():
            self._old_handlers = {each: signal.signal(each, self._hear) for each in (signal.SIGTERM, signal.SIGINT)}
        self._started = self._row_began = self._batch_ended = time.monotonic()
        self._row_samples = module.samples

    def on_train_batch_start(self, trainer: pl.Trainer, module: pl.LightningModule, batch: Any, batch_idx: int) -> None:
        """The wait for the batch is over; the first batch of a resumed run gets the random numbers it would have had."""
        self._waited += time.monotonic() - self._batch_ended
        if self.random_states is not None:
            set_random_state(self.random_states[trainer.global_rank])
            self.random_states = None

    def on_train_batch_end(
        self, trainer: pl.Trainer, module: pl.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Whatever is due after this step."""
        assert isinstance(module, TrainingModule)
        loop, step = self.settings.loop, module.step
        kept = random_state()
        scores = self._look(module) if step % loop.validate_every == 0 else {}
        if step % loop.sheet_every == 0:
            self._sheet(module)
        if scores or step % loop.log_every == 0:
            self._row(module, scores)
        if step % loop.checkpoint_every == 0:
            self._checkpoint(trainer, module, must=False)
        if self._should_stop(trainer):
            trainer.should_stop = True
        set_random_state(kept)  # looking on must not change what comes after
        self._batch_ended = time.monotonic()

    def on_train_end(self, trainer: pl.Trainer, module: pl.LightningModule) -> None:
        """The last row and sheet, unless somebody is waiting, and the last checkpoint, which must succeed."""
        assert isinstance(module, TrainingModule)
        if self.ended in (ALL_STEPS, TIME_IS_UP):
            if self._row_step != module.step:
                self._row(module, self._look(module))
            if module.step % self.settings.loop.sheet_every:
                self._sheet(module)
        if self.checkpointed != module.step:
            self._checkpoint(trainer, module, must=True)
        self._give_back()

    def on_exception(self, trainer: pl.Trainer, module: pl.LightningModule, exception: BaseException) -> None:
        """Nothing is saved: the last checkpoint was of a state that was good."""
        self._give_back()
        self.close()

    def close(self) -> None:
        """The files, once."""
        if self.files is not None:
            self.files.close()
            self.files = None

    def _look(self, module: TrainingModule) -> dict[str, float]:
        return {} if self.held_out is None else scores_of(module.average, self.held_out, self.settings, module.device)

    def _sheet(self, module: TrainingModule) -> None:
        if self.files is None or self.held_out is None:
            return
        output = outputs_of(module.average, self.held_out, self.settings, module.device)
        write_sheet(self.files.sheet_path(module.step), output, self.held_out, self.settings.network)

    def _row(self, module: TrainingModule, scores: dict[str, float]) -> None:
        if self.files is None:
            return
        now = time.monotonic()
        took = max(now - self._row_began, 1e-9)
        rate = (module.samples - self._row_samples) / took
        speed = (
            self.settings.optimiser.generator_rate * rate_factor(self.settings, max(module.step - 1, 0)),
            rate,
            self._waited / took,
            rate * budget(self.settings).flop_per_sample / 1e12,
            peak_memory(module.device) / 1e9,
        )
        about = {"step": module.step, "samples": module.samples, "seconds": self.seconds, **dict(zip(SPEED, speed))}
        terms = {name: float(value) for name, value in module.latest.items()}
        self.files.row(about | terms | {f"held_out_{name}": value for name, value in scores.items()})
        words = " ".join(f"{name} {value:.4f}" for name, value in (scores or terms).items())
        LOG.info("step %d, %.0f s, %.2f samples/s: %s", module.step, self.seconds, rate, words)
        self._row_began, self._waited = now, 0.0
        self._row_samples, self._row_step = module.samples, module.step

    def _checkpoint(self, trainer: pl.Trainer, module: TrainingModule, must: bool) -> None:
        """Every process sends its random numbers, the first writes; a full disk ends the run only where it must."""
        states: list[Any] = [random_state()]
        if trainer.world_size > 1:
            states = [None] * trainer.world_size
            torch.distributed.all_gather_object(states, random_state())
        if trainer.is_global_zero:
            try:
                write_checkpoint(self.run / LAST, checkpoint_of(module, self.seconds, states))
            except OutputError as error:
                if must:
                    raise
                LOG.warning("step %d: %s; the run goes on", module.step, error)
                return
        module.guard.keep(module)
        self.checkpointed = module.step

    def _should_stop(self, trainer: pl.Trainer) -> bool:
        """The same answer in every process."""
        reasons = [self._heard, time.monotonic() >= self.deadline]
        if trainer.world_size > 1:
            asked = torch.tensor(reasons, dtype=torch.int32, device=trainer.strategy.root_device)
            torch.distributed.all_reduce(asked, torch.distributed.ReduceOp.MAX)
            reasons = [int(each) for each in asked]
        if any(reasons):
            self.ended = signal.Signals(reasons[0]).name if reasons[0] else TIME_IS_UP
        return any(reasons)

    def _hear(self, number: int, frame: Any) -> None:
        self._heard = number
        signal.signal(signal.SIGINT, signal.default_int_handler)  # who presses twice means it

    def _give_back(self) -> None:
        for number, handler in self._old_handlers.items():
            signal.signal(number, handler)
        self._old_handlers = {}


def peak_memory(device: torch.device) -> int:
    """Bytes, since the process began."""
    if device.type == "cuda":
        return torch.cuda.max_memory_allocated(device)
    try:
        import resource
    except ImportError:  # Windows has no such count
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


@torch.no_grad()
def outputs_of(network: torch.nn.Module, batch: Batch, settings: TrainSettings, device: torch.device) -> torch.Tensor:
    """The network's outputs on the CPU, made in batches as large as the run's."""
    parts = [network(part.to(device)).float().cpu() for part in batch["input"].split(settings.loop.batch)]
    return torch.cat(parts)


def scores_of(
    network: torch.nn.Module, batch: Batch, settings: TrainSettings, device: torch.device
) -> dict[str, float]:
    """`hole_metrics` of a network in eval mode."""
    return hole_metrics(outputs_of(network, batch, settings, device), batch, settings.network)


def _term_names(settings: TrainSettings) -> list[str]:
    """Columns of the loss terms that this run has."""
    loss, depth = settings.loss, settings.network.has_depth
    names = ["l1_known", "l1_hole", "perceptual", "adversarial", "feature_matching"]
    names += ["depth_l1", "depth_gradient", "depth_normal", "depth_law"] if depth else []
    used = [name for name in names if getattr(loss, name)]
    judge = ["discriminator", *(["gradient_penalty"] if loss.gradient_penalty else []), "discriminator_norm"]
    return [*used, "gradient_norm", *(judge if loss.judged else [])]
