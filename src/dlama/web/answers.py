"""Fields that a page sends in, and what answers them, as types: bytes with their kind, and the limits of what is taken."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dlama.web.inputs import number

Fields = Mapping[str, Any]
"""What the page sent: JSON."""


@dataclass(frozen=True)
class Blob:
    """Bytes that are no JSON."""

    data: bytes
    kind: str
    """Media type."""
    name: str = ""
    """What a download of it is called."""
    headers: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Limits:
    """What the page takes."""

    megabytes: int = 64
    """Of one file."""
    megapixels: float = 16.0
    """Of one picture."""
    visits: int = 8
    """Pages open at once."""

    @property
    def bytes(self) -> int:
        """Of one file."""
        return self.megabytes * 2**20


def pixel_of(fields: Fields) -> tuple[int, int]:
    """Column and row."""
    return int(number("x", fields.get("x"), "")), int(number("y", fields.get("y"), ""))
