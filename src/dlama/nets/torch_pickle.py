"""The pickle of a torch file in; its tables, and where its tensors lie, out. None of its code is run.

The unpickler knows four objects: ordered tables, the two tensor rebuilders, torch.Size and the storage types. Every other
global of any name becomes an inert placeholder that swallows its arguments. A pickle's size is bounded.
"""

from __future__ import annotations

import io
import pickle
from dataclasses import dataclass
from typing import Any

LARGEST_PICKLE = 4_000_000
"""Bytes; a checkpoint of LaMa has 0.3 MB."""
STORAGES = {
    "DoubleStorage": "F64", "FloatStorage": "F32", "HalfStorage": "F16", "BFloat16Storage": "BF16", "LongStorage": "I64",
    "IntStorage": "I32", "ShortStorage": "I16", "CharStorage": "I8", "ByteStorage": "U8", "BoolStorage": "BOOL",
}  # fmt: skip
"""Torch's names of the storage types -> dtypes as safetensors names them."""


@dataclass(frozen=True)
class StoredTensor:
    """A tensor that still lies in the archive."""

    key: str
    """Name of the storage entry, `<root>/data/<key>`."""
    storage: str
    """Torch's name of the storage type, FloatStorage and so on."""
    offset: int
    """First element."""
    shape: tuple[int, ...]
    """Sides."""
    strides: tuple[int, ...]
    """Steps, in elements."""


def read_pickle(data: bytes) -> Any:
    """The tree that a pickle describes.

    Raises any error that Python raises on a broken pickle; UnpicklingError: more bytes than are read, or a tensor that is none.
    """
    if len(data) > LARGEST_PICKLE:
        raise pickle.UnpicklingError(f"{len(data)} bytes; at most {LARGEST_PICKLE} are read")
    return _InertUnpickler(io.BytesIO(data), encoding="utf-8").load()


class Inert:
    """Stands for any global of a pickle: takes every argument, state and item, does nothing, and never calls anything."""

    state: dict[Any, Any]

    def __new__(cls, *args: Any, **kwargs: Any) -> Inert:
        inert = super().__new__(cls)
        inert.state = {}  # here, since pickles make objects without calling __init__
        return inert

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Nothing."""

    def __setitem__(self, key: Any, value: Any) -> None:
        self.state[key] = value

    def __call__(self, *args: Any, **kwargs: Any) -> Inert:
        return Inert()

    def append(self, *values: Any) -> None:
        """Swallow list items."""

    extend = add = append


@dataclass(frozen=True)
class _StorageType:
    """A storage class, as a word."""

    name: str


def _rebuild_tensor(place: Any, offset: Any, shape: Any, strides: Any, *others: Any) -> StoredTensor:
    """torch._utils._rebuild_tensor_v2: describes a tensor, makes none."""
    key, kind = place
    if not isinstance(key, str) or kind not in STORAGES:
        raise pickle.UnpicklingError("a tensor without a storage of a known type")
    numbers = (offset, *shape, *strides)
    if len(shape) != len(strides) or any(type(number) is not int or not 0 <= number < 2**63 for number in numbers):
        raise pickle.UnpicklingError("a tensor whose shape, strides or offset are no counts")
    return StoredTensor(key, kind, offset, tuple(shape), tuple(strides))


def _rebuild_parameter(tensor: Any, *others: Any) -> StoredTensor:
    """torch._utils._rebuild_parameter: the tensor that it wraps."""
    if not isinstance(tensor, StoredTensor):
        raise pickle.UnpicklingError("a parameter that wraps no tensor")
    return tensor


class _InertUnpickler(pickle._Unpickler):
    """Resolves no global of the interpreter at all: `find_class` returns this file's own stand-ins.

    The unpickler written in Python: of the one in C, BUILD cannot be replaced.
    """

    def find_class(self, module: str, name: str) -> Any:
        if module in ("torch", "torch.storage") and name in STORAGES:
            return _StorageType(name)
        known = {
            ("torch._utils", "_rebuild_tensor_v2"): _rebuild_tensor,
            ("torch._utils", "_rebuild_parameter"): _rebuild_parameter,
            ("collections", "OrderedDict"): dict,
            ("torch", "Size"): tuple,
        }
        return known.get((module, name), Inert)

    def persistent_load(self, pid: Any) -> tuple[str, str]:
        if not (isinstance(pid, tuple) and len(pid) >= 3 and pid[0] == "storage" and isinstance(pid[1], _StorageType)):
            raise pickle.UnpicklingError("a reference that is no storage of a known type")
        if not isinstance(pid[2], str) or "/" in pid[2]:
            raise pickle.UnpicklingError("a storage whose name is none")
        return pid[2], pid[1].name

    def build(self) -> None:
        """BUILD: a placeholder takes over a table; the state of anything else is dropped."""
        state, built = self.stack.pop(), self.stack[-1]  # type: ignore[attr-defined]
        if isinstance(built, StoredTensor):
            raise pickle.UnpicklingError("a tensor with a state of its own")
        table = state[0] if isinstance(state, tuple) and len(state) == 2 else state
        if isinstance(built, Inert) and isinstance(table, dict):
            built.state.update(table)

    dispatch = pickle._Unpickler.dispatch | {pickle.BUILD[0]: build}  # type: ignore[assignment]
