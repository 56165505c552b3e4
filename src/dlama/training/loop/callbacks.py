"""A training module after each step in -> rows of metrics, sample sheets, checkpoints, and the decision to stop, out."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch

from dlama.errors import DlamaError, OutputError
from dlama.training.data.batches import Batch
from dlama.training.loop.checkpointing import checkpoint_of, random_state, set_random_state, write_checkpoint
from dlama.training.loop.module import TrainingModule, rate_factor
from dlama.training.loop.run_files import LAST, SHEETS, MetricsTable
from dlama.training.loop.validation import metric_names, outputs_of, scores_of, write_sheet
from dlama.training.losses.terms import used_terms
from dlama.training.settings import TrainSettings
from dlama.workers.memory import peak_mib

LOG = logging.getLogger("dlama")
ALL_STEPS, TIME_IS_UP = "all steps done", "time is up"
"""Why a run ended; else it is the name of a signal."""
SPEED = ("learning_rate", "samples_per_second", "waiting", "memory_gb")
"""Columns of metrics.csv: the generator's learning rate; samples of all devices per second and share of time spent waiting for
samples, both since the row before; peak memory of the first device (of the process, on a CPU)."""


class Stopwatch:
    """Time of a run, and speed since the last row of metrics. Clock: time.monotonic."""

    def __init__(self, seconds_before: float) -> None:
        self.seconds_before = seconds_before
        self.start(0)

    def start(self, samples: int) -> None:
        """The first batch is awaited; so many samples were trained on before."""
        self._started = self._row_began = self._batch_ended = time.monotonic()
        self._waited, self._row_samples = 0.0, samples

    @property
    def seconds(self) -> float:
        """Seconds trained so far, over all parts of the run."""
        return self.seconds_before + time.monotonic() - self._started

    def end_wait(self) -> None:
        """The wait for a batch is over."""
        self._waited += time.monotonic() - self._batch_ended

    def begin_wait(self) -> None:
        """The wait for the next batch begins."""
        self._batch_ended = time.monotonic()

    def row(self, samples: int) -> tuple[float, float]:
        """Samples per second and share of time spent waiting since the row before; the next row begins."""
        now = time.monotonic()
        took = max(now - self._row_began, 1e-9)
        speed = (samples - self._row_samples) / took, self._waited / took
        self._row_began, self._waited, self._row_samples = now, 0.0, samples
        return speed


class StopRequest:
    """Why to stop: SIGTERM, SIGINT (Ctrl-C) or a deadline, the same in all processes.

    deadline: on the clock of time.monotonic.
    """

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.reason = ALL_STEPS
        """After the run: why it ended."""
        self._signal = 0
        self._old_handlers: dict[int, Any] = {}

    def listen(self) -> None:
        """From now on SIGTERM and the first SIGINT are requests to stop after the step."""
        if threading.current_thread() is threading.main_thread():
            self._old_handlers = {each: signal.signal(each, self._handle) for each in (signal.SIGTERM, signal.SIGINT)}

    def stop_listening(self) -> None:
        """Signals do again what they did before `listen`."""
        for number, handler in self._old_handlers.items():
            signal.signal(number, handler)
        self._old_handlers = {}

    def is_requested(self, trainer: pl.Trainer) -> bool:
        """Whether any process was asked to stop."""
        own = [self._signal, int(time.monotonic() >= self.deadline)]
        everyone = torch.tensor(own, dtype=torch.int32, device=trainer.strategy.root_device)
        number, late = trainer.strategy.reduce(everyone, reduce_op="max").tolist()
        if number or late:
            self.reason = signal.Signals(number).name if number else TIME_IS_UP
        return bool(number or late)

    def _handle(self, number: int, frame: Any) -> None:
        self._signal = number
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a second Ctrl-C stops at once


class RunCallback(pl.Callback):
    """Writes what is due after each step. Counts by the module's own step, so that a resumed run writes at the same steps.

    Args:
        run: the run's directory.
        deadline: when to stop, on the clock of `time.monotonic`.
        held_out: the samples of validation; None in all processes but the first.
        random_states: those that a resumed run begins with, by rank; None in a new run.
        seconds: trained before.
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
        self.settings, self.run, self.held_out, self.random_states = settings, run, held_out, random_states
        self.stopwatch, self.stop = Stopwatch(seconds), StopRequest(deadline)
        self.table: MetricsTable | None = None
        self.device = torch.device("cpu")
        self._checkpoint_step = self._row_step = -1

    def on_train_start(self, trainer: pl.Trainer, module: pl.LightningModule) -> None:
        """Begin the table, and listen for signals."""
        assert isinstance(module, TrainingModule)
        self.device = module.device

        def begin() -> None:
            LOG.info("%s", module.perceptual.note if module.perceptual else "no perceptual term")
            self.table = MetricsTable(self.run, columns(self.settings), module.step)

        failed = run_in_first(trainer, begin)
        if failed is not None:
            raise OutputError(failed)
        self.stop.listen()
        self.stopwatch.start(module.samples)

    def on_train_batch_start(self, trainer: pl.Trainer, module: pl.LightningModule, batch: Any, batch_idx: int) -> None:
        """The first batch of a resumed run gets the random numbers that it would have had."""
        self.stopwatch.end_wait()
        if self.random_states is not None:
            set_random_state(self.random_states[trainer.global_rank])
            self.random_states = None

    def on_train_batch_end(
        self, trainer: pl.Trainer, module: pl.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Validate, and write sheet, row and checkpoint, where they are due after this step; stop where that was asked for."""
        assert isinstance(module, TrainingModule)
        loop, step = self.settings.loop, module.step
        kept = random_state()
        scores = self._validate(module) if step % loop.validate_every == 0 else {}
        if step % loop.sheet_every == 0:
            self._write_sheet(module)
        if scores or step % loop.log_every == 0:
            self._write_row(module, scores)
        if step % loop.checkpoint_every == 0:
            self._write_checkpoint(trainer, module, required=False)
        if self.stop.is_requested(trainer):
            trainer.should_stop = True
        set_random_state(kept)  # what is written must not change the steps after it
        self.stopwatch.begin_wait()

    def on_train_end(self, trainer: pl.Trainer, module: pl.LightningModule) -> None:
        """The last row and sheet, unless a signal asked to stop, and the last checkpoint, which must succeed."""
        assert isinstance(module, TrainingModule)
        if self.stop.reason in (ALL_STEPS, TIME_IS_UP):
            if self._row_step != module.step:
                self._write_row(module, self._validate(module))
            if module.step % self.settings.loop.sheet_every:
                self._write_sheet(module)
        if self._checkpoint_step != module.step:
            self._write_checkpoint(trainer, module, required=True)
        self.stop.stop_listening()

    def on_exception(self, trainer: pl.Trainer, module: pl.LightningModule, exception: BaseException) -> None:
        """Nothing is saved: the last checkpoint is of a good state."""
        self.stop.stop_listening()

    def _validate(self, module: TrainingModule) -> dict[str, float]:
        return {} if self.held_out is None else scores_of(module.average, self.held_out, self.settings, module.device)

    def _write_sheet(self, module: TrainingModule) -> None:
        if self.held_out is None:
            return
        output = outputs_of(module.average, self.held_out, self.settings, module.device)
        path = self.run / SHEETS / f"step-{module.step:07d}.png"
        try:
            write_sheet(path, output, self.held_out, self.settings.network)
        except OSError as error:
            LOG.warning("step %d: %s; the run continues", module.step, error)

    def _write_row(self, module: TrainingModule, scores: dict[str, float]) -> None:
        if self.table is None:
            return
        rate, waiting = self.stopwatch.row(module.samples)
        self._row_step = module.step
        on_gpu = module.device.type == "cuda"
        memory = (
            torch.cuda.max_memory_allocated(module.device) if on_gpu else (peak_mib(since_reset=False) or 0.0) * 2**20
        )
        speed = (
            self.settings.optimiser.generator_rate * rate_factor(self.settings, max(module.step - 1, 0)),
            rate,
            waiting,
            memory / 1e9,
        )
        seconds = self.stopwatch.seconds
        progress = {"step": module.step, "samples": module.samples, "seconds": seconds, **dict(zip(SPEED, speed))}
        terms = {name: float(value) for name, value in module.latest.items()}
        row = progress | terms | {f"held_out_{name}": value for name, value in scores.items()}
        try:
            self.table.add(row)
        except OSError as error:
            LOG.warning("step %d: %s; the run continues", module.step, error)
        shown = " ".join(f"{name} {value:.4f}" for name, value in (scores or terms).items())
        LOG.info("step %d, %.0f s, %.2f samples/s: %s", module.step, seconds, rate, shown)

    def _write_checkpoint(self, trainer: pl.Trainer, module: TrainingModule, required: bool) -> None:
        """All processes send their random numbers, the first one writes. OutputError in all, and only if `required`."""
        states: list[Any] = [random_state()]
        if trainer.world_size > 1:
            states = [None] * trainer.world_size
            torch.distributed.all_gather_object(states, random_state())
        path, seconds = self.run / LAST, self.stopwatch.seconds
        failed = run_in_first(trainer, lambda: write_checkpoint(path, checkpoint_of(module, seconds, states)))
        if failed is not None and required:
            raise OutputError(failed)
        module.guard.keep(module)  # in all processes, written or not: what they return to must be the same
        if failed is not None:
            LOG.warning("step %d: %s; the run continues", module.step, failed)
            return
        self._checkpoint_step = module.step


def run_in_first(trainer: pl.Trainer, write: Callable[[], object]) -> str | None:
    """Write in the first process; what went wrong there, in all processes: they continue, or end, together. None: nothing."""
    failed: str | None = None
    if trainer.is_global_zero:
        try:
            write()
        except (OSError, DlamaError) as error:
            failed = str(error)
    return trainer.strategy.broadcast(failed)


def columns(settings: TrainSettings) -> list[str]:
    """Columns of metrics.csv behind step, samples and seconds: speed, the terms that have a weight, norms, held-out metrics."""
    terms = [*used_terms(settings.loss, settings.network), "gradient_norm"]
    if settings.loss.uses_discriminator:
        terms += ["discriminator", *["gradient_penalty"] * (settings.loss.gradient_penalty > 0), "discriminator_norm"]
    return [*SPEED, *terms, *(f"held_out_{name}" for name in metric_names(settings.network))]
