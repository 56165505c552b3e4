"""Whatever a result depends on in, a short hash out: a stored result counts only while its hash is the same."""

from __future__ import annotations

import dataclasses
import enum
import functools
import hashlib
import json
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.frames import Case
from dlama.evaluation.protocols.methods import Method

ROOMS = ("geometry", "models", "perception", "inpainters", "completion", "files", "datasets", "worlds", "evaluation")
"""The rooms whose code decides about numbers."""
SHOWING = {
    *(f"evaluation/runner/{name}.py" for name in ("run", "store", "results_table")),
    *(f"evaluation/report/{name}.py" for name in ("summary", "tables", "metric_names", "sections", "charts")),
    *(
        f"evaluation/report/{name}.py"
        for name in ("paired_comparison", "panel_choice", "page", "write", "paper_columns")
    ),
}
"""Files that only show numbers: a change there makes no result stale."""


def fingerprint(value: Any) -> str:
    """16 hexadecimal digits of what `described` says of a value."""
    text = json.dumps(described(value), sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def case_fingerprint(case: Case) -> str:
    """Of a case: its names, and what its `load` will read (files by name, size and time of change)."""
    return fingerprint([case.protocol, case.dataset, case.scene, case.frame, case.yaw, case.load])


def method_fingerprint(method: Method) -> str:
    """Of a method: its settings, and the bytes of its network file."""
    model = None if method.model is None else _file_sha256(method.model)
    return fingerprint([method.recipe, method.filler, model, dict(method.changes), method.seed])


@functools.lru_cache(maxsize=1)
def code_fingerprint() -> str:
    """Of dlama's own code that decides about numbers: another version of it makes results stale."""
    root, digest = Path(__file__).parents[2], hashlib.sha256()
    for room in ROOMS:
        for file in sorted((root / room).rglob("*.py")):
            name = file.relative_to(root).as_posix()
            if name not in SHOWING:
                digest.update(name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def described(value: Any) -> Any:
    """A value as JSON can hold it, such that equal values give equal text; files by name, size and time of change."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, enum.Enum):
        return [type(value).__qualname__, value.name]
    if isinstance(value, Path):
        return _described_file(value)
    if isinstance(value, np.ndarray):
        return [str(value.dtype), list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, np.generic):
        return described(value.item())
    return _described_compound(value)


def _described_compound(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): described(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [described(one) for one in value]
    if isinstance(value, (set, frozenset)):
        return sorted(json.dumps(described(one), sort_keys=True) for one in value)
    if isinstance(value, functools.partial):
        return ["call", described(value.func), described(value.args), described(value.keywords)]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: described(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return [type(value).__qualname__, fields]
    if hasattr(value, "__qualname__"):  # a function or a class
        return f"{value.__module__}.{value.__qualname__}"
    return hashlib.sha256(pickle.dumps(value)).hexdigest()


def _described_file(path: Path) -> Any:
    """A folder counts by its name only: what is read of it stands in the case as files."""
    try:
        found = path.stat()
    except OSError:
        return [str(path), "missing"]
    return [str(path)] if path.is_dir() else [str(path), found.st_size, found.st_mtime_ns]


@functools.lru_cache(maxsize=32)
def _file_sha256(path: Path) -> str:
    from dlama.inpainters.networks.engine import sha256_of

    return sha256_of(path)
