"""The cameras of a job in; InputError out, before anything is computed, where this machine's memory cannot hold their views."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from dlama.errors import InputError
from dlama.geometry.camera import Camera

BYTES_PER_PIXEL = 150
"""Of one view while it is rendered and filled (measured at 2048 x 2048: 117 layered, 115 telea), and 30 of each that is kept."""
BYTES_KEPT = 30
LONGEST_SIDE = 2**15 - 1
"""Pixels: OpenCV's resampling takes no longer ones."""
GB = 1e9
CGROUP = Path("/sys/fs/cgroup")


def check_memory(cameras: Sequence[Camera]) -> None:
    """Raise InputError where completing these views would take more memory than is free."""
    sizes = [camera.width * camera.height for camera in cameras]
    if not sizes:
        return
    largest = max(cameras, key=lambda camera: camera.width * camera.height)
    size = f"the camera is {largest.width}x{largest.height} pixels"
    if max(largest.wh) > LONGEST_SIDE:
        raise InputError(f"{size}; sides of at most {LONGEST_SIDE} are expected")
    needed = BYTES_PER_PIXEL * max(sizes) + BYTES_KEPT * sum(sizes)
    free = available_bytes()
    if free is not None and needed > free:
        raise InputError(
            f"{size}: completing it takes about {needed / GB:.1f} GB of memory and {free / GB:.1f} GB are free; "
            "give a smaller camera or picture"
        )


def available_bytes() -> int | None:
    """Bytes of memory that a process can still take: of the machine, or of its container; None: not known."""
    found = [each for each in (_of_machine(), _of_container()) if each is not None]
    return min(found) if found else None


def _of_machine() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text("ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except (OSError, ValueError, IndexError):
        pass
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def _of_container() -> int | None:
    """What cgroup v2 leaves of its limit; pages that can be dropped count as free."""
    try:
        limit = (CGROUP / "memory.max").read_text("ascii").strip()
        used = int((CGROUP / "memory.current").read_text("ascii"))
        fields = dict(line.split() for line in (CGROUP / "memory.stat").read_text("ascii").splitlines())
        return None if limit == "max" else max(0, int(limit) - used + int(fields.get("inactive_file", 0)))
    except (OSError, ValueError):
        return None
