"""Bytes in; a file that holds all of them, or none at all, out. (`nets` imports nothing of dlama but its errors.)"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from dlama.errors import OutputError


def write_whole(target: Path, data: bytes) -> Path:
    """Write the bytes under a temporary name and rename it; returns the target. OutputError: nothing is left."""
    temporary = target.with_name(target.name + ".part")
    try:
        temporary.write_bytes(data)
        temporary.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written ({error})") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
    return target
