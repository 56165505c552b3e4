"""A torch .ckpt, .pth or TorchScript .pt file in -> named tensors out, without torch and without running its code.

Such files are ZIP archives: a pickle that describes the objects, and one uncompressed entry per storage. The pickle
is read by an unpickler that knows four things: ordered tables, the two tensor rebuilders, torch.Size and the
storage types. Every other global, whatever it is called, becomes an inert placeholder that swallows its arguments,
so a callback class of an old trainer and an exploit are equally harmless.
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

from dlama.errors import FileError
from dlama.nets.safetensors_file import widen_bfloat16

DEEPEST = 100
STORAGES = {
    "DoubleStorage": ("F64", np.float64), "FloatStorage": ("F32", np.float32), "HalfStorage": ("F16", np.float16),
    "BFloat16Storage": ("BF16", np.uint16), "LongStorage": ("I64", np.int64), "IntStorage": ("I32", np.int32),
    "ShortStorage": ("I16", np.int16), "CharStorage": ("I8", np.int8), "ByteStorage": ("U8", np.uint8),
    "BoolStorage": ("BOOL", np.bool_),
}  # fmt: skip


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
        placeholders: globals the pickle asked for that were not resolved, `module.name`.
        kind: torchscript; lightning (the tensors lie under `state_dict`); or torch.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._archive = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, OSError) as error:
            raise FileError(f"{path}: not a torch archive ({error})") from error
        with self._archive:
            names = self._archive.namelist()
            roots = [name[: -len("data.pkl")] for name in names if name.endswith("data.pkl") and name.count("/") <= 1]
            if len(roots) != 1:
                raise FileError(f"{path}: a ZIP, but no torch archive: {len(roots)} entries */data.pkl in {len(names)}")
            self.root = roots[0]
            scripted = f"{self.root}constants.pkl" in names
            if f"{self.root}byteorder" in names and self._entry(self._archive, "byteorder").strip() != b"little":
                raise FileError(f"{path}: written on a big-endian machine, wanted little-endian numbers")
            tree, self.placeholders = self._unpickle()
        self.tensors, self.others, inner = _named(path, tree)
        if scripted:
            self.others = ()  # flags that every module of such an archive has
        self.kind = "torchscript" if scripted else "lightning" if inner else "torch"

    def read(self, names: Iterable[str]) -> dict[str, tuple[np.ndarray, str]]:
        """Those tensors (bfloat16 widened to float32, everything else as stored), each with its dtype in the file.

        Raises:
            FileError: a storage is missing, cut off, compressed, or smaller than the tensor's own strides need.
        """
        with zipfile.ZipFile(self.path) as archive:
            return {name: self._tensor(archive, name, self.tensors[name]) for name in names}

    def _tensor(self, archive: zipfile.ZipFile, name: str, stored: StoredTensor) -> tuple[np.ndarray, str]:
        code, dtype = STORAGES[stored.storage]
        data = self._entry(archive, f"data/{stored.key}")
        flat: np.ndarray = np.frombuffer(data, dtype, len(data) // np.dtype(dtype).itemsize)
        last = stored.offset + sum((side - 1) * step for side, step in zip(stored.shape, stored.strides))
        if 0 not in stored.shape and (last >= flat.size or math.prod(stored.shape) > flat.size):
            raise FileError(f"{self.path}: {name} {stored.shape} does not fit into its storage of {flat.size} numbers")
        steps = tuple(step * flat.itemsize for step in stored.strides)
        view = np.lib.stride_tricks.as_strided(flat[stored.offset :], stored.shape, steps, writeable=False)
        array = np.array(view, order="C")
        return (widen_bfloat16(array) if code == "BF16" else array), code

    def _entry(self, archive: zipfile.ZipFile, name: str) -> bytes:
        try:
            info = archive.getinfo(self.root + name)
            if info.compress_type != zipfile.ZIP_STORED:
                raise FileError(f"{self.path}: entry {info.filename} is compressed, which torch never does")
            return archive.read(info)
        except (KeyError, EOFError, OSError, zipfile.BadZipFile) as error:
            raise FileError(f"{self.path}: entry {self.root}{name} cannot be read ({error})") from error

    def _unpickle(self) -> tuple[Any, tuple[str, ...]]:
        reader = _InertUnpickler(io.BytesIO(self._entry(self._archive, "data.pkl")))
        try:
            tree = reader.load()
        except Exception as error:  # a broken pickle can raise anything at all
            raise FileError(f"{self.path}: its pickle cannot be read ({type(error).__name__}: {error})") from error
        return tree, tuple(sorted(reader.unresolved))


class Inert:
    """Stands for any global of a pickle: takes every argument, state and item, does nothing, and never calls anything."""

    state: dict[Any, Any]

    def __new__(cls, *args: Any, **kwargs: Any) -> Inert:
        inert = super().__new__(cls)
        inert.state = {}  # here, since pickles make objects without calling __init__
        return inert

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Nothing."""

    def __setstate__(self, state: Any) -> None:
        if isinstance(state, tuple) and len(state) == 2 and isinstance(state[0], dict):
            state = state[0]
        self.state.update(state if isinstance(state, dict) else {})

    def __setitem__(self, key: Any, value: Any) -> None:
        self.state[key] = value

    def __call__(self, *args: Any, **kwargs: Any) -> Inert:
        return Inert()

    def append(self, *values: Any) -> None:
        """Swallow list items."""

    extend = add = append


class _Table(dict[Any, Any]):
    """An ordered table whose extra state (`_metadata` of a state dict) is dropped."""

    def __setstate__(self, state: Any) -> None:
        """Nothing."""


class _StorageType:
    """A storage class, as a word."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name

    def __setstate__(self, state: Any) -> None:
        """Nothing."""


class _Rebuild:
    """torch._utils._rebuild_tensor_v2 and _rebuild_parameter: they describe a tensor, they do not make one."""

    __slots__ = ("parameter",)

    def __init__(self, parameter: bool) -> None:
        self.parameter = parameter

    def __setstate__(self, state: Any) -> None:
        """Nothing: a pickle must not be able to change the rebuilder."""

    def __call__(self, *args: Any) -> StoredTensor:
        if self.parameter:
            if not isinstance(args[0], StoredTensor):
                raise pickle.UnpicklingError("a parameter that wraps no tensor")
            return args[0]
        (key, kind), offset, shape, strides = args[:4]
        numbers = (offset, *shape, *strides)
        if len(shape) != len(strides) or any(type(number) is not int or number < 0 for number in numbers):
            raise pickle.UnpicklingError("a tensor whose shape, strides or offset are no counts")
        return StoredTensor(key, kind, offset, tuple(shape), tuple(strides))


class _InertUnpickler(pickle.Unpickler):
    """Resolves no global of the interpreter at all: `find_class` returns this file's own stand-ins."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, encoding="utf-8")
        self.unresolved: set[str] = set()

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in (("torch._utils", "_rebuild_tensor_v2"), ("torch._utils", "_rebuild_parameter")):
            return _Rebuild(parameter=name.endswith("parameter"))
        if module in ("torch", "torch.storage") and name in STORAGES:
            return _StorageType(name)
        if (module, name) == ("collections", "OrderedDict"):
            return _Table
        if (module, name) == ("torch", "Size"):
            return tuple
        self.unresolved.add(f"{module}.{name}")
        return type("Inert", (Inert,), {})

    def persistent_load(self, pid: Any) -> tuple[str, str]:
        if not (isinstance(pid, tuple) and len(pid) >= 3 and pid[0] == "storage" and isinstance(pid[1], _StorageType)):
            raise pickle.UnpicklingError("a reference that is no storage of a known type")
        if not isinstance(pid[2], str) or "/" in pid[2]:
            raise pickle.UnpicklingError("a storage whose name is none")
        return pid[2], pid[1].name


def _named(path: Path, tree: Any) -> tuple[dict[str, StoredTensor], tuple[str, ...], bool]:
    """Tensors by dotted name; of a Lightning checkpoint only those under `state_dict`, the rest is only named."""
    top = _children(tree)
    if not top:
        raise FileError(f"{path}: the archive holds a {type(tree).__name__}, wanted a table of tensors or a module")
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
