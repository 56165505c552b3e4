"""Settings and a directory in -> a trained network in that directory out."""

from __future__ import annotations

import logging
import math
import multiprocessing
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from dlama.errors import InputError, OutputError, system_errors
from dlama.files.atomic_write import new_file
from dlama.training.data.batches import Batch, check_sample
from dlama.training.data.loader import BatchNumbers, NumberedSamples, batch_loader, held_out_batch
from dlama.training.data.sources import SampleSource, source_for
from dlama.training.loop.checkpointing import read_checkpoint, restore
from dlama.training.loop.export import TrainingRecord, export, model_card
from dlama.training.loop.random_state import set_random_state
from dlama.training.loop.reporting import ALL_STEPS, TIME_IS_UP, Reporter, StopRequest
from dlama.training.loop.run_files import LAST, holds_run, lock_run, log_to_file, prepare, write_settings
from dlama.training.loop.step import Training
from dlama.training.loop.validation import hole_metrics, telea
from dlama.training.settings import LoopSettings, TrainSettings

LOG = logging.getLogger("dlama")


@dataclass(frozen=True)
class TrainingResult:
    """How a run ended."""

    run: Path
    """Its directory."""
    step: int
    """Steps done."""
    ended: str
    """`all steps done`, `time is up`, `SIGTERM` or `SIGINT`."""
    network: Path | None
    """The ONNX file; None after a signal, which leaves time for a checkpoint only."""


@system_errors(OutputError)
def train(
    settings: TrainSettings,
    run: Path,
    *,
    data: Sequence[Path] = (),
    max_minutes: float | None = None,
    resume: bool = False,
    source: SampleSource | None = None,
    held_out: SampleSource | None = None,
) -> TrainingResult:
    """Train a network; writes settings, metrics, sheets, checkpoints, and at the end the network and its model card into `run`.

    Args:
        settings: of a new run; of a resumed one they must be the same, see `run_files.MAY_CHANGE`.
        run: directory; made where it is missing, must not hold a run unless `resume`.
        data: folders of pictures, datasets or packs that samples are made of; none: procedural worlds.
        max_minutes: stop after so long, with a checkpoint and an export; default: no limit.
        resume: continue from `last.ckpt`; the numbers are those of a run that was never stopped.
        source: samples to train on, in place of those of `data`.
        held_out: samples of validation, in place of those of `data`.
    Raises:
        InputError, FileError, OutputError: before the first step, naming the setting or file.
        DlamaError: too many batches in a row gave no finite gradient.
    """
    stop = StopRequest(math.inf if max_minutes is None else time.monotonic() + 60 * max_minutes)
    _refuse_worker()
    device = choose_device(settings.loop)
    prepare(run, settings, resume)
    with lock_run(run), log_to_file(run):
        source = source or source_for(settings, data, "train")
        check_sample(NumberedSamples(source, settings.loop.seed)[0], settings.network, settings.data.size)
        validation = held_out_batch(held_out or source_for(settings, data, "held_out"), settings)
        training = Training(settings, device)
        write_settings(run, settings)  # only now: what was refused leaves no settings, by which a run would be known
        before = _resume(training, run) if resume else 0.0
        reporter = Reporter(run, training, validation, before)
        with stop.listening():
            _fit(training, reporter, stop, source)
            finished = stop.reason in (ALL_STEPS, TIME_IS_UP)
            reporter.end(finished)
        about = ", ".join(map(str, data)) or "procedural"
        network = _finish(reporter, stop.reason, about) if finished else None
    return TrainingResult(run, training.step, stop.reason, network)


def _refuse_worker() -> None:
    """InputError in a worker process: it imports the script that was started, and a bare `train()` there would train again."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(
            'train() is called while a script is imported: put the call under `if __name__ == "__main__":`'
        )


def choose_device(loop: LoopSettings) -> torch.device:
    """The GPU or the CPU, as the settings say; sets how exactly a GPU computes. InputError: there is no GPU."""
    if not torch.cuda.is_available():
        if loop.accelerator == "gpu":
            raise InputError("`loop.accelerator` is 'gpu'; torch finds no GPU on this computer")
        return torch.device("cpu")
    if loop.accelerator == "cpu":
        return torch.device("cpu")
    torch.set_float32_matmul_precision("highest" if loop.exact else "high")
    torch.backends.cudnn.benchmark = not loop.exact
    torch.use_deterministic_algorithms(loop.exact, warn_only=True)
    return torch.device("cuda")


def _resume(training: Training, run: Path) -> float:
    """Put the run's checkpoint into a new training; seconds trained before."""
    if not holds_run(run):
        LOG.info("the run was ended before its first checkpoint, so it begins anew")
        return 0.0
    checkpoint = read_checkpoint(run / LAST)
    restore(training, checkpoint)
    set_random_state(checkpoint["random_state"])
    return float(checkpoint["seconds"])


def _fit(training: Training, reporter: Reporter, stop: StopRequest, source: SampleSource) -> None:
    """Train the steps that are left; none may be."""
    settings, clock = training.settings, reporter.stopwatch
    left = settings.loop.steps - training.step
    if left <= 0:
        LOG.info("all %d steps were done before", settings.loop.steps)
        return
    batches = batch_loader(source, settings, BatchNumbers(training.samples, left, settings.loop.batch))
    for batch in batches:
        clock.end_wait()
        training.train_step(to_device(batch, training.device))
        reporter.after_step()
        if stop.is_requested():
            break
        clock.begin_wait()


def to_device(batch: Batch, device: torch.device) -> Batch:
    """The batch on a device."""
    return {name: tensor.to(device, non_blocking=True) for name, tensor in batch.items()}  # type: ignore[return-value,attr-defined]


def _finish(reporter: Reporter, ended: str, data: str) -> Path:
    """Export the network, and write its model card; the ONNX file."""
    training, settings = reporter.training, reporter.settings
    scores = reporter.scores()
    reference = hole_metrics(telea(reporter.held_out), reporter.held_out, settings.network)
    record = TrainingRecord(
        step=training.step,
        samples=training.samples,
        seconds=reporter.stopwatch.seconds,
        ended=ended,
        trunk=training.perceptual.note if training.perceptual else "no perceptual term",
        data=data,
        device=device_name(training.device),
        restored=training.restored,
    )
    network = export(training.average, reporter.run, settings.name, settings.licence)[1]  # type: ignore[arg-type]
    with new_file(reporter.run / "README.md") as draft:
        draft.write_text(model_card(settings, record, scores, reference), "utf-8")
    LOG.info("%s: %s after %d steps", network, ended, training.step)
    return network


def device_name(device: torch.device) -> str:
    """For the model card."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else "a CPU"
