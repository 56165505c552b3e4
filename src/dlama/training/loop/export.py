"""A trained generator in -> NAME.safetensors under LaMa's published names, and NAME.onnx with its contract, out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.inpainters.networks.contract import generator_metadata
from dlama.nets.checkpoints import read_generator
from dlama.nets.export import export_onnx
from dlama.nets.generator import Generator
from dlama.nets.safetensors_file import write_safetensors


def export(generator: Generator, folder: Path, name: str, licence: str) -> tuple[Path, Path]:
    """Both files' paths; the ONNX file is made of the safetensors file, as a user would. OutputError."""
    weights, network = folder / f"{name}.safetensors", folder / f"{name}.onnx"
    state = {key: np.array(tensor.detach().cpu().numpy()) for key, tensor in generator.state_dict().items()}
    write_safetensors(weights, state, {"activation": generator.settings.activation, "licence": licence})
    written = read_generator(weights)
    return weights, export_onnx(written, network, generator_metadata(written.settings, weights, licence))
