"""An ONNX file in -> the same file ready to run, by ONNX Runtime, out: arrays in, arrays out, no torch.

Sessions are opened when first needed, on the first of CUDA, CoreML, DirectML and CPU that is installed, or on the one
that is asked for; which one ran, the notes say. What the arrays mean is the caller's affair.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakSet

import numpy as np

from dlama.arguments import check_count, check_word
from dlama.errors import FileError, InputError, any_error, import_extra, system_errors
from dlama.models.verify import sha256_of
from dlama.writing.unchanged import while_unchanged

PROVIDERS = {
    "cuda": "CUDAExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    "directml": "DmlExecutionProvider",
    "cpu": "CPUExecutionProvider",
    "openvino": "OpenVINOExecutionProvider",
}
"""ONNX Runtime's, in the order of preference; what comes after cpu only where it is asked for."""
ASSETS = Path(__file__).parents[1] / "assets"
"""Folder of the networks that ship in the package."""
N = TypeVar("N", bound="NetworkFile")

LARGE = 3_000_000
"""Pixels of a picture that is filled from which on networks give back the memory that they keep between runs."""


def cores() -> int:
    """Cores that networks use: those of this process; OMP_NUM_THREADS says fewer, as it does to every other library."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return int(asked) if asked.isdecimal() and int(asked) > 0 else processor_count()


def processor_count() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def default_provider() -> str | None:
    """What DLAMA_PROVIDER names; None: the first of ONNX Runtime's that is installed."""
    return os.environ.get("DLAMA_PROVIDER") or None


@dataclass(frozen=True, eq=False)
class NetworkFile:
    """One network file, ready to run. A missing file or an unknown provider is refused at once, the rest when it opens."""

    path: Path
    provider: str | None = field(default_factory=default_provider)
    """cuda, coreml, directml, openvino, cpu; None: the first of ONNX Runtime's that is installed. Default: DLAMA_PROVIDER."""
    threads: int = field(default_factory=cores)
    memory_pattern: bool = True
    """Whether ONNX Runtime plans the memory of a whole run at once: faster (LaMa 20 %, MI-GAN 10 %), and more memory."""

    @system_errors(FileError)
    def __post_init__(self) -> None:
        _check_file(self.path)
        if self.provider is not None:
            check_word(self.provider, "provider", PROVIDERS)
        check_count(self.threads, "threads")

    @cached_property
    def session(self) -> Any:
        """The onnxruntime session. FileError where the file is no ONNX network."""
        _OPEN.add(self)
        mend = "`dlama models convert FILE -o FILE.onnx` makes one of a checkpoint"
        with any_error(FileError, f"{self.path}: cannot be opened as an ONNX network; {mend}"):
            session = self._onnxruntime_session()
            # it is known when the session is closed, too
            vars(self)["running_on"] = short_name(session.get_providers()[0])
            return session

    def _onnxruntime_session(self) -> Any:
        # from 1.29 on it reports model files and runs to its makers
        os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
        ort = import_extra("onnxruntime", "running a network", "onnxruntime", "onnx")
        options = ort.SessionOptions()
        options.intra_op_num_threads = self.threads
        options.log_severity_level = 3
        options.enable_mem_pattern = self.memory_pattern
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # its threads wait: a fifth less work
        providers = self._choose_providers(ort.get_available_providers())
        return ort.InferenceSession(str(self.path), options, providers=providers)

    def _choose_providers(self, installed: list[str]) -> list[str]:
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

    @cached_property
    def running_on(self) -> str:
        """The provider the session really got, by its short name."""
        return short_name(self.session.get_providers()[0])

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
        """Name -> (type, shape) of the graph's inputs; a size that is free is a name or None."""
        return {one.name: (one.type, list(one.shape)) for one in self.session.get_inputs()}

    @property
    def outputs(self) -> dict[str, tuple[str, list[Any]]]:
        """As `inputs`."""
        return {one.name: (one.type, list(one.shape)) for one in self.session.get_outputs()}

    @property
    def metadata(self) -> Mapping[str, str]:
        """Key -> text that stands in the file."""
        return self.session.get_modelmeta().custom_metadata_map

    def run(self, feed: dict[str, np.ndarray]) -> np.ndarray:
        """The first output for these inputs; FileError with the file's name where the runtime refuses them."""
        return self.run_all(feed)[0]

    def run_all(self, feed: dict[str, np.ndarray]) -> list[np.ndarray]:
        """All outputs, in the order of `outputs`; FileError as `run`."""
        sizes = {name: array.shape for name, array in feed.items()}
        with any_error(FileError, f"{self.path}: failed on {sizes}"):
            return [np.asarray(one) for one in self.session.run(None, feed)]


def short_name(provider: str) -> str:
    """Of one of ONNX Runtime's providers, as in PROVIDERS; its own where that has none."""
    return next((name for name, full in PROVIDERS.items() if full == provider), provider)


@functools.cache
def shipped_network(path: Path, memory_pattern: bool = True) -> NetworkFile:
    """A network that ships in the package, opened once a process."""
    return NetworkFile(path, memory_pattern=memory_pattern)


@system_errors(FileError)
def open_kept(kind: type[N], path: Path, **settings: Any) -> N:
    """The network of a file, as `kind` with these fields: one of the four used last, or anew where the file, the provider or the
    number of cores has changed."""
    _check_file(path)
    network: N = _open_file(path, kind, default_provider(), cores(), *settings.items())
    return network


@while_unchanged(keep=4)
def _open_file(path: Path, kind: type[N], provider: str | None, threads: int, *settings: tuple[str, Any]) -> N:
    return kind(path, provider, threads, **dict(settings))


def _check_file(path: Path) -> None:
    if not path.is_file():
        raise FileError(f"{path}: no such model file")
    if not path.stat().st_size:
        raise FileError(f"{path}: is empty (0 bytes)")


_OPEN: WeakSet[NetworkFile] = WeakSet()


def make_room(pixels: int) -> None:
    """Close all network files where a picture of so many pixels needs the memory (`close_networks`)."""
    if pixels > LARGE:
        close_networks()


def close_networks() -> None:
    """Close the sessions of all network files; they open again when they run.

    A session keeps what its largest run took, some 300 MB; opening one takes .06 s. What was freed goes back to the system, too,
    and from now on arrays of 8 MB do once they are freed: glibc keeps about as much, in pieces.
    """
    for one in list(_OPEN):
        vars(one).pop("session", None)
    _OPEN.clear()
    with contextlib.suppress(OSError, AttributeError, TypeError):  # glibc alone has it
        glibc = ctypes.CDLL(None)
        glibc.mallopt(-3, 2**23)  # M_MMAP_THRESHOLD, which left alone grows to four times as many bytes
        glibc.malloc_trim(0)
