"""Everything that a result depends on in; a short hash out. A stored result is used only under the hash it was made with."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.frames import Case
from dlama.evaluation.metrics.pictures import SETTINGS as METRIC_SETTINGS
from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.files.results.meta_json import package_versions
from dlama.inpainters import FILLERS, model_file
from dlama.models.network_file import default_provider
from dlama.models.verify import sha256_while_unchanged
from dlama.writing.unchanged import stamp_of

SHOWING = ("apps/", "jobs/", "training/", "web/", "evaluation/report/")
"""Folders whose code makes no number: a change there makes no result stale. The imports' order keeps what measures apart."""
SOURCE = Path(__file__).parents[2]
"""src/dlama."""
PACKAGES = (
    *("numpy", "numba", "opencv-python-headless", "opencv-python", "onnxruntime", "onnxruntime-gpu"),
    *("scikit-image", "scipy", "pillow", "OpenEXR"),
)
"""Other people's code that decides about numbers: another version of one makes results stale."""
WEIGHTS = ("assets/confidence/confidence.npz",)
"""Files with weights that every method uses (those of a filler are in its method's hash)."""


def cache_key(case: str, method: str, settings: ProtocolSettings, protocol: Callable[..., Any]) -> str:
    """The key of one result: 16 hexadecimal digits of its case's and method's hashes, all settings, dlama's own code, and what it
    computes with."""
    weights = {name: sha256_while_unchanged(SOURCE / name) for name in WEIGHTS if (SOURCE / name).is_file()}
    computing = {"versions": versions(), "provider": default_provider(), "weights": weights}
    return short_hash([code_hash(), computing, case, method, METRIC_SETTINGS, settings, protocol])


@functools.lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Of the PACKAGES that are installed."""
    return package_versions(PACKAGES)


def short_hash(value: Any) -> str:
    """16 hexadecimal digits of the sha256 of a value as JSON; equal values give equal text."""
    text = json.dumps(value, default=describe, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def case_hash(case: Case) -> str:
    """Of a case: its names, and what its `load` will read (files by name, size and time of change)."""
    return short_hash([case.protocol, case.dataset, case.scene, case.frame, case.yaw, case.load])


def method_hash(method: Method) -> str:
    """Of a method: its settings, and the bytes of its network file."""
    file = model_file(method.filler, method.model) if method.filler in FILLERS else method.model
    model = None if file is None else sha256_while_unchanged(file)
    return short_hash([method.recipe, method.filler, model, method.seed])


@functools.lru_cache(maxsize=1)
def code_hash() -> str:
    """Of dlama's own code that decides about numbers and panels: another version of it makes results stale."""
    digest = hashlib.sha256()
    for name in sorted(file.relative_to(SOURCE).as_posix() for file in SOURCE.rglob("*.py")):
        if not name.startswith(SHOWING):
            digest.update(name.encode() + b"\0" + (SOURCE / name).read_bytes())
    return digest.hexdigest()[:16]


def describe(value: Any) -> Any:
    """What JSON does not know. Files count by name, size and time of change."""
    if isinstance(value, Path):
        return _describe_file(value)
    if isinstance(value, np.ndarray):
        return [str(value.dtype), list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, functools.partial):
        return ["call", value.func, value.args, value.keywords]
    if hasattr(value, "__qualname__"):  # a function or a class
        return f"{value.__module__}.{value.__qualname__}"
    if dataclasses.is_dataclass(value):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return [type(value).__qualname__, fields]
    return hashlib.sha256(pickle.dumps(value)).hexdigest()


def _describe_file(path: Path) -> Any:
    """A folder counts by its name only: the files that are read from it stand in the case themselves."""
    try:
        stamp = stamp_of(path)
    except OSError:
        return [str(path), "missing"]
    return [str(path)] if path.is_dir() else [str(path), *stamp]
