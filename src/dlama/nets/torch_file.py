"""A torch .ckpt, .pth or TorchScript .pt file in -> named tensors out, without torch and without running its code.

Such files are ZIP archives: a pickle that describes the objects, and one uncompressed entry per storage. The unpickler knows four
objects: ordered tables, the two tensor rebuilders, torch.Size and the storage types. Every other global of any name, a callback
class of an old trainer or an exploit, becomes an inert placeholder that swallows its arguments. A pickle's size is bounded.
"""

from __future__ import annotations

import io
import math
import pickle
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import FileError, any_error
from dlama.nets.safetensors_file import DTYPES, widen_bfloat16

DEEPEST = 100
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


class TorchFile:
    """An archive that was opened: names of its tensors, read from disk only when asked for.

    Attributes:
        tensors: dotted name -> where it lies.
        others: top-level entries that hold no tensor that is named (epoch, callbacks, hyper-parameters, ...).
        kind: torchscript; lightning (the tensors lie under `state_dict`); or torch.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with any_error(FileError, f"{path}: not a torch archive"):
            self._archive = zipfile.ZipFile(path)
        with self._archive:
            names = self._archive.namelist()
            roots = [name[: -len("data.pkl")] for name in names if name.endswith("data.pkl") and name.count("/") <= 1]
            if len(roots) != 1:
                raise FileError(f"{path}: a ZIP, but no torch archive: {len(roots)} entries */data.pkl in {len(names)}")
            self.root = roots[0]
            scripted = f"{self.root}constants.pkl" in names
            if f"{self.root}byteorder" in names and self._entry(self._archive, "byteorder").strip() != b"little":
                raise FileError(f"{path}: written on a big-endian machine, expected little-endian numbers")
            tree = self._unpickle()
        self.tensors, self.others, inner = _name_tensors(path, tree)
        if scripted:
            self.others = ()  # flags that every module of such an archive has
        self.kind = "torchscript" if scripted else "lightning" if inner else "torch"

    def read(self, names: Iterable[str]) -> dict[str, tuple[np.ndarray, str]]:
        """Those tensors (bfloat16 widened to float32, everything else as stored), each with its dtype in the file.

        Raises:
            FileError: a storage is missing, cut off, compressed, or smaller than the tensor's own strides need.
        """
        expected = list(names)
        found: dict[str, tuple[np.ndarray, str]] = {}
        key, data = None, b""
        with zipfile.ZipFile(self.path) as archive:
            for name in sorted(expected, key=lambda name: self.tensors[name].key):  # each storage is read once
                stored = self.tensors[name]
                if key != stored.key:
                    key, data = stored.key, self._entry(archive, f"data/{stored.key}")
                found[name] = self._tensor(data, name, stored)
        return {name: found[name] for name in expected}

    def _tensor(self, data: bytes, name: str, stored: StoredTensor) -> tuple[np.ndarray, str]:
        code = STORAGES[stored.storage]
        dtype = np.dtype(DTYPES[code])
        flat: np.ndarray = np.frombuffer(data, dtype, len(data) // dtype.itemsize)
        last = stored.offset + sum((side - 1) * step for side, step in zip(stored.shape, stored.strides))
        if 0 not in stored.shape and (last >= flat.size or math.prod(stored.shape) > flat.size):
            raise FileError(f"{self.path}: {name} {stored.shape} does not fit into its storage of {flat.size} numbers")
        steps = tuple(step * flat.itemsize for step in stored.strides)
        view = np.lib.stride_tricks.as_strided(flat[stored.offset :], stored.shape, steps, writeable=False)
        array = np.array(view, order="C")
        return (widen_bfloat16(array) if code == "BF16" else array), code

    def _entry(self, archive: zipfile.ZipFile, name: str) -> bytes:
        with any_error(FileError, f"{self.path}: entry {self.root}{name} cannot be read"):
            info = archive.getinfo(self.root + name)
            if info.compress_type != zipfile.ZIP_STORED:
                raise FileError(f"{self.path}: entry {info.filename} is compressed, which torch never does")
            return archive.read(info)

    def _unpickle(self) -> Any:
        data = self._entry(self._archive, "data.pkl")
        try:
            if len(data) > LARGEST_PICKLE:
                raise pickle.UnpicklingError(f"{len(data)} bytes; at most {LARGEST_PICKLE} are read")
            return _InertUnpickler(io.BytesIO(data), encoding="utf-8").load()
        except Exception as error:  # a broken pickle can raise anything at all
            reason = f"{type(error).__name__}: {error}"[:200]
            raise FileError(f"{self.path}: its pickle cannot be read ({reason})") from error


def _name_tensors(path: Path, tree: Any) -> tuple[dict[str, StoredTensor], tuple[str, ...], bool]:
    """Tensors by dotted name; of a Lightning checkpoint only those under `state_dict`, the rest is only named."""
    top = _children(tree)
    if not top:
        raise FileError(f"{path}: the archive holds a {type(tree).__name__}, expected a table of tensors or a module")
    inner = dict(_children(top["state_dict"])) if "state_dict" in top else None
    found = dict(_walk(top if inner is None else inner))
    used = {"state_dict"} if inner is not None else {name.split(".")[0] for name in found} | set(found)
    return found, tuple(str(key) for key in top if str(key) not in used), inner is not None


def _walk(top: dict[Any, Any]) -> Iterator[tuple[str, StoredTensor]]:
    """Depth first and without recursion, so that no nesting is too deep; an object met twice is walked once."""
    pending: list[tuple[str, int, Any]] = [("", 0, top)]
    seen: set[int] = set()
    while pending:
        prefix, depth, node = pending.pop()
        if isinstance(node, StoredTensor):
            yield prefix, node
        elif id(node) not in seen and depth < DEEPEST:
            seen.add(id(node))
            dot = "." if prefix else ""
            parts = reversed(_children(node).items())
            pending += [(f"{prefix}{dot}{key}", depth + 1, value) for key, value in parts]


def _children(node: Any) -> dict[Any, Any]:
    """Named parts of a table or of a placeholder that stands for a module; nothing for anything else."""
    if isinstance(node, Inert):
        inside = dict(node.state)
        for group in ("_parameters", "_buffers", "_modules"):  # a whole module that was pickled, not its state
            part = inside.pop(group, None)
            inside |= part if isinstance(part, dict) else {}
        return inside
    return node if isinstance(node, dict) else {}


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
