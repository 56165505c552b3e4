"""A trained generator and the record of its run in -> NAME.safetensors, NAME.onnx with its contract, and the model card, out.

The safetensors file has LaMa's published tensor names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama import __version__
from dlama.inpainters.networks.contract import DEPTH_PLANE, generator_metadata
from dlama.nets.checkpoints import read_generator
from dlama.nets.export.generator import export_onnx
from dlama.nets.generator import Generator
from dlama.nets.safetensors_file import write_safetensors
from dlama.training.settings import TrainSettings


def export(generator: Generator, folder: Path, name: str, licence: str) -> tuple[Path, Path]:
    """Write both files; returns the paths of NAME.safetensors and NAME.onnx, which is made of the former. OutputError."""
    weights, network = folder / f"{name}.safetensors", folder / f"{name}.onnx"
    state = {key: np.array(tensor.detach().cpu().numpy()) for key, tensor in generator.state_dict().items()}
    write_safetensors(weights, state, {"activation": generator.settings.activation, "licence": licence})
    written = read_generator(weights)
    return weights, export_onnx(written, network, generator_metadata(written.settings, weights, licence))


@dataclass(frozen=True)
class TrainingRecord:
    """Facts of a finished run, for its model card."""

    step: int
    samples: int
    seconds: float
    ended: str
    """Why it stopped."""
    trunk: str
    """A sentence about the perceptual trunk."""
    data: str
    """What the samples were made of."""
    device: str
    restored: int
    """How often the run went back to an earlier state because a gradient was not finite."""


def model_card(
    settings: TrainSettings, record: TrainingRecord, scores: Mapping[str, float], reference: Mapping[str, float]
) -> str:
    """README.md of a run directory, as Markdown.

    Args:
        scores: of the moving average on the held-out samples, see `validation.hole_metrics`.
        reference: the same metrics of OpenCV's Telea.
    """
    return "\n".join([*_files(settings), *_training(settings, record), *_scores(settings, scores, reference), ""])


def _files(settings: TrainSettings) -> list[str]:
    """What the network does, its files and their licence."""
    file = f"{settings.name}.onnx"
    return [
        f"# {settings.name}",
        "",
        f"Fills {settings.network.kind.description}. {settings.network.parameters / 1e6:.2f} M parameters.",
        "",
        "| file | what |",
        "|---|---|",
        f"| {file} | the network with its contract, for `--model {file}` |",
        f"| {settings.name}.safetensors | the same weights under LaMa's published names |",
        "",
        f"Licence of the weights: {settings.licence}.",
        "",
    ]


def _training(settings: TrainSettings, record: TrainingRecord) -> list[str]:
    """How it was trained."""
    return [
        "## Training",
        "",
        f"* {record.step} steps, {record.samples} samples of {settings.data.size} x {settings.data.size} pixels, "
        f"{record.seconds / 60:.1f} minutes on {record.device}; ended: {record.ended}.",
        f"* Samples: {record.data}; mixture {dict(settings.data.mixture)}.",
        f"* {record.trunk[0].upper()}{record.trunk[1:]}.",
        f"* Started from {settings.network.start or 'random weights'}; exported is the moving average of the weights.",
        f"* Went back to an earlier state {record.restored} times because a gradient was no number.",
        f"* dlama {__version__}; all settings are in settings.json, the learning curve is in metrics.csv.",
        "",
    ]


def _scores(settings: TrainSettings, scores: Mapping[str, float], reference: Mapping[str, float]) -> list[str]:
    """The table of metrics, and on which scales they are."""
    depth = f"; depth is {DEPTH_PLANE}" if settings.network.has_depth else ""
    return [
        f"## On {settings.data.held_out} held-out samples",
        "",
        f"Measured in the hole, composited; colour is 0..1{depth}.",
        "",
        f"| | {settings.name} | Telea |",
        "|---|---|---|",
        *(f"| {name} | {value:.4f} | {reference[name]:.4f} |" for name, value in scores.items()),
    ]
