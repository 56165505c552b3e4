"""A compiled kernel in; files of numba's cache, which later processes load it from, out."""

from __future__ import annotations

import functools
import warnings
from contextlib import suppress
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

from llvmlite.binding import parse_assembly
from numba.core.caching import CompileResultCacheImpl, FunctionCache

NOT_KEPT = (
    "compiled kernels cannot be kept, for neither the package's folder nor the user's cache can be written, or the disk is full: "
    "every run compiles them again, which takes about 10 seconds; set NUMBA_CACHE_DIR to a folder that can be written"
)
DAMAGED = (OSError, EOFError, UnpicklingError)
"""What reading and writing raise of files that a crash, or a full disk, left."""


@functools.cache
def warn_not_kept() -> None:
    """Warn, once a process."""
    warnings.warn(NOT_KEPT, UserWarning, stacklevel=3)


class StoredKernel(CompileResultCacheImpl):
    """What numba keeps of a kernel, but for the code that others would be linked with: no kernel is a part of another one, and
    reading it took half the time of a load. In its place stand the names that are looked up in it."""

    def reduce(self, cres: Any) -> Any:
        """What is stored of a compiled kernel."""
        (name, kind, (machine_code, _)), about, *others = super().reduce(cres)
        names = about.llvm_func_name, about.llvm_cpython_wrapper_name
        stubs = "\n".join(f'define void @"{one}"() {{\n unreachable\n}}' for one in names)
        return (name, kind, (machine_code, parse_assembly(stubs).as_bitcode())), about, *others


class KernelCache(FunctionCache):
    """numba's cache on disk, without the types and functions that it prepares for a compilation at every load.

    A third of a second for the first kernel of a process; numba prepares them again before it compiles anything.
    """

    _impl_class = StoredKernel

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled kernel of that signature; None where it is not on disk, or no longer whole."""
        try:
            return self._load_overload(sig, target_context)
        except DAMAGED:
            self._forget()

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compiled kernel of that signature; warns where the disk is full."""
        try:
            self._save_overload(sig, data)
        except DAMAGED:
            self._forget()
            warn_not_kept()

    def _forget(self) -> None:
        """Remove the index of its files: a new one may name a file that an older version left."""
        with suppress(OSError):
            Path(self._cache_file._index_path).unlink()
