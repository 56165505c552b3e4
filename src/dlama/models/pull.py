"""A record in; its file, downloaded, checked and moved into place, out.

Received bytes lie in a .part file next to the target, so that an interrupted pull resumes. The file
itself appears under its name only when it is whole and its hash is right.
"""

from __future__ import annotations

from pathlib import Path

from dlama.errors import FileError, OutputError, system_errors
from dlama.models.cache import PINS, describe_manual_install, known_size_and_sha256, pin, target_path
from dlama.models.download import Progress, Unusable, download
from dlama.models.records import Record
from dlama.models.verify import mismatch, size_and_sha256, verify


def pull(model: Record, progress: Progress | None = None) -> Path:
    """The model's file, from the first mirror that has it; a good file that exists is kept.

    Args:
        model: its record.
        progress: called with the bytes that have arrived and the bytes in all (None: unknown).
    Raises:
        FileError: no mirror gave the right file; lists each failure, and how to download by hand.
        OutputError: the cache directory cannot be written.
    """
    target = target_path(model)
    if target.is_file() and verify(model).state in ("verified", "pinned"):
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{target.parent}: cannot be made ({error}); DLAMA_MODELS names another directory") from error
    failures: list[str] = []
    for url in model.urls:
        try:
            return _from_mirror(url, model, target, progress)
        except Unusable as error:
            failures.append(f"{url}: {error}")
    reasons = "; ".join(failures)
    raise FileError(f"{model.name}: no mirror gave the right file [{reasons}]. {describe_manual_install(model)}")


def _from_mirror(url: str, model: Record, target: Path, progress: Progress | None) -> Path:
    """From one mirror, moved into place, its hash pinned where none is published; a wrong hash after a resumed download is given
    one more try from the start.

    It resumes where the hash tells whether the pieces are of one file.
    """
    part = target.with_name(f"{target.name}.part")
    while True:
        resumed = download(url, part, model.bytes, progress, resume=model.sha256 is not None)
        size, digest = size_and_sha256(part)
        known_size, known = known_size_and_sha256(model)
        complaint = mismatch(size, digest, known_size, known)
        if not complaint:
            break
        part.unlink()
        if model.sha256 is None:
            complaint += f" (pinned when it was first used; remove its entry in {PINS} to take the new one)"
        if not resumed:
            raise Unusable(complaint)
    with system_errors(OutputError):
        part.replace(target)
    if known is None:
        pin(model, digest, size)
    return target
