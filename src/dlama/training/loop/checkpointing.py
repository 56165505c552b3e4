"""A training module in -> one checkpoint file, written whole or not at all, out; and back.

The file is torch's, read with `weights_only=True`. Its `state_dict` has the published names under `generator.`, so every
reader of LaMa checkpoints finds the network in it; `average.` is the one that is exported, and that dlama reads.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import torch

from dlama.errors import FileError, InputError, OutputError, any_error, first_line
from dlama.training.loop.module import TrainingModule
from dlama.training.loop.run_files import LAST
from dlama.training.presets import to_json
from dlama.writing.atomic_write import new_file

VERSION = 1


def checkpoint_of(module: TrainingModule, seconds: float, random_states: list[dict[str, Any]]) -> dict[str, Any]:
    """Everything that a run is resumed from.

    Args:
        module: after a whole step.
        seconds: trained so far, over all parts of the run.
        random_states: of every process, by rank (`random_state`).
    """
    named = {
        f"{name}.{key}": value
        for name, network in module.networks.items()
        for key, value in network.state_dict().items()
    }
    return {
        "version": VERSION,
        "settings": to_json(module.settings),
        "step": module.step,
        "samples": module.samples,
        "restored": module.restored,
        "seconds": seconds,
        "state_dict": named,
        "optimizer_states": [optimiser.state_dict() for optimiser in module.raw_optimisers],
        "random_states": random_states,
    }


def write_checkpoint(path: Path, checkpoint: dict[str, Any]) -> None:
    """Write next to `path`, flush to the disk, and rename: a crash or a full disk leaves the old file whole. OutputError."""
    try:
        with new_file(path) as draft, draft.open("wb") as stream:
            torch.save(checkpoint, stream)
    except (OSError, RuntimeError) as error:  # torch's writer turns a full disk into a RuntimeError
        reason = first_line(error).removeprefix(f"{path}: cannot be written: ")
        raise OutputError(f"{path}: cannot be written ({reason}); what was there is whole") from error


def read_checkpoint(path: Path) -> dict[str, Any]:
    """What `checkpoint_of` made; no code of the file is run. FileError where it is no checkpoint of this version, or damaged."""
    if not path.exists():
        raise FileError(f"{path}: no such checkpoint, so there is nothing to resume")
    with any_error(FileError, f"{path}: cannot be read as a checkpoint"):
        with zipfile.ZipFile(path) as archive:  # torch does not compare the checksums that it wrote
            damaged = archive.testzip()
        if damaged:
            raise FileError(f"{path}: is damaged: the checksum of {damaged} is wrong")
        found = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(found, dict) or found.get("version") != VERSION:
        raise FileError(f"{path}: no checkpoint of dlama's training, version {VERSION}")
    return found


def restore(module: TrainingModule, checkpoint: dict[str, Any], processes: int) -> None:
    """Put a checkpoint into a new module: networks and counters now, optimisers once they are made; random numbers are not set.

    Raises:
        InputError: the run had another number of processes, so its samples would not be the same ones.
        FileError: the checkpoint is of another network, or a part of it is missing.
    """
    with any_error(FileError, f"{LAST}: does not fit the run's settings, or is damaged"):
        before = len(checkpoint["random_states"])
        for name, network in module.networks.items():
            prefix = f"{name}."
            state = {k.removeprefix(prefix): v for k, v in checkpoint["state_dict"].items() if k.startswith(prefix)}
            network.load_state_dict(state, strict=True)
        module.step, module.samples = checkpoint["step"], checkpoint["samples"]
        module.restored = checkpoint["restored"]
        module.saved_optimisers = checkpoint["optimizer_states"]
    if before != processes:
        raise InputError(
            f"the run has {before} processes (`loop.devices` times loop.nodes), not {processes}; keep them to resume"
        )


def random_state() -> dict[str, Any]:
    """State of torch's random numbers, which alone a step draws from."""
    return {
        "torch": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state() if torch.cuda.is_available() else None,
    }


def set_random_state(state: dict[str, Any]) -> None:
    """Restore such a state."""
    torch.set_rng_state(state["torch"].cpu())
    if state["cuda"] is not None and torch.cuda.is_available():
        torch.cuda.set_rng_state(state["cuda"].cpu())
