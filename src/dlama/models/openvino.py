"""An ONNX file in -> a session with the few methods of onnxruntime's that a network file calls, run by OpenVINO, out.

On x86 processors it runs a LaMa faster than ONNX Runtime; it refuses the MI-GAN
pipeline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dlama.errors import MissingExtraError
from dlama.models.contracts import CONTRACT_KEY

TYPES = {"float32": "tensor(float)", "uint8": "tensor(uint8)"}


class TensorInfo(NamedTuple):
    """An input or an output, as onnxruntime describes it."""

    name: str
    type: str
    shape: list[int | None]


@dataclass(frozen=True)
class ModelMetadata:
    """The file's metadata."""

    custom_metadata_map: dict[str, str] = field(default_factory=dict)


class OpenVinoSession:
    """A network compiled once for every size; full float32."""

    def __init__(self, path: Path, threads: int) -> None:
        try:
            import openvino
        except ImportError as error:
            raise MissingExtraError("running a network by OpenVINO", "openvino", "openvino") from error
        core = openvino.Core()
        self._model = core.read_model(str(path))
        settings = {
            "INFERENCE_NUM_THREADS": threads,
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": "f32",
        }
        self._request = core.compile_model(self._model, "CPU", settings).create_infer_request()

    def get_providers(self) -> list[str]:
        """One: itself."""
        return ["openvino"]

    def get_inputs(self) -> list[TensorInfo]:
        """Name, type and shape; None where any size goes."""
        return [_tensor_info(port) for port in self._model.inputs]

    def get_outputs(self) -> list[TensorInfo]:
        """As `get_inputs`."""
        return [_tensor_info(port) for port in self._model.outputs]

    def get_modelmeta(self) -> ModelMetadata:
        """The file's contract, where it has one."""
        key = ["framework", CONTRACT_KEY]
        if not self._model.has_rt_info(key):
            return ModelMetadata()
        return ModelMetadata({CONTRACT_KEY: self._model.get_rt_info(key).astype(str)})

    def run(self, names: None, feed: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        """All outputs, copied: the next run writes into the same memory."""
        results = self._request.infer(dict(feed))
        return [np.array(results[port]) for port in range(len(self._model.outputs))]


def _tensor_info(port: Any) -> TensorInfo:
    kind = port.element_type.to_dtype().name
    shape = [size.get_length() if size.is_static else None for size in port.partial_shape]
    return TensorInfo(port.any_name, TYPES.get(kind, kind), shape)
