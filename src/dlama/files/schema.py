"""The schema number of a file of results (meta.json, scene.npz, rows of the manifest) in; whether this version knows it, out."""

from __future__ import annotations

from typing import Any

from dlama.errors import FileError

SCHEMA = 1
"""Raised where a field gets another meaning or leaves; a field that is added raises nothing, and older numbers are read."""


def check_schema(found: Any) -> None:
    """FileError for fields of a later version; a file without a number is of 1."""
    number = SCHEMA if found is None else int(found)
    if not 1 <= number <= SCHEMA:
        raise FileError(
            f"has fields of schema {number}, and this version reads 1 to {SCHEMA}: a newer dlama is expected"
        )
