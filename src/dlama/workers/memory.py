"""A process in; its peak memory out, and whether this computer can hold so many processes."""

from __future__ import annotations

import sys
from pathlib import Path

from dlama.arguments import check_count
from dlama.completion.memory import GB, available_bytes
from dlama.errors import InputError
from dlama.models.network_file import processor_count

LEAST = 2
"""Processes that are allowed on any computer: one can read while the other computes."""
PROCESS_BYTES = 3e8
"""Memory that a process takes at least: libraries, kernels and a small picture."""


def check_processes(count: int, name: str) -> None:
    """InputError for processes that this computer has no cores or no memory for; `name`: the parameter that asks for them."""
    cores, free = processor_count(), available_bytes()
    check_count(count, name)
    if count > max(cores, LEAST):
        raise InputError(
            f"`{name}` is {count}; this computer has {cores} processor cores, so at most {cores} is expected"
        )
    if count > 1 and free is not None and count * PROCESS_BYTES > free:
        raise InputError(
            f"`{name}` is {count}; as many processes take at least {count * PROCESS_BYTES / GB:.1f} GB of memory, "
            f"{free / GB:.1f} GB are free, so at most {max(1, int(free / PROCESS_BYTES))} is expected"
        )


def reset_peak() -> bool:
    """Reset the kernel's count of peak memory (Linux); False where that cannot be done."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return False
    return True


def peak_mib(since_reset: bool) -> float | None:
    """Largest resident memory of this process in MiB: since `reset_peak`, or since it started; None: not known."""
    if since_reset:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
