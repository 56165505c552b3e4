"""A record in; whether the file on this disk is the one it means, with the reason, out."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dlama.errors import FileError, system_errors
from dlama.models.cache import describe_manual_install, known_size_and_sha256, pin, target_path
from dlama.models.records import Record
from dlama.writing.unchanged import while_unchanged

PIECE = 1 << 20


@dataclass(frozen=True)
class Verdict:
    """What was found."""

    path: Path
    """Where the file lies, or would."""
    state: Literal["missing", "wrong", "verified", "pinned"]
    """pinned: its hash is published nowhere, so it was written down now and is compared from now on."""
    detail: str
    """What came and what was expected, in words."""


@system_errors(FileError)
def verify(model: Record) -> Verdict:
    """Compare size and sha256 with the record's, or with those pinned on first use; the first use pins.

    Raises:
        FileError: the file cannot be read.
        OutputError: the hash cannot be written down.
    """
    path = target_path(model)
    again = f"`dlama models pull {model.name}`. {describe_manual_install(model)}"
    if not path.is_file():
        return Verdict(path, "missing", f"not there; {again}")
    size, digest = size_and_sha256(path)
    known_size, known_digest = known_size_and_sha256(model)
    complaint = mismatch(size, digest, known_size, known_digest)
    if complaint:
        return Verdict(path, "wrong", f"{complaint}; remove it and {again}")
    if known_digest is not None:
        return Verdict(path, "verified", f"sha256 {digest}")
    pin(model, digest, size)
    return Verdict(path, "pinned", f"sha256 {digest}, published nowhere: pinned now, compared from now on")


def mismatch(size: int, digest: str, known_size: int | None, known_digest: str | None) -> str | None:
    """What is wrong with a file of that size (bytes) and sha256; None where nothing is."""
    if known_size is not None and size != known_size:
        return f"{'cut short' if size < known_size else 'too long'}: {size} bytes, expected {known_size}"
    if known_digest is not None and digest != known_digest:
        return f"corrupted or replaced: sha256 is {digest}, expected {known_digest}"
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
