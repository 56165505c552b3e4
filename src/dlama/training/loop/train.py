"""Settings and a directory in -> a trained network in that directory, out: the whole training on one screen."""

from __future__ import annotations

import logging
import math
import multiprocessing
import time
import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from pytorch_lightning.utilities.rank_zero import rank_zero_only

from dlama.errors import InputError
from dlama.files.atomic_write import new_file
from dlama.training.data.batches import check_sample
from dlama.training.data.loader import Numbered, Positions, held_out_batch, loader
from dlama.training.data.sources import SampleSource, source_for
from dlama.training.loop.callbacks import ALL_STEPS, TIME_IS_UP, Rhythm, scores_of
from dlama.training.loop.checkpointing import LAST, read_checkpoint, restore
from dlama.training.loop.export import export
from dlama.training.loop.model_card import Story, model_card
from dlama.training.loop.module import TrainingModule
from dlama.training.loop.run_files import keep_settings, logged, prepare
from dlama.training.loop.validation import hole_metrics, telea
from dlama.training.settings import TrainSettings

LOG = logging.getLogger("dlama")
EXPECTED_WARNINGS = (
    ".*does not have many workers.*",
    ".*module\\(s\\) in eval mode.*",
    ".*GPU available but not used.*",
    ".*find_unused_parameters=True was specified.*",
    ".*`isinstance\\(treespec, LeafSpec\\)` is deprecated.*",
)
"""Of Lightning and torch, about things that are meant: how many workers there are is a setting of ours."""


@dataclass(frozen=True)
class Trained:
    """What a run came to."""

    run: Path
    step: int
    ended: str
    """`all steps done`, `time is up`, `SIGTERM` or `SIGINT`."""
    network: Path | None
    """The ONNX file; None after a signal, which leaves time for a checkpoint only."""
    first: bool = True
    """False in all processes of a run but the first, which write nothing."""


def train(
    settings: TrainSettings,
    run: Path,
    *,
    data: Sequence[Path] = (),
    max_minutes: float | None = None,
    resume: bool = False,
    source: SampleSource | None = None,
    held_out: SampleSource | None = None,
) -> Trained:
    """Train, and write settings, metrics, sheets, checkpoints, and at the end the network and its card, into `run`.

    Args:
        settings: of a new run; of a resumed one they must be the same, see `run_files.MAY_CHANGE`.
        run: directory; made if need be, and must not hold a run unless `resume`.
        data: folders or packs that samples are made of; none: procedural ones.
        max_minutes: stop after so long, with a checkpoint and an export; default: never.
        resume: go on from `last.ckpt`, bit-exact.
        source: samples from elsewhere than `data`; with `held_out`, which then takes its place too.
    Raises:
        InputError, FileError, OutputError: before the first step, naming the setting or file.
        DlamaError: too many batches in a row gave no finite gradient.
    """
    began = time.monotonic()
    _refuse_import()
    first = getattr(rank_zero_only, "rank", 0) == 0
    if first:
        prepare(run, settings, resume)
    deadline = math.inf if max_minutes is None else began + 60 * max_minutes
    with logged(run) if first else nullcontext():
        return _train(settings, run, data, deadline, resume, first, source, held_out)


def _train(
    settings: TrainSettings,
    run: Path,
    data: Sequence[Path],
    deadline: float,
    resume: bool,
    first: bool,
    source: SampleSource | None,
    held_out: SampleSource | None,
) -> Trained:
    """As `train`, in a directory that is there; `deadline` on the clock of `time.monotonic`."""
    source = source or source_for(settings, data, "train")
    check_sample(Numbered(source, settings.loop.seed)[0], settings.network, settings.data.size)
    fixed = held_out_batch(held_out or source_for(settings, data, "held_out"), settings) if first else None
    module, processes = TrainingModule(settings), settings.loop.devices * settings.loop.nodes
    if first:
        keep_settings(run, settings)  # only now: what was refused above leaves no run that the next attempt would meet
    checkpoint: dict[str, Any] = read_checkpoint(run / LAST) if resume else {}
    if checkpoint:
        restore(module, checkpoint, processes)
    before = checkpoint.get("seconds", 0.0)
    rhythm = Rhythm(settings, run, deadline, fixed, checkpoint.get("random_states"), before)
    try:
        _fit(module, rhythm, source, settings)
        if not first:
            return Trained(run, module.step, rhythm.ended, None, first=False)
        about = "procedural" if not data else ", ".join(str(path) for path in data)
        network = None if rhythm.ended not in (ALL_STEPS, TIME_IS_UP) else _finish(module, rhythm, settings, about)
    finally:
        rhythm.close()
    return Trained(run, module.step, rhythm.ended, network)


def _refuse_import() -> None:
    """A worker that makes samples imports the script that was started: a bare call of `train` there would train again."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(
            'train() is called while a script is imported: put the call under `if __name__ == "__main__":`'
        )


def trainer_of(settings: TrainSettings, rhythm: Rhythm) -> pl.Trainer:
    """Lightning's part: devices, processes and precision. Checkpoints, logs and validation are our own."""
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
        callbacks=[rhythm],
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        use_distributed_sampler=False,
        num_sanity_val_steps=0,
    )


def _fit(module: TrainingModule, rhythm: Rhythm, source: SampleSource, settings: TrainSettings) -> None:
    """The steps that are left; none is fine."""
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
        trainer = trainer_of(settings, rhythm)
        at = Positions(module.samples, left, settings.loop.batch, trainer.global_rank, trainer.world_size)
        trainer.fit(module, loader(source, settings, at))


def _finish(module: TrainingModule, rhythm: Rhythm, settings: TrainSettings, data: str) -> Path:
    """The exported network and its card."""
    network = export(module.average, rhythm.run, settings.name, settings.licence)[1]  # type: ignore[arg-type]
    assert rhythm.held_out is not None
    average = module.average.to(rhythm.device)  # Lightning has put everything back on the CPU
    scores = scores_of(average, rhythm.held_out, settings, rhythm.device)
    reference = hole_metrics(telea(rhythm.held_out), rhythm.held_out, settings.network)
    trunk = module.perceptual.note if module.perceptual else "no perceptual term"
    story = Story(
        step=module.step,
        samples=module.samples,
        seconds=rhythm.seconds,
        ended=rhythm.ended,
        trunk=trunk,
        data=data,
        device=device_name(rhythm.device),
        restored=module.restored,
    )
    with new_file(rhythm.run / "README.md") as draft:
        draft.write_text(model_card(settings, story, scores, reference), "utf-8")
    LOG.info("%s: %s after %d steps", network, rhythm.ended, module.step)
    return network


def device_name(device: torch.device) -> str:
    """For the card."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else "a CPU"
