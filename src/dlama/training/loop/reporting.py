"""A training after each step in -> rows of metrics, sample sheets, checkpoints, and the decision to stop, out."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from dlama.errors import OutputError
from dlama.training.data.batches import Batch
from dlama.training.loop.checkpointing import checkpoint_of, write_checkpoint
from dlama.training.loop.random_state import random_state, set_random_state
from dlama.training.loop.run_files import LAST, SHEETS, MetricsTable
from dlama.training.loop.step import Training, rate_factor
from dlama.training.loop.validation import metric_names, outputs_of, scores_of, write_sheet
from dlama.training.losses.terms import DISCRIMINATOR_TERMS, used_terms
from dlama.training.settings import TrainSettings
from dlama.workers.memory import peak_mib

LOG = logging.getLogger("dlama")
ALL_STEPS, TIME_IS_UP = "all steps done", "time is up"
"""Why a run ended; else it is the name of a signal."""
SPEED = ("learning_rate", "samples_per_second", "waiting", "memory_gb")
"""Columns of metrics.csv: the generator's learning rate; samples per second and share of time spent waiting for samples, both
since the row before; peak memory of the GPU (of the process, on a CPU)."""


class Stopwatch:
    """Time of a run, and speed since the last row of metrics. Clock: time.monotonic."""

    def __init__(self, seconds_before: float, samples: int) -> None:
        """The first batch is awaited; so many seconds and samples were trained before."""
        self.seconds_before = seconds_before
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
    """Why to stop: SIGTERM, SIGINT (Ctrl-C) or a deadline, on the clock of time.monotonic."""

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.reason = ALL_STEPS
        """After the run: why it ended."""
        self._signal = 0

    @contextmanager
    def listening(self) -> Iterator[None]:
        """While it is open SIGTERM and the first SIGINT are requests to stop after the step."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {each: signal.signal(each, self._handle) for each in (signal.SIGTERM, signal.SIGINT)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def is_requested(self) -> bool:
        """Whether the run was asked to stop."""
        if self._signal:
            self.reason = signal.Signals(self._signal).name
        elif time.monotonic() >= self.deadline:
            self.reason = TIME_IS_UP
        return self.reason != ALL_STEPS

    def _handle(self, number: int, frame: Any) -> None:
        self._signal = number
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a second Ctrl-C stops at once


class Reporter:
    """Writes what is due after each step. Counts by the training's own step, so that a resumed run writes at the same steps.

    Args:
        run: the run's directory.
        training: begins, or is resumed, now.
        held_out: the samples of validation.
        seconds: trained before.
    """

    def __init__(self, run: Path, training: Training, held_out: Batch, seconds: float) -> None:
        self.run, self.training, self.held_out = run, training, held_out
        self.settings = training.settings
        self.stopwatch = Stopwatch(seconds, training.samples)
        self.table = MetricsTable(run, columns(self.settings), training.step)
        self._checkpoint_step = self._row_step = -1
        LOG.info("%s", training.perceptual.note if training.perceptual else "no perceptual term")

    def after_step(self) -> None:
        """Validate, and write sheet, row and checkpoint, where they are due after this step."""
        loop, step = self.settings.loop, self.training.step
        kept = random_state()
        scores = self.scores() if step % loop.validate_every == 0 else {}
        if step % loop.sheet_every == 0:
            self._write_sheet()
        if scores or step % loop.log_every == 0:
            self._write_row(scores)
        if step % loop.checkpoint_every == 0:
            try:
                self._write_checkpoint()
            except OutputError as error:
                LOG.warning("step %d: %s; the run continues", step, error)
        set_random_state(kept)  # what is written must not change the steps after it

    def end(self, finished: bool) -> None:
        """The last row and sheet of a finished run (not after a signal), and the last checkpoint, which must succeed."""
        step = self.training.step
        if finished and self._row_step != step:
            self._write_row(self.scores())
        if finished and step % self.settings.loop.sheet_every:
            self._write_sheet()
        if self._checkpoint_step != step:
            self._write_checkpoint()

    def scores(self) -> dict[str, float]:
        """Of the moving average on the held-out samples."""
        return scores_of(self.training.average, self.held_out, self.settings, self.training.device)

    def _write_sheet(self) -> None:
        training = self.training
        output = outputs_of(training.average, self.held_out, self.settings, training.device)
        path = self.run / SHEETS / f"step-{training.step:07d}.png"
        try:
            write_sheet(path, output, self.held_out, self.settings.network)
        except OSError as error:
            LOG.warning("step %d: %s; the run continues", training.step, error)

    def _write_row(self, scores: dict[str, float]) -> None:
        training = self.training
        rate, waiting = self.stopwatch.row(training.samples)
        self._row_step = training.step
        learning_rate = self.settings.optimiser.generator_rate * rate_factor(self.settings, max(training.step - 1, 0))
        speed = learning_rate, rate, waiting, peak_memory(training.device) / 1e9
        seconds = self.stopwatch.seconds
        progress = {"step": training.step, "samples": training.samples, "seconds": seconds, **dict(zip(SPEED, speed))}
        terms = {name: float(value) for name, value in training.latest.items()}
        try:
            self.table.add(progress | terms | {f"held_out_{name}": value for name, value in scores.items()})
        except OSError as error:
            LOG.warning("step %d: %s; the run continues", training.step, error)
        shown = " ".join(f"{name} {value:.4f}" for name, value in (scores or terms).items())
        LOG.info("step %d, %.0f s, %.2f samples/s: %s", training.step, seconds, rate, shown)

    def _write_checkpoint(self) -> None:
        self.training.guard.keep(self.training)  # written or not: the state is a good one
        write_checkpoint(self.run / LAST, checkpoint_of(self.training, self.stopwatch.seconds))
        self._checkpoint_step = self.training.step


def columns(settings: TrainSettings) -> list[str]:
    """Columns of metrics.csv behind step, samples and seconds: speed, the terms that have a weight, norms, held-out metrics."""
    terms = [*used_terms(settings.loss, settings.network), "gradient_norm"]
    if settings.loss.uses_discriminator:
        penalty = settings.loss.gradient_penalty > 0
        terms += [
            *(name for name in DISCRIMINATOR_TERMS if penalty or name != "gradient_penalty"),
            "discriminator_norm",
        ]
    return [*SPEED, *terms, *(f"held_out_{name}" for name in metric_names(settings.network))]


def peak_memory(device: torch.device) -> float:
    """Bytes, since the process began; 0 where the system does not count them."""
    if device.type == "cuda":
        return torch.cuda.max_memory_allocated(device)
    return (peak_mib(since_reset=False) or 0.0) * 2**20
