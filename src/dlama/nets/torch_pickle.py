"""The pickle of a torch file in; its tables, and where its tensors lie, out. None of its code is run.

The unpickler knows four objects: ordered tables, the two tensor rebuilders, torch.Size and the storage types. Every other
global of any name becomes an inert placeholder that swallows its arguments. What a pickle may cost is bounded: its
bytes, the kinds of keys of its tables (hashing tuples in tuples takes exponential time, and overflows the stack), the items it
copies.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

LARGEST_PICKLE = 4_000_000
"""Bytes; a checkpoint of LaMa has 0.3 MB."""
MOST_ITEMS = 500_000
"""Items that tables and placeholders may take over from others."""
MOST_SIDES = 64
"""Dimensions of a tensor, as in NumPy."""
LARGEST_INT = 2**60
"""Of a key: beyond, many whole numbers share one hash."""
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

    Raises any error that Python raises on a broken pickle; UnpicklingError: more bytes or items than are read, or a key that is
    no text, number, or short tuple of these.
    """
    if len(data) > LARGEST_PICKLE:
        raise pickle.UnpicklingError(f"{len(data)} bytes; at most {LARGEST_PICKLE} are read")
    return _InertUnpickler(data).load()


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
    if not isinstance(key, str) or kind not in STORAGES or len(shape) > MOST_SIDES:
        raise pickle.UnpicklingError("a tensor without a storage of a known type, or of too many sides")
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

    The unpickler written in Python: the one in C cannot be asked what it is about to hash, nor how large its memo grows.
    """

    def __init__(self, data: bytes) -> None:
        super().__init__(io.BytesIO(data), encoding="utf-8")
        self.items = 0

    def count(self, items: int) -> None:
        """So many more items are taken over; raises UnpicklingError where they become too many."""
        self.items += items
        if self.items > MOST_ITEMS:
            raise pickle.UnpicklingError(f"more than {MOST_ITEMS} items")

    def find_class(self, module: str, name: str) -> Any:
        if module in ("torch", "torch.storage") and name in STORAGES:
            return _StorageType(name)
        known = {
            ("torch._utils", "_rebuild_tensor_v2"): _rebuild_tensor,
            ("torch._utils", "_rebuild_parameter"): _rebuild_parameter,
            ("collections", "OrderedDict"): self.table,
            ("torch", "Size"): _size,
        }
        return known.get((module, name), Inert)

    def persistent_load(self, pid: Any) -> tuple[str, str]:
        if not (isinstance(pid, tuple) and len(pid) >= 3 and pid[0] == "storage" and isinstance(pid[1], _StorageType)):
            raise pickle.UnpicklingError("a reference that is no storage of a known type")
        if not isinstance(pid[2], str) or "/" in pid[2]:
            raise pickle.UnpicklingError("a storage whose name is none")
        return pid[2], pid[1].name

    def table(self, pairs: Iterable[Any] = ()) -> dict[Any, Any]:
        """OrderedDict, of pairs or empty."""
        made: dict[Any, Any] = {}
        for key, value in pairs:
            self.count(1)
            made[_check_key(key)] = value
        return made

    def build(self) -> None:
        """BUILD: a placeholder copies a table, whose items are counted; the state of anything else is dropped."""
        state, built = self.stack.pop(), self.stack[-1]  # type: ignore[attr-defined]
        if isinstance(built, StoredTensor):
            raise pickle.UnpicklingError("a tensor with a state of its own")
        table = state[0] if isinstance(state, tuple) and len(state) == 2 else state
        if isinstance(built, Inert) and isinstance(table, dict):
            self.count(len(table))
            built.state.update(table)

    def set_item(self) -> None:
        """SETITEM: key, value."""
        _check_key(self.stack[-2])  # type: ignore[attr-defined]
        pickle._Unpickler.load_setitem(self)  # type: ignore[attr-defined]


def _check_marked(operation: Callable[[Any], None], step: int) -> Callable[[_InertUnpickler], None]:
    """An operation on everything since the mark, of which each `step`-th is hashed."""

    def run(reader: _InertUnpickler) -> None:
        for key in reader.stack[::step]:  # type: ignore[attr-defined]
            _check_key(key)
        operation(reader)

    return run


_INHERITED: dict[int, Any] = pickle._Unpickler.dispatch
_OURS: dict[int, Any] = {
    pickle.BUILD[0]: _InertUnpickler.build,
    pickle.SETITEM[0]: _InertUnpickler.set_item,
    **{code[0]: _check_marked(_INHERITED[code[0]], 2) for code in (pickle.SETITEMS, pickle.DICT)},
    **{code[0]: _check_marked(_INHERITED[code[0]], 1) for code in (pickle.ADDITEMS, pickle.FROZENSET)},
}
_InertUnpickler.dispatch = _INHERITED | _OURS


def _check_key(key: Any) -> Any:
    """A key whose hash takes no time: text, a number, a stand-in, or a short tuple of these. Else UnpicklingError."""
    parts = key if type(key) is tuple and len(key) <= MOST_SIDES else (key,)
    for part in parts:
        plain = type(part) in (str, bytes, bool, float, type(None), _StorageType) or isinstance(part, (Inert, type))
        if not plain and not (type(part) is int and abs(part) < LARGEST_INT):
            raise pickle.UnpicklingError(f"a table with a key of type {type(part).__name__}")
    return key


def _size(sides: Sequence[Any] = ()) -> tuple[Any, ...]:
    """torch.Size."""
    if len(sides) > MOST_SIDES:
        raise pickle.UnpicklingError(f"a size of {len(sides)} sides")
    return tuple(sides)
