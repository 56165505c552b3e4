"""The list of kernels and their types (assets/kernels.txt) in; the kernels compiled and on disk before they are called, out.

numba compiles one kernel at a time in a process, so several processes share the list. A command that meets its first kernel
compiles in the order of need, its helper from the other end: they meet in the middle.
"""

from __future__ import annotations

import atexit
import gc
import pkgutil
import re
import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

from dlama.geometry.kernels.jit import threads
from dlama.geometry.kernels.stored import NOT_KEPT

LISTED = Path(__file__).parents[2] / "assets" / "kernels.txt"
"""A line for each kernel, in the order of need: jobs, `module:name`, types. `benchmarks/kernels.py` makes it."""


def listed_kernels(job: str | None = None) -> list[list[str]]:
    """The words of the lines of a job (a name of JOBS of `benchmarks/kernels.py`); None or another name: of all."""
    lines = [line.split() for line in LISTED.read_text("utf-8").splitlines()]
    return [words for words in lines if job in words[0].split(",")] or lines


def numba_type(word: str) -> Any:
    """`int64`; `uint8.3C` for arrays: number of dimensions, layout, r = read-only; `module:Name(int64,uint8.3C)`: NamedTuples, of
    others too; without a name: tuples."""
    types: Any = import_module("numba").types
    if word.endswith(")"):
        name, _, inside = word[:-1].partition("(")
        words = re.findall(r"(?:[^,()]|\([^()]*\))+", inside)
        return types.BaseTuple.from_types(list(map(numba_type, words)), pkgutil.resolve_name(name) if name else None)
    name, _, layout = word.partition(".")
    number = getattr(types, "boolean" if name == "bool" else name)
    return types.Array(number, int(layout[0]), layout[1], readonly=layout.endswith("r")) if layout else number


def compile_listed(job: str, begin: int, step: int) -> None:
    """Compile each step-th kernel of the job's list, from its end on, or find it on disk."""
    for _, kernel, *types in listed_kernels(job)[::-1][begin::step]:
        pkgutil.resolve_name(kernel).compile(tuple(map(numba_type, types)))


def start_compiling(job: str, processes: int) -> list[subprocess.Popen[bytes]]:
    """So many processes (at most 4) that compile the job's kernels, under way; they end with this one at the latest."""
    processes = min(processes, 4)  # more would take longer to start than they save
    line = [sys.executable, "-m", __name__, job]
    started = [
        subprocess.Popen(
            [*line, str(begin), str(processes)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for begin in range(processes)
    ]
    for one in started:
        atexit.register(one.terminate)
    return started


def help_compiling(job: str) -> None:
    """Start a process that compiles the job's kernels from the end of the list on, while this one begins at its start; none where
    there is a single processor."""
    if threads() > 1:
        start_compiling(job, 1)


if __name__ == "__main__":
    warnings.filterwarnings("error", NOT_KEPT[:40])  # it would compile for nothing
    gc.disable()  # it ends soon, and looking for garbage at its end alone takes half a second
    compile_listed(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    gc.freeze()
