"""A record in; whether the file on this disk is the one it means, with the reason, out."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dlama.errors import FileError, system_errors
from dlama.models.cache import describe_manual_install, target_path
from dlama.models.records import Record
from dlama.writing.unchanged import while_unchanged

PIECE = 1 << 20


@dataclass(frozen=True)
class Verdict:
    """What was found."""

    path: Path
    """Where the file lies, or would."""
    state: Literal["missing", "wrong", "verified", "unknown"]
    """unknown: its hash is published nowhere."""
    detail: str
    """What came and what was expected, in words."""


@system_errors(FileError)
def verify(model: Record) -> Verdict:
    """Compare size and sha256 with the record's. FileError: the file cannot be read."""
    path = target_path(model)
    again = f"`dlama models pull {model.name}`. {describe_manual_install(model)}"
    if not path.is_file():
        return Verdict(path, "missing", f"not there; {again}")
    size, digest = size_and_sha256(path)
    if complaint := mismatch(model, size, digest):
        return Verdict(path, "wrong", f"{complaint}; remove it and {again}")
    if model.sha256 is None:
        return Verdict(path, "unknown", f"sha256 {digest}, published nowhere, so not compared")
    return Verdict(path, "verified", f"sha256 {digest}")


def mismatch(model: Record, size: int, digest: str) -> str | None:
    """What is wrong with a model's file of that size (bytes) and sha256; None where nothing is."""
    if model.bytes is not None and size != model.bytes:
        return f"{'cut short' if size < model.bytes else 'too long'}: {size} bytes, expected {model.bytes}"
    if model.sha256 is not None and digest != model.sha256:
        return f"corrupted or replaced: sha256 is {digest}, expected {model.sha256}"
    return None


def sha256_of(path: Path) -> str:
    """64 hexadecimal digits of a file's content, read in pieces; FileError where it cannot be read."""
    return size_and_sha256(path)[1]


@system_errors(FileError)
@while_unchanged(keep=32)
def sha256_while_unchanged(path: Path) -> str:
    """As `sha256_of`; a file is read again only when it has changed."""
    return sha256_of(path)


def size_and_sha256(path: Path) -> tuple[int, str]:
    """Bytes and 64 hexadecimal digits, read in pieces; FileError where it cannot be read."""
    digest, size = hashlib.sha256(), 0
    with system_errors(FileError), path.open("rb") as file:
        while piece := file.read(PIECE):
            digest.update(piece)
            size += len(piece)
    return size, digest.hexdigest()
