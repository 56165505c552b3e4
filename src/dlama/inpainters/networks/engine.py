"""A model file in -> a network that fills planes of any size out: ONNX Runtime, no torch.

Sessions are opened when first needed, on the first of CUDA, CoreML, DirectML and CPU that is installed, or on the one
that is asked for (OpenVINO only so); which one ran, the notes say.
"""

from __future__ import annotations

import functools
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import DlamaError, FileError, InputError, MissingExtraError
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.networks.contract import Contract, from_metadata
from dlama.inpainters.networks.openvino import OpenVinoSession
from dlama.inpainters.networks.tiling import Layout, fill_crops
from dlama.models.verify import sha256_of

PROVIDERS = {
    "cuda": "CUDAExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    "directml": "DmlExecutionProvider",
    "cpu": "CPUExecutionProvider",
}
"""ONNX Runtime's, in the order of preference."""
OPENVINO = "openvino"
"""Not a part of ONNX Runtime: its own package, used when asked for."""
PROVIDER_VARIABLE = "DLAMA_PROVIDER"
"""Environment variable that names the provider where the code does not."""
BUDGET = 640 * 640
"""Pixels of the largest crop that goes through a network at once: it bounds the memory."""


def cores() -> int:
    """Cores this process may use; OMP_NUM_THREADS says fewer, as it does to every other library."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True, eq=False)
class Engine:
    """One network file, ready to run. A missing file or an unknown provider is refused at once, the rest when it opens."""

    path: Path
    given: Contract | None = None
    """The contract by hand, for a file that has none; a file's own goes first."""
    provider: str | None = field(default_factory=lambda: os.environ.get(PROVIDER_VARIABLE) or None)
    """cuda, coreml, directml, openvino, cpu; None: the first of ONNX Runtime's that is installed. Default: DLAMA_PROVIDER."""
    threads: int = field(default_factory=cores)
    budget: int = BUDGET
    memory_pattern: bool = True
    """Whether ONNX Runtime plans the memory of a whole run at once: faster (LaMa 20 %, MI-GAN 10 %), and more memory."""

    def __post_init__(self) -> None:
        if not self.path.is_file():
            raise FileError(f"{self.path}: no such model file")
        if self.provider is not None and self.provider not in (*PROVIDERS, OPENVINO):
            raise InputError(f"provider is {self.provider!r}; one of {', '.join([*PROVIDERS, OPENVINO])} is wanted")
        if self.threads < 1:
            raise InputError(f"threads is {self.threads}; 1 or more is wanted")

    @cached_property
    def session(self) -> Any:
        """The onnxruntime (or OpenVINO) session. FileError where the file is no ONNX network."""
        try:
            return (
                OpenVinoSession(self.path, self.threads) if self.provider == OPENVINO else self._onnxruntime_session()
            )
        except DlamaError:
            raise
        except Exception as error:  # their errors share no base class of their own
            raise FileError(
                f"{self.path}: cannot be opened as an ONNX network ({str(error).splitlines()[0]}); "
                "`dlama models convert FILE -o FILE.onnx` makes one of a checkpoint"
            ) from error

    def _onnxruntime_session(self) -> Any:
        ort = _onnxruntime()
        options = ort.SessionOptions()
        options.intra_op_num_threads = self.threads
        options.log_severity_level = 3
        options.enable_mem_pattern = self.memory_pattern
        return ort.InferenceSession(str(self.path), options, providers=self._wanted(ort.get_available_providers()))

    def _wanted(self, installed: list[str]) -> list[str]:
        if self.provider is not None and PROVIDERS[self.provider] not in installed:
            raise InputError(
                f"provider {self.provider!r} is not in this onnxruntime; it has "
                f"{', '.join(name for name, full in PROVIDERS.items() if full in installed)}"
            )
        chosen = [PROVIDERS[self.provider]] if self.provider else [p for p in PROVIDERS.values() if p in installed][:1]
        return list(dict.fromkeys([*chosen, PROVIDERS["cpu"]]))

    @cached_property
    def sha256(self) -> str:
        """Of the file."""
        return sha256_of(self.path)

    @property
    def running_on(self) -> str:
        """The provider the session really got, by its short name."""
        first = self.session.get_providers()[0]
        return next((name for name, full in PROVIDERS.items() if full == first), first)

    @property
    def notes(self) -> dict[str, Any]:
        """For meta.json."""
        return {
            "model": self.path.name,
            "model_sha256": self.sha256,
            "provider": self.running_on,
            "threads": self.threads,
        }

    @property
    def inputs(self) -> dict[str, tuple[str, list[Any]]]:
        """Name -> (type, shape) of the graph's inputs."""
        return {one.name: (one.type, list(one.shape)) for one in self.session.get_inputs()}

    @cached_property
    def contract(self) -> Contract:
        """The file's contract, or the given one; checked against the graph. InputError and FileError."""
        found = from_metadata(self.session.get_modelmeta().custom_metadata_map, str(self.path)) or self.given
        if found is None:
            raise InputError(
                f"{self.path}: carries no contract (metadata key dlama.contract); `dlama models convert` writes files "
                "that do, and a contract can be given by hand"
            )
        ends = list(self.inputs.values())
        if len(ends) != 1 or ends[0][0] != "tensor(float)" or len(ends[0][1]) != 4:
            raise FileError(f"{self.path}: inputs are {self.inputs}; one float tensor B x C x H x W is wanted")
        for names, shape in ((found.in_planes, ends[0][1]), (found.out_planes, self.session.get_outputs()[0].shape)):
            if len(shape) == 4 and isinstance(shape[1], int) and shape[1] != len(names):
                raise FileError(f"{self.path}: the graph has {shape[1]} planes where its contract has {list(names)}")
        return found

    def fill(self, planes: Float32Array, hole: BoolArray) -> Float32Array:
        """B x C x H x W planes in 0..1 with the hole (H x W) filled; what was known comes back bit for bit."""
        return fill_crops(np.asarray(planes, np.float32), hole, self.run_planes, self.layout)

    @property
    def layout(self) -> Layout:
        """How pictures are cut for this network."""
        side = self.contract.side
        least = Layout.call_cost if side is None else side * side
        return Layout(self.contract.multiple, self.contract.minimum, self.budget, least, side)

    def run_planes(self, planes: Float32Array, hole: BoolArray) -> Float32Array:
        """The network itself on planes in 0..1, of a size it takes; the hole (H x W, or one for each of its masks: masks x H x W)
        is zeroed, the masks stacked last."""
        about = self.contract
        stacked = about.network_input(planes, hole.reshape(-1, *hole.shape[-2:]))
        out = self.run({next(iter(self.inputs)): stacked})
        if out.shape != planes.shape:
            raise FileError(f"{self.path}: gave {out.shape} for {stacked.shape}; {planes.shape} is wanted")
        if not np.isfinite(out).all():
            raise FileError(f"{self.path}: the network gave values that are not finite")
        return about.unit_output(out)

    def run(self, feed: dict[str, np.ndarray]) -> np.ndarray:
        """The first output for these inputs; FileError with the file's name where the runtime refuses them."""
        try:
            return np.asarray(self.session.run(None, feed)[0])
        except Exception as error:
            sizes = {name: array.shape for name, array in feed.items()}
            raise FileError(f"{self.path}: failed on {sizes} ({str(error).splitlines()[0]})") from error


@functools.lru_cache(maxsize=1)
def _cached_engine(
    path: Path,
    stamp: tuple[int, int],
    contract: Contract | None,
    provider: str | None,
    threads: int,
    budget: int,
    memory_pattern: bool,
) -> Engine:
    """The engine of a file as it was at `stamp` (time of change in ns, bytes)."""
    return Engine(path, contract, provider, threads, budget, memory_pattern)


def open_engine(
    model: str | Path | Engine,
    contract: Contract | None = None,
    *,
    provider: str | None = None,
    threads: int | None = None,
    budget: int = BUDGET,
    memory_pattern: bool = True,
) -> Engine:
    """The engine of a file, parameters as Engine's; the last one is kept open, so that frame after frame costs one opening.

    An engine comes back as it is: so every filler of a network takes a file or an engine with settings of its own. FileError
    where there is no such file, InputError as Engine.
    """
    if isinstance(model, Engine):
        return model
    path = Path(model).expanduser()
    if not path.is_file():
        raise FileError(f"{path}: no such model file")
    stat = path.stat()
    provider = provider or os.environ.get(PROVIDER_VARIABLE) or None
    stamp = stat.st_mtime_ns, stat.st_size
    return _cached_engine(
        path, stamp, contract, provider, cores() if threads is None else threads, budget, memory_pattern
    )


def _onnxruntime() -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise MissingExtraError("running a network", "onnxruntime", "onnx") from error
    return onnxruntime
