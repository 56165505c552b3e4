"""Settings and a directory in -> a trained network in that directory out."""

from __future__ import annotations

import logging
import math
import multiprocessing
import time
import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from pytorch_lightning.utilities.rank_zero import rank_zero_only

from dlama import __version__
from dlama.errors import InputError, OutputError, system_errors
from dlama.training.data.batches import check_sample
from dlama.training.data.loader import NumberedSamples, batch_loader, batch_numbers, held_out_batch
from dlama.training.data.sources import SampleSource, source_for
from dlama.training.loop.callbacks import ALL_STEPS, TIME_IS_UP, RunCallback
from dlama.training.loop.checkpointing import read_checkpoint, restore
from dlama.training.loop.export import export, model_card
from dlama.training.loop.module import TrainingModule
from dlama.training.loop.run_files import (
    LAST,
    SETTINGS,
    holds_run,
    lock_run,
    log_to_file,
    prepare,
    read_data,
    write_data,
)
from dlama.training.loop.validation import hole_metrics, scores_of, telea
from dlama.training.presets import to_json
from dlama.training.settings import TrainSettings
from dlama.workers.memory import check_processes
from dlama.writing.atomic_write import write_file

LOG = logging.getLogger("dlama")
EXPECTED_WARNINGS = (
    ".*does not have many workers.*",
    ".*module\\(s\\) in eval mode.*",
    ".*GPU available but not used.*",
    ".*find_unused_parameters=True was specified.*",
    ".*`isinstance\\(treespec, LeafSpec\\)` is deprecated.*",
)
"""Warnings of Lightning and torch that are no news: the number of workers, for one, is a setting."""


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
    first: bool = True
    """Whether this is the first process of the run; the others write nothing."""


@system_errors(OutputError)
def train(
    settings: TrainSettings,
    run: Path,
    *,
    data: Sequence[Path] = (),
    max_minutes: float | None = None,
    resume: bool = False,
) -> TrainingResult:
    """Train a network; writes settings, metrics, sheets, checkpoints, and at the end the network and its model card into `run`.

    Args:
        settings: of a new run; of a resumed one they must be the same, see `run_files.MAY_CHANGE`.
        run: directory; made where it is missing, must not hold a run unless `resume`.
        data: folders of pictures or datasets that samples are made of; none: procedural worlds, or those that the run to resume
            began with.
        max_minutes: stop after so long, with a checkpoint and an export; default: no limit.
        resume: continue from `last.ckpt`; the numbers are those of a run that was never stopped.
    Raises:
        InputError, FileError, OutputError: before the first step, naming the setting or file.
        DlamaError: too many batches in a row gave no finite gradient.
    """
    began = time.monotonic()
    _refuse_worker()
    if max_minutes is not None and not max_minutes > 0:
        raise InputError(f"`max_minutes` is {max_minutes}; more than 0 is expected")
    first = getattr(rank_zero_only, "rank", 0) == 0
    deadline = math.inf if max_minutes is None else began + 60 * max_minutes
    with ExitStack() as stack:
        if first:
            check_devices(settings)
            prepare(run, settings, resume)
            stack.enter_context(lock_run(run))
            stack.enter_context(log_to_file(run))
        if resume and not data:
            data = read_data(run)
        source = source_for(settings, data, "train")
        check_sample(NumberedSamples(source, settings.loop.seed)[0], settings.network, settings.data.size)
        held_out = held_out_batch(source_for(settings, data, "held_out"), settings) if first else None
        module = TrainingModule(settings)
        if first:  # only now: what was refused above leaves no settings, by which a run would be known
            write_data(run, data)
            write_file(run / SETTINGS, to_json(settings))
        checkpoint = _checkpoint(run, resume)
        if checkpoint:
            restore(module, checkpoint, settings.loop.devices * settings.loop.nodes)
        before = checkpoint.get("seconds", 0.0)
        callback = RunCallback(settings, run, deadline, held_out, checkpoint.get("random_states"), before)
        _fit(module, callback, source, settings)
        ended = callback.stop.reason
        network = _finish(module, callback, settings, data) if first and ended in (ALL_STEPS, TIME_IS_UP) else None
    return TrainingResult(run, module.step, ended, network, first)


def _checkpoint(run: Path, resume: bool) -> dict[str, Any]:
    """What a run is resumed from; nothing where it begins anew."""
    if resume and holds_run(run):
        return read_checkpoint(run / LAST)
    if resume:
        LOG.info("the run was ended before its first checkpoint, so it begins anew")
    return {}


def check_devices(settings: TrainSettings) -> None:
    """InputError for more GPUs or, on a CPU, more processes than this computer can hold."""
    loop, gpus = settings.loop, torch.cuda.device_count() if torch.cuda.is_available() else 0
    if loop.accelerator == "cpu" or (loop.accelerator == "auto" and not gpus):
        check_processes(loop.devices, "loop.devices")
    elif loop.devices > gpus:
        raise InputError(
            f"`loop.devices` is {loop.devices}; this computer has {gpus} GPUs, so at most {gpus} is expected"
        )


def _refuse_worker() -> None:
    """InputError in a worker process: it imports the script that was started, and a bare `train()` there would train again."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(
            'train() is called while a script is imported: put the call under `if __name__ == "__main__":`'
        )


def trainer_of(settings: TrainSettings, callback: RunCallback) -> pl.Trainer:
    """Lightning's trainer for devices, processes and precision; checkpoints, logs and validation are the callback's."""
    loop = settings.loop
    several = loop.devices * loop.nodes > 1
    return pl.Trainer(
        accelerator=loop.accelerator,
        devices=loop.devices,
        num_nodes=loop.nodes,
        strategy="ddp_find_unused_parameters_true" if several else "auto",
        sync_batchnorm=several and loop.accelerator != "cpu" and torch.cuda.is_available(),
        deterministic="warn" if loop.exact else None,
        benchmark=not loop.exact and torch.cuda.is_available(),
        precision="bf16-mixed" if loop.precision == "bf16" else "32-true",
        max_epochs=1,
        callbacks=[callback],
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        use_distributed_sampler=False,
        num_sanity_val_steps=0,
    )


def _fit(module: TrainingModule, callback: RunCallback, source: SampleSource, settings: TrainSettings) -> None:
    """Train the steps that are left; none may be."""
    left = settings.loop.steps - module.step
    if left <= 0:
        LOG.info("all %d steps were done before", settings.loop.steps)
        return
    logging.getLogger("pytorch_lightning").setLevel(logging.WARNING)
    with warnings.catch_warnings():
        for text in EXPECTED_WARNINGS:
            warnings.filterwarnings("ignore", text)
        if torch.cuda.is_available():
            torch.set_float32_matmul_precision("highest" if settings.loop.exact else "high")
        trainer = trainer_of(settings, callback)
        numbers = batch_numbers(module.samples, left, settings.loop.batch, trainer.global_rank, trainer.world_size)
        trainer.fit(module, batch_loader(source, settings, numbers))


def _finish(module: TrainingModule, callback: RunCallback, settings: TrainSettings, data: Sequence[Path]) -> Path:
    """Export the network, and write its model card; the ONNX file."""
    network = export(module.average, callback.run, settings.name, settings.licence)[1]
    assert callback.held_out is not None
    device = callback.device
    average = module.average.to(device)  # Lightning has put everything back on the CPU
    scores = scores_of(average, callback.held_out, settings, device)
    reference = hole_metrics(telea(callback.held_out), callback.held_out, settings.network)
    trunk = module.perceptual.note if module.perceptual else "no perceptual term"
    on, size = torch.cuda.get_device_name(device) if device.type == "cuda" else "a CPU", settings.data.size
    training = (
        f"{module.step} steps, {module.samples} samples of {size} x {size} pixels, "
        f"{callback.stopwatch.seconds / 60:.1f} minutes on {on}; ended: {callback.stop.reason}",
        f"Samples: {', '.join(map(str, data)) or 'procedural'}; mixture {dict(settings.data.mixture)}",
        f"{trunk[0].upper()}{trunk[1:]}",
        f"Started from {settings.network.start or 'random weights'}; exported is the moving average of the weights",
        f"Went back to an earlier state {module.restored} times because a gradient was no number",
        f"dlama {__version__}; all settings are in settings.json, the learning curve is in metrics.csv",
    )
    write_file(callback.run / "README.md", model_card(settings, training, scores, reference))
    LOG.info("%s: %s after %d steps", network, callback.stop.reason, module.step)
    return network
