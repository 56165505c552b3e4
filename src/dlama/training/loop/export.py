"""A trained generator and sentences about its run in -> NAME.safetensors, NAME.onnx with its contract, and the model card, out.

The safetensors file has LaMa's published tensor names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

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


def model_card(
    settings: TrainSettings, training: Sequence[str], scores: Mapping[str, float], reference: Mapping[str, float]
) -> str:
    """README.md of a run directory, as Markdown.

    Args:
        training: sentences about the run.
        scores: of the moving average on the held-out samples, see `validation.hole_metrics`.
        reference: the same metrics of OpenCV's Telea.
    """
    kind = settings.network.kind
    filler = "pair" if kind.views == 2 else "joint" if kind.has_depth else "lama"
    name, depth = settings.name, f"; depth is {DEPTH_PLANE}" if kind.has_depth else ""
    lines = [
        f"# {name}",
        "",
        f"Fills {kind.description}. {settings.network.parameters / 1e6:.2f} M parameters.",
        "",
        "| file | what |",
        "|---|---|",
        f"| {name}.onnx | the network with its contract, for `--filler {filler} --model {name}.onnx` |",
        f"| {name}.safetensors | the same weights under LaMa's published names |",
        "",
        f"Licence of the weights: {settings.licence}.",
        "",
        "## Training",
        "",
        *(f"* {sentence}." for sentence in training),
        "",
        f"## On {settings.data.held_out} held-out samples",
        "",
        f"Measured in the hole, composited; colour is 0..1{depth}.",
        "",
        f"| | {name} | Telea |",
        "|---|---|---|",
        *(f"| {metric} | {value:.4f} | {reference[metric]:.4f} |" for metric, value in scores.items()),
        "",
    ]
    return "\n".join(lines)
