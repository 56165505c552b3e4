"""A torch .ckpt, .pth or TorchScript .pt file in -> named tensors out, without torch and without running its code.

Such files are ZIP archives: a pickle that describes the objects, and one uncompressed entry per storage. `torch_pickle` reads
the pickle, to which a callback class of an old trainer and an exploit are equally harmless.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dlama.errors import FileError
from dlama.nets.safetensors_file import DTYPES, widen_bfloat16
from dlama.nets.torch_pickle import STORAGES, Inert, StoredTensor, read_pickle

DEEPEST = 100


class TorchFile:
    """An archive that was opened: names of its tensors, read from disk only when asked for.

    Attributes:
        tensors: dotted name -> where it lies.
        others: top-level entries that hold no tensor that is named (epoch, callbacks, hyper-parameters, ...).
        kind: torchscript; lightning (the tensors lie under `state_dict`); or torch.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._archive = zipfile.ZipFile(path)
        except Exception as error:  # BadZipFile, OSError, NotImplementedError, UnicodeDecodeError, ...
            raise FileError(f"{path}: not a torch archive ({error})") from error
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
                if key != self.tensors[name].key:
                    key = self.tensors[name].key
                    data = self._entry(archive, f"data/{key}")
                found[name] = self._tensor(data, name, self.tensors[name])
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
        try:
            info = archive.getinfo(self.root + name)
            if info.compress_type != zipfile.ZIP_STORED:
                raise FileError(f"{self.path}: entry {info.filename} is compressed, which torch never does")
            return archive.read(info)
        except FileError:
            raise
        except Exception as error:  # KeyError, EOFError, OSError, BadZipFile, NotImplementedError, RuntimeError, ...
            raise FileError(f"{self.path}: entry {self.root}{name} cannot be read ({error})") from error

    def _unpickle(self) -> Any:
        try:
            return read_pickle(self._entry(self._archive, "data.pkl"))
        except FileError:
            raise
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
